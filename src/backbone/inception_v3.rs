//! Inception-V3 (Szegedy et al. 2015, "Rethinking the Inception architecture"), with torchvision's tensor names.

use super::description::{Padding, Variant};
use super::graph::{Activation, Builder, Form, Graph, Map};
use crate::kernel::Pad;

/// The architecture for inputs of `side` pixels; `None` if that is too small.
pub(super) fn graph(side: usize, variant: &Variant) -> Option<Graph> {
    let mut net = Net(Builder::new(side, Pad::default()));
    net.0.average_counts_padding(variant.average_counts_padding);
    let mut x = net.stem();
    for (name, pooled) in [("Mixed_5b", 32), ("Mixed_5c", 64), ("Mixed_5d", 64)] {
        x = net.block_a(name, x, pooled);
    }
    x = net.block_b("Mixed_6a", x);
    for (name, width) in [("Mixed_6b", 128), ("Mixed_6c", 160), ("Mixed_6d", 160), ("Mixed_6e", 192)] {
        x = net.block_c(name, x, width);
    }
    x = net.block_d("Mixed_7a", x);
    for name in ["Mixed_7b", "Mixed_7c"] {
        x = net.block_e(name, x);
    }
    net.0.finish()
}

struct Net(Builder);

/// A layer of stride 1 whose output is as large as its input.
fn same(outputs: usize, height: usize, width: usize) -> Form {
    Form { outputs, kernel: (height, width), stride: 1, padding: Padding::Symmetric, activation: Activation::Relu }
}

/// A layer without padding.
fn valid(outputs: usize, side: usize, stride: usize) -> Form {
    Form { stride, padding: Padding::Valid, ..same(outputs, side, side) }
}

impl Net {
    fn conv(&mut self, name: &str, x: Map, form: Form) -> Map {
        self.0.conv((&format!("{name}.conv"), &format!("{name}.bn")), x, form)
    }

    fn into(&mut self, name: &str, x: Map, form: Form, output: Map, channel: usize) {
        self.0.conv_into((&format!("{name}.conv"), &format!("{name}.bn")), x, form, output, channel);
    }

    /// Layers one after the other, the last of them into some channels of `output`.
    fn branch(&mut self, block: &str, mut x: Map, layers: &[(&str, Form)], output: Map, channel: usize) {
        if let Some(((last, form), before)) = layers.split_last() {
            for (name, form) in before {
                x = self.conv(&format!("{block}.{name}"), x, *form);
            }
            self.into(&format!("{block}.{last}"), x, *form, output, channel);
        }
    }

    fn pooled(&mut self, block: &str, x: Map, outputs: usize, output: Map, channel: usize) {
        let pooled = self.0.average_pool(x);
        self.into(&format!("{block}.branch_pool"), pooled, same(outputs, 1, 1), output, channel);
    }

    fn tap(&mut self, block: &str, map: Map) -> Map {
        self.0.tap(&block.to_lowercase(), map);
        map
    }

    fn stem(&mut self) -> Map {
        let x = self.conv("Conv2d_1a_3x3", 0, valid(32, 3, 2));
        let x = self.conv("Conv2d_2a_3x3", x, valid(32, 3, 1));
        let x = self.conv("Conv2d_2b_3x3", x, same(64, 3, 3));
        let x = self.0.max_pool(x, 3, 2, Padding::Valid);
        let x = self.conv("Conv2d_3b_1x1", x, valid(80, 1, 1));
        let x = self.conv("Conv2d_4a_3x3", x, valid(192, 3, 1));
        self.0.max_pool(x, 3, 2, Padding::Valid)
    }

    /// Figure 5 of the paper: two 3 × 3 in place of one 5 × 5.
    fn block_a(&mut self, name: &str, x: Map, pooled: usize) -> Map {
        let out = self.0.joined(x, 1, 224 + pooled);
        self.branch(name, x, &[("branch1x1", same(64, 1, 1))], out, 0);
        self.branch(name, x, &[("branch5x5_1", same(48, 1, 1)), ("branch5x5_2", same(64, 5, 5))], out, 64);
        let double = [
            ("branch3x3dbl_1", same(64, 1, 1)),
            ("branch3x3dbl_2", same(96, 3, 3)),
            ("branch3x3dbl_3", same(96, 3, 3)),
        ];
        self.branch(name, x, &double, out, 128);
        self.pooled(name, x, pooled, out, 224);
        self.tap(name, out)
    }

    /// Halves the maps (Figure 10).
    fn block_b(&mut self, name: &str, x: Map) -> Map {
        let out = self.0.joined(x, 2, 480 + self.0.channels(x));
        self.branch(name, x, &[("branch3x3", valid(384, 3, 2))], out, 0);
        let double = [
            ("branch3x3dbl_1", same(64, 1, 1)),
            ("branch3x3dbl_2", same(96, 3, 3)),
            ("branch3x3dbl_3", valid(96, 3, 2)),
        ];
        self.branch(name, x, &double, out, 384);
        self.0.max_pool_into(x, out, 480);
        self.tap(name, out)
    }

    /// Figure 6: 7 × 7 as 1 × 7 and 7 × 1.
    fn block_c(&mut self, name: &str, x: Map, width: usize) -> Map {
        let out = self.0.joined(x, 1, 768);
        self.branch(name, x, &[("branch1x1", same(192, 1, 1))], out, 0);
        let single =
            [("branch7x7_1", same(width, 1, 1)), ("branch7x7_2", same(width, 1, 7)), ("branch7x7_3", same(192, 7, 1))];
        self.branch(name, x, &single, out, 192);
        let double = [
            ("branch7x7dbl_1", same(width, 1, 1)),
            ("branch7x7dbl_2", same(width, 7, 1)),
            ("branch7x7dbl_3", same(width, 1, 7)),
            ("branch7x7dbl_4", same(width, 7, 1)),
            ("branch7x7dbl_5", same(192, 1, 7)),
        ];
        self.branch(name, x, &double, out, 384);
        self.pooled(name, x, 192, out, 576);
        self.tap(name, out)
    }

    /// Halves the maps again.
    fn block_d(&mut self, name: &str, x: Map) -> Map {
        let out = self.0.joined(x, 2, 512 + self.0.channels(x));
        self.branch(name, x, &[("branch3x3_1", same(192, 1, 1)), ("branch3x3_2", valid(320, 3, 2))], out, 0);
        let seven = [
            ("branch7x7x3_1", same(192, 1, 1)),
            ("branch7x7x3_2", same(192, 1, 7)),
            ("branch7x7x3_3", same(192, 7, 1)),
            ("branch7x7x3_4", valid(192, 3, 2)),
        ];
        self.branch(name, x, &seven, out, 320);
        self.0.max_pool_into(x, out, 512);
        self.tap(name, out)
    }

    /// Figure 7: branches that end in 1 × 3 and 3 × 1 side by side.
    fn block_e(&mut self, name: &str, x: Map) -> Map {
        let out = self.0.joined(x, 1, 2048);
        self.branch(name, x, &[("branch1x1", same(320, 1, 1))], out, 0);
        let single = self.conv(&format!("{name}.branch3x3_1"), x, same(384, 1, 1));
        self.into(&format!("{name}.branch3x3_2a"), single, same(384, 1, 3), out, 320);
        self.into(&format!("{name}.branch3x3_2b"), single, same(384, 3, 1), out, 704);
        let double = self.conv(&format!("{name}.branch3x3dbl_1"), x, same(448, 1, 1));
        let double = self.conv(&format!("{name}.branch3x3dbl_2"), double, same(384, 3, 3));
        self.into(&format!("{name}.branch3x3dbl_3a"), double, same(384, 1, 3), out, 1088);
        self.into(&format!("{name}.branch3x3dbl_3b"), double, same(384, 3, 1), out, 1472);
        self.pooled(name, x, 192, out, 1856);
        self.tap(name, out)
    }
}

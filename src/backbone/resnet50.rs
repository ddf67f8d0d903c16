//! ResNet50 (He et al. 2016, "Deep residual learning"), with torchvision's tensor names.

use super::description::{Padding, StrideIn, Variant};
use super::graph::{Activation, Builder, Form, Graph, Map};
use crate::kernel::Pad;

/// Blocks of each stage (Table 1 of the paper, 50 layers).
const BLOCKS: [usize; 4] = [3, 4, 6, 3];

/// The architecture for inputs of `side` pixels; `None` if that is too small.
pub(super) fn graph(side: usize, variant: &Variant) -> Option<Graph> {
    let (before, after) = variant.convolution_padding.around(side, 7, 2);
    let mut net = Builder::new(side, Pad { top: before, left: before, bottom: after, right: after });
    let stem = Form { outputs: 64, kernel: (7, 7), stride: 2, padding: Padding::Valid, activation: Activation::Relu };
    let x = net.conv(("conv1", "bn1"), 0, stem);
    let mut x = net.max_pool(x, 3, 2, variant.stem_pool_padding);
    for (stage, blocks) in BLOCKS.into_iter().enumerate() {
        for block in 0..blocks {
            let name = format!("layer{}.{block}", stage + 1);
            x = bottleneck(&mut net, &name, x, 64 << stage, if stage > 0 && block == 0 { 2 } else { 1 }, variant);
            net.tap(&name, x);
        }
        net.tap(&format!("layer{}", stage + 1), x);
    }
    net.finish()
}

/// 1 × 1, 3 × 3, 1 × 1, added to the input; where shapes differ the input is projected first.
fn bottleneck(net: &mut Builder, name: &str, x: Map, width: usize, stride: usize, variant: &Variant) -> Map {
    let (first, second) = match variant.stride_in {
        StrideIn::First => (stride, 1),
        StrideIn::Second => (1, stride),
    };
    let form = |outputs, side, stride, activation| Form {
        outputs,
        kernel: (side, side),
        stride,
        padding: variant.convolution_padding,
        activation,
    };
    let layer = |i: usize| (format!("{name}.conv{i}"), format!("{name}.bn{i}"));
    let names = [layer(1), layer(2), layer(3)];
    let a = net.conv((&names[0].0, &names[0].1), x, form(width, 1, first, Activation::Relu));
    let b = net.conv((&names[1].0, &names[1].1), a, form(width, 3, second, Activation::Relu));
    let sum = if net.channels(x) == 4 * width {
        x
    } else {
        let names = (format!("{name}.downsample.0"), format!("{name}.downsample.1"));
        net.conv((&names.0, &names.1), x, form(4 * width, 1, stride, Activation::None))
    };
    net.conv_onto((&names[2].0, &names[2].1), b, form(4 * width, 1, 1, Activation::Relu), sum);
    sum
}

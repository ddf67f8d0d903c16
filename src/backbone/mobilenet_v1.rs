//! MobileNet-V1 1.0 (Howard et al. 2017), tensors named `conv0`, `block1` to `block13`.

use super::description::{Padding, Variant};
use super::graph::{Builder, Form, Graph};
use crate::kernel::Pad;

/// Outputs and stride of each block (Table 1 of the paper).
const BLOCKS: [(usize, usize); 13] = [
    (64, 1),
    (128, 2),
    (128, 1),
    (256, 2),
    (256, 1),
    (512, 2),
    (512, 1),
    (512, 1),
    (512, 1),
    (512, 1),
    (512, 1),
    (1024, 2),
    (1024, 1),
];

/// The architecture for inputs of `side` pixels; `None` if that is too small.
pub(super) fn graph(side: usize, variant: &Variant) -> Option<Graph> {
    let padding = variant.convolution_padding;
    let activation = variant.activation.into();
    let (before, after) = padding.around(side, 3, 2);
    let mut net = Builder::new(side, Pad { top: before, left: before, bottom: after, right: after });
    let stem = Form { outputs: 32, kernel: (3, 3), stride: 2, padding: Padding::Valid, activation };
    let mut x = net.conv(("conv0.conv", "conv0.bn"), 0, stem);
    for (i, (outputs, stride)) in BLOCKS.into_iter().enumerate() {
        let name = format!("block{}", i + 1);
        let depth = Form { outputs: net.channels(x), kernel: (3, 3), stride, padding, activation };
        x = net.depthwise((&format!("{name}.dw.conv"), &format!("{name}.dw.bn")), x, depth);
        let point = Form { outputs, kernel: (1, 1), stride: 1, padding: Padding::Valid, activation };
        x = net.conv((&format!("{name}.pw.conv"), &format!("{name}.pw.bn")), x, point);
        net.tap(&name, x);
    }
    net.finish()
}

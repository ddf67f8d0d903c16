//! Images with a border of zeros.

use crate::kernel::buffer::Buffer;
use crate::kernel::map::{Pad, Shape, View, Window};
use crate::kernel::team::each_part;

/// Fewer channels than this fill no tile and make runs of a few floats, unless a row of the window is one run.
const FEW: usize = 6;

/// What stands under windows: the maps and the window, or, if a pixel has few channels, a copy with its border in `copy`
/// and a window without one, whose rows are contiguous in memory.
pub(super) fn contiguous<'a>(x: View<'a>, window: Window, copy: &'a mut Buffer) -> (View<'a>, Window) {
    let Pad { left, right, .. } = window.pad;
    if window.width == 1 || left + right == 0 || x.shape.channels >= FEW || x.shape.is_empty() {
        return (x, window);
    }
    (bordered(x, window.pad, copy), Window { pad: Pad::default(), ..window })
}

fn bordered<'a>(x: View, pad: Pad, copy: &'a mut Buffer) -> View<'a> {
    let Shape { height, width, channels, .. } = x.shape;
    let (rows, columns) = (height + pad.top + pad.bottom, width + pad.left + pad.right);
    let shape = Shape { height: rows, width: columns, ..x.shape };
    copy.resize(shape.len());
    each_part(&mut copy[..], columns * channels, |i, row| {
        let (image, y) = (i / rows, (i % rows).wrapping_sub(pad.top));
        if y >= height {
            return row.fill(0.0);
        }
        let (before, rest) = row.split_at_mut(pad.left * channels);
        let (inside, after) = rest.split_at_mut(width * channels);
        before.fill(0.0);
        after.fill(0.0);
        for (column, pixel) in inside.chunks_exact_mut(channels).enumerate() {
            pixel.copy_from_slice(x.pixel((image * height + y) * width + column));
        }
    });
    View::new(copy, shape, channels)
}

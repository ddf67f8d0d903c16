//! Feature maps in memory (images × height × width × channels) and windows that slide over them.

/// Shape of a stack of feature maps.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Shape {
    /// Number of images.
    pub images: usize,
    /// Rows of a map.
    pub height: usize,
    /// Pixels of a row.
    pub width: usize,
    /// Values of a pixel.
    pub channels: usize,
}

impl Shape {
    /// Pixels of all images.
    pub fn pixels(&self) -> usize {
        self.images * self.height * self.width
    }

    /// Values of all images.
    pub fn len(&self) -> usize {
        self.pixels() * self.channels
    }

    /// Whether there is no value.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    fn check(&self, len: usize, stride: usize) {
        let needed = if self.is_empty() { 0 } else { (self.pixels() - 1) * stride + self.channels };
        assert!(stride >= self.channels && len >= needed, "{self:?} with pixel stride {stride} in {len} floats");
    }
}

/// Feature maps to read: pixel p, channel c is `data[p * stride + c]`.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    pub(super) data: &'a [f32],
    pub(super) shape: Shape,
    pub(super) stride: usize,
}

impl<'a> View<'a> {
    /// Maps of `shape` in `data`, pixels `stride` apart.
    ///
    /// # Panics
    /// If `data` is too short or the stride less than the channels.
    pub fn new(data: &'a [f32], shape: Shape, stride: usize) -> Self {
        shape.check(data.len(), stride);
        Self { data, shape, stride }
    }

    /// Their shape.
    pub fn shape(&self) -> Shape {
        self.shape
    }

    /// The channels of pixel `p`, counted over all images.
    pub fn pixel(&self, p: usize) -> &'a [f32] {
        &self.data[p * self.stride..][..self.shape.channels]
    }
}

/// Feature maps to write; some channels of wider ones if the stride is greater than the channels.
#[derive(Debug)]
pub struct ViewMut<'a> {
    pub(super) data: &'a mut [f32],
    pub(super) shape: Shape,
    pub(super) stride: usize,
}

impl<'a> ViewMut<'a> {
    /// Maps of `shape` in `data`, pixels `stride` apart.
    ///
    /// # Panics
    /// If `data` is too short or the stride less than the channels.
    pub fn new(data: &'a mut [f32], shape: Shape, stride: usize) -> Self {
        shape.check(data.len(), stride);
        Self { data, shape, stride }
    }
}

/// Rows and columns of zeros around an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Pad {
    /// Rows above.
    pub top: usize,
    /// Columns to the left.
    pub left: usize,
    /// Rows below.
    pub bottom: usize,
    /// Columns to the right.
    pub right: usize,
}

impl Pad {
    /// The same on opposite sides.
    pub fn symmetric(rows: usize, columns: usize) -> Self {
        Self { top: rows, left: columns, bottom: rows, right: columns }
    }
}

/// A window that slides over an image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Window {
    /// Rows of the window.
    pub height: usize,
    /// Columns of the window.
    pub width: usize,
    /// Step in both directions.
    pub stride: usize,
    /// What surrounds the image.
    pub pad: Pad,
}

impl Window {
    /// A square window without padding.
    pub fn square(side: usize, stride: usize) -> Self {
        Self { height: side, width: side, stride, pad: Pad::default() }
    }

    /// Height and width of the output for an image of `height` × `width`; `None` if the window does not fit.
    pub fn output(&self, height: usize, width: usize) -> Option<(usize, usize)> {
        let places =
            |size: usize, pads: usize, window: usize| Some((size + pads).checked_sub(window)? / self.stride + 1);
        Some((
            places(height, self.pad.top + self.pad.bottom, self.height)?,
            places(width, self.pad.left + self.pad.right, self.width)?,
        ))
    }

    /// Checks that `out` is what this window makes of `x`, up to channels.
    pub(super) fn check(&self, x: Shape, out: Shape) {
        let fits = self.output(x.height, x.width) == Some((out.height, out.width)) && x.images == out.images;
        assert!(fits, "{self:?} does not make {out:?} of {x:?}");
    }
}

/// Where the pixels under a window stand in memory.
pub(super) struct Reader<'a> {
    x: View<'a>,
    window: Window,
    out: (usize, usize),
    /// Read instead of a pixel outside.
    outside: &'a [f32],
    /// The window's rows are contiguous in memory and never leave the image sideways: each is one run.
    whole_rows: bool,
}

impl<'a> Reader<'a> {
    pub(super) fn new(x: View<'a>, window: Window, out: Shape, outside: &'a [f32]) -> Self {
        Self { x, window, out: (out.height, out.width), outside, whole_rows: false }
    }

    /// Takes a row of the window as one run where memory allows it.
    pub(super) fn joining_rows(mut self) -> Self {
        let pad = self.window.pad;
        self.whole_rows = self.window.width > 1 && pad.left + pad.right == 0 && self.x.stride == self.x.shape.channels;
        self
    }

    /// Number of runs of a window, and floats of each.
    pub(super) fn runs(&self) -> (usize, usize) {
        let (w, channels) = (self.window, self.x.shape.channels);
        if self.whole_rows { (w.height, w.width * channels) } else { (w.height * w.width, channels) }
    }

    /// Calls `put(run, floats)` for the window of output pixel `p`, and returns the number of runs inside the image.
    pub(super) fn read(&self, p: usize, mut put: impl FnMut(usize, &'a [f32])) -> usize {
        let (column, row) = (p % self.out.1, p / self.out.1);
        let (row, image) = (row % self.out.0, row / self.out.0);
        let Window { height, width, stride, pad } = self.window;
        let columns = if self.whole_rows { 1 } else { width };
        let len = self.runs().1;
        let mut inside = 0;
        for ky in 0..height {
            for kx in 0..columns {
                let run = match self.pixel(image, row * stride + ky, pad.top, column * stride + kx, pad.left) {
                    Some(pixel) => {
                        inside += 1;
                        &self.x.data[pixel * self.x.stride..][..len]
                    }
                    None => &self.outside[..len],
                };
                put(ky * columns + kx, run);
            }
        }
        inside
    }

    fn pixel(&self, image: usize, y: usize, top: usize, x: usize, left: usize) -> Option<usize> {
        let shape = self.x.shape;
        let y = y.checked_sub(top).filter(|y| *y < shape.height)?;
        let x = x.checked_sub(left).filter(|x| *x < shape.width)?;
        Some((image * shape.height + y) * shape.width + x)
    }
}

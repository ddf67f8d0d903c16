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

/// Maps of this many floats or more, several times a second-level cache, are written past the caches: what stands in their
/// lines is then not read first, and what is read soon is not driven out.
const STREAMED: usize = 2 << 20;

impl<'a> ViewMut<'a> {
    /// Whether to write it past the caches: it is large, and vectors of any instruction set fill it without remainder.
    pub(super) fn streamed(&self) -> bool {
        let aligned = self.data.as_ptr().addr().is_multiple_of(64);
        let whole = self.stride.is_multiple_of(16) && self.shape.channels.is_multiple_of(16);
        self.shape.len() >= STREAMED && aligned && whole
    }

    /// Its floats, from the first pixel to the last.
    pub(super) fn floats(&mut self) -> &mut [f32] {
        let before_last = self.shape.pixels().saturating_sub(1) * self.stride;
        &mut self.data[..before_last + self.shape.channels.min(self.shape.len())]
    }

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
    out: Shape,
    /// Read instead of a pixel outside.
    outside: &'a [f32],
    /// Window row and column, and distance from the window's first float, of each run of floats.
    runs: Vec<(usize, usize, usize)>,
    /// Floats of a run.
    len: usize,
    /// Floats from the first to the last of a window that is inside the image.
    span: usize,
}

/// The window of one output pixel; it moves in the order of pixels.
#[derive(Clone, Copy)]
struct Place {
    image: usize,
    row: usize,
    column: usize,
}

impl<'a> Reader<'a> {
    pub(super) fn new(x: View<'a>, window: Window, out: Shape, outside: &'a [f32]) -> Self {
        Self::with_runs(x, window, out, outside, window.width, x.shape.channels)
    }

    /// Takes a row of the window as one run where rows are contiguous in memory and never leave the image sideways.
    pub(super) fn joining_rows(x: View<'a>, window: Window, out: Shape, outside: &'a [f32]) -> Self {
        if window.pad.left + window.pad.right == 0 && x.stride == x.shape.channels {
            Self::with_runs(x, window, out, outside, 1, window.width * x.shape.channels)
        } else {
            Self::new(x, window, out, outside)
        }
    }

    fn with_runs(x: View<'a>, window: Window, out: Shape, outside: &'a [f32], columns: usize, len: usize) -> Self {
        let run = |t: usize| {
            let (ky, kx) = (t / columns, t % columns);
            (ky, kx, (ky * x.shape.width + kx) * x.stride)
        };
        let runs: Vec<_> = (0..window.height * columns).map(run).collect();
        let span = runs.last().map_or(0, |r| r.2) + len;
        Self { x, window, out, outside, runs, len, span }
    }

    /// Number of runs of a window, and floats of each.
    pub(super) fn runs(&self) -> (usize, usize) {
        (self.runs.len(), self.len)
    }

    /// The window of output pixel `p`, counted over all images.
    fn place(&self, p: usize) -> Place {
        let (row, column) = (p / self.out.width, p % self.out.width);
        Place { image: row / self.out.height, row: row % self.out.height, column }
    }

    /// Moves `pixels` on, not beyond the end of the row.
    fn advance(&self, place: &mut Place, pixels: usize) {
        place.column += pixels;
        if place.column == self.out.width {
            (place.column, place.row) = (0, place.row + 1);
            if place.row == self.out.height {
                (place.row, place.image) = (0, place.image + 1);
            }
        }
    }

    /// Calls `put(i, run, floats)` for every run of the windows of `count` output pixels from pixel `first` on, in order;
    /// `floats` points to as many floats as a run has.
    pub(super) fn point(&self, first: usize, count: usize, mut put: impl FnMut(usize, usize, *const f32)) {
        let step = self.window.stride * self.x.stride;
        let mut place = self.place(first);
        let mut done = 0;
        while done < count {
            let inside = self.inside(place).min(count - done);
            if inside > 0 {
                let floats = &self.x.data[self.corner(place)..][..(inside - 1) * step + self.span];
                for i in 0..inside {
                    let corner = floats[i * step..].as_ptr();
                    for (run, (_, _, offset)) in self.runs.iter().enumerate() {
                        put(done + i, run, corner.wrapping_add(*offset));
                    }
                }
            } else {
                self.read_edge(place, |run, floats| put(done, run, floats.as_ptr()));
            }
            self.advance(&mut place, inside.max(1));
            done += inside.max(1);
        }
    }

    /// How many windows are inside the image, from the one at `place` to the right.
    fn inside(&self, place: Place) -> usize {
        let Window { height, width, stride, pad } = self.window;
        let (y, x) = (place.row * stride, place.column * stride);
        let shape = self.x.shape;
        if y < pad.top || y + height > shape.height + pad.top || x < pad.left {
            return 0;
        }
        let columns = (shape.width + pad.left).checked_sub(width + x).map_or(0, |room| room / stride + 1);
        columns.min(self.out.width - place.column)
    }

    /// Where the window at `place` begins in memory, if that is inside the image.
    fn corner(&self, place: Place) -> usize {
        let Window { stride, pad, .. } = self.window;
        let row = place.image * self.x.shape.height + place.row * stride - pad.top;
        (row * self.x.shape.width + place.column * stride - pad.left) * self.x.stride
    }

    /// How many pixels of the window of output pixel `p` are inside the image.
    pub(super) fn covered(&self, p: usize) -> usize {
        let Window { height, width, stride, pad } = self.window;
        let place = self.place(p);
        let inside = |first: usize, before: usize, window: usize, size: usize| {
            (first + window).min(size + before).saturating_sub(first.max(before))
        };
        inside(place.row * stride, pad.top, height, self.x.shape.height)
            * inside(place.column * stride, pad.left, width, self.x.shape.width)
    }

    /// Calls `put(run, floats)` for every run of the window at `place`, which may reach over the edge of the image.
    fn read_edge(&self, place: Place, mut put: impl FnMut(usize, &'a [f32])) {
        let Window { stride, pad, .. } = self.window;
        let shape = self.x.shape;
        // first row and column of the window, in an image with its border
        let (y, x) = (place.row * stride, place.column * stride);
        for (i, (ky, kx, _)) in self.runs.iter().enumerate() {
            let row = (y + ky).checked_sub(pad.top).filter(|row| *row < shape.height);
            let column = (x + kx).checked_sub(pad.left).filter(|column| *column < shape.width);
            if let (Some(row), Some(column)) = (row, column) {
                let pixel = (place.image * shape.height + row) * shape.width + column;
                put(i, &self.x.data[pixel * self.x.stride..][..self.len]);
            } else {
                put(i, &self.outside[..self.len]);
            }
        }
    }
}

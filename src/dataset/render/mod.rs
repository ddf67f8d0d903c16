//! Views rendered from a panorama, all with the same point spread.
//!
//! A view of a coarse panorama would be blurred the more the longer its focal length is, and a network
//! would read f off the blur. So the spread of a point *in the view* is the same for every f and ξ and at
//! every place of every view. Its unit is the pixel of the resolution R ("R-pixel").
//!
//! 1. The view is sampled on a grid of 2R × 2R points. Around each the panorama is read with a Gaussian of
//!    variance 0.36. The camera stretches it along the radius and across it by two different scales; a
//!    level of the panorama ([`levels`]) whose own blur gives 0.36 along the larger, and a few weighted
//!    readings along the smaller supply the rest. The blur of the panorama's own pixels must not exceed
//!    0.36: at R = 0.095 × width, f = 500 px (at 299), ξ = 0 it reaches that at the corner. (It exceeds it,
//!    along the radius, in the outermost corners of views with f < 90 px and ξ < 1.)
//! 2. A low-pass cuts off at 0.38 cycles an R-pixel and lets nothing pass beyond 0.5, the Nyquist frequency
//!    of R: there a view with f = 500 px has nothing to show and one with f = 60 px would have.
//! 3. The R × R pixels are interpolated to the view's.
//!
//! How well that works depends on what a panorama's pixels blur of their own, which nobody knows: see
//! [`levels`]. Measured on noise of equal power in every octave, 1,024 px wide, R = 97, 384 views to train
//! and 384 to test: a ridge regression of f on the radial spectrum lowers the mean's error by 0.4 % (95 %
//! interval −4.8 to 5.5) where a pixel is a point of noise that ends at the Nyquist frequency, and by 1.4 %
//! (−1.3 to 4.6) where it is an area's mean of noise that goes on an octave further. The cut-off and the
//! blur of a pixel were chosen on this same noise. A soft panorama, an area's mean of noise that fades
//! before the Nyquist frequency, still leaks: 16 % (9 to 23). Without the band limit it is 41 %.

mod angle;
mod blur;
mod lens;
mod levels;
mod optics;
mod plain;
mod pose;
mod resample;
mod spots;

pub use levels::Levels;
pub use plain::plain;
pub use pose::Pose;

use optics::{Optics, Scratch, Source};
use resample::Resampling;
use spots::whole;

use super::View;
use crate::kernel::{isa, per_isa};

/// Red, green, blue and nothing, in sRGB code values; four, since that is what a register holds.
type Texel = [f32; 4];

/// Grid points per R-pixel, each way.
const OVERSAMPLING: usize = 2;

/// Variance of what is read around a grid point, in R-pixels².
const READ_VARIANCE: f64 = 0.36;

/// Grid points beyond the edge of the view that the resampling kernel reaches.
const MARGIN: usize = 4;

/// Size and resolution of a view.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Frame {
    /// Side in pixels.
    pub image_px: u32,
    /// Effective resolution R in pixels.
    pub resolution: u32,
}

/// The coarsest level of a panorama `width` pixels wide that `view` reads.
pub fn coarsest_level(view: &View, frame: Frame, width: usize) -> usize {
    Optics::new(view, frame, width).coarsest_level()
}

/// Renders views of one frame.
#[derive(Debug)]
pub struct Renderer {
    frame: Frame,
    /// Grid points each way.
    side: usize,
    resampling: Resampling,
}

impl Renderer {
    /// For views of `frame`.
    pub fn new(frame: Frame) -> Self {
        let side = OVERSAMPLING * frame.resolution as usize + 2 * MARGIN;
        Self { frame, side, resampling: Resampling::new(side, frame) }
    }

    /// The pixels of `view`: `image_px` × `image_px` × 3 bytes, row-major RGB, sRGB code values.
    pub fn render(&self, levels: &Levels, view: &View, pose: &Pose) -> Vec<u8> {
        let optics = Optics::new(view, self.frame, levels.width());
        let place = |i: usize| (i as f64 + 0.5 - self.side as f64 / 2.0) / OVERSAMPLING as f64;
        let places: Vec<f64> = (0..self.side).map(place).collect();
        let source = Source { levels, pose: *pose };
        let mut grid = vec![[0.0; 4]; self.side * self.side];
        let mut scratch = Scratch::default();
        for (line, y) in grid.chunks_exact_mut(self.side).zip(&places) {
            optics.read_line(&source, *y, &places, line, &mut scratch);
        }
        let texels = self.resampling.apply(&grid);
        let mut pixels = vec![0; texels.len() * 3];
        to_bytes(isa(), &texels, &mut pixels);
        pixels
    }
}

per_isa! {
    /// Red, green and blue of each texel as code values.
    fn to_bytes(texels: &[Texel], bytes: &mut [u8]) {
        for (pixel, texel) in bytes.as_chunks_mut::<3>().0.iter_mut().zip(texels) {
            let [red, green, blue, _] = texel.map(to_byte);
            *pixel = [red, green, blue];
        }
    }
}

/// The nearest code value, halves away from zero, within 0 to 255.
#[inline(always)]
pub(super) fn to_byte(value: f32) -> u8 {
    whole((value.clamp(0.0, 255.0) + 0.5).floor()) as u8
}

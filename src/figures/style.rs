//! Colours, sizes and marks that all figures share.
//!
//! Colours are those of Okabe and Ito, which people with any kind of colour blindness tell apart.
//! The four predictors also differ in lightness and in their mark, so that a grey print reads too.

use crate::evaluate::Arm;

/// Red, green, blue.
pub type Colour = [u8; 3];

/// Text and axes.
pub const INK: Colour = [0x1a, 0x1a, 0x1a];
/// Notes and secondary text; dark enough to read at 7.5 pt.
pub const MUTED: Colour = [0x59, 0x59, 0x59];
/// Grid lines.
pub const GRID: Colour = [0xe2, 0xe2, 0xe2];
/// Paper.
pub const PAPER: Colour = [0xff, 0xff, 0xff];
/// Best value so far: red, as in the paper.
pub const BEST: Colour = [0xd5, 0x5e, 0x00];
/// Orange of the baseline arm.
pub const ORANGE: Colour = [0xe6, 0x9f, 0x00];
/// Blue of the tuned arm and of what the search finds.
pub const BLUE: Colour = [0x00, 0x72, 0xb2];
/// Green of the spectrum control.
pub const GREEN: Colour = [0x00, 0x9e, 0x73];
/// The ensemble.
pub const PURPLE: Colour = [0xcc, 0x79, 0xa7];
/// Dark grey of predict-the-mean.
pub const SLATE: Colour = [0x4d, 0x4d, 0x4d];
/// Fill of boxes that hold text.
pub const BOX: Colour = [0xee, 0xf3, 0xf7];
/// Fill of boxes that are not trained.
pub const FROZEN: Colour = [0xec, 0xec, 0xec];

/// Width of every figure in points: 8.5 cm, a journal's column.
pub const WIDTH: f64 = 240.0;
/// Space left free at the borders, points.
pub const MARGIN: f64 = 6.0;
/// Smallest text, points; 7.1 when the figure is printed 8 cm wide.
pub const SMALL: f64 = 7.5;
/// Headings of panels.
pub const HEADING: f64 = 8.0;
/// Distance between lines of text as a multiple of their size.
pub const LEADING: f64 = 1.28;

/// Sign of a point in a plot.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Mark {
    /// Disc.
    Circle,
    /// Square on its side.
    Square,
    /// Square on its corner.
    Diamond,
    /// Triangle, point up.
    Triangle,
    /// Two crossed strokes.
    Cross,
}

/// Hatching of a bar.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hatch {
    /// A plain colour.
    None,
    /// Strokes rising to the right.
    Rising,
    /// Strokes falling to the right.
    Falling,
}

/// How a predictor looks in every figure.
#[derive(Debug, Clone, Copy)]
pub struct ArmStyle {
    /// Its name in legends.
    pub name: &'static str,
    /// Its colour.
    pub colour: Colour,
    /// Its mark.
    pub mark: Mark,
    /// Its hatching.
    pub hatch: Hatch,
}

/// The look of a predictor.
pub fn arm(arm: Arm) -> ArmStyle {
    match arm {
        Arm::Baseline => ArmStyle { name: "baseline", colour: ORANGE, mark: Mark::Circle, hatch: Hatch::None },
        Arm::Tuned => ArmStyle { name: "tuned", colour: BLUE, mark: Mark::Square, hatch: Hatch::None },
        Arm::Ensemble => ArmStyle { name: "ensemble of 3", colour: PURPLE, mark: Mark::Cross, hatch: Hatch::None },
        Arm::PredictMean => {
            ArmStyle { name: "predict the mean", colour: SLATE, mark: Mark::Triangle, hatch: Hatch::Falling }
        }
        Arm::SpectrumControl => {
            ArmStyle { name: "spectrum control", colour: GREEN, mark: Mark::Diamond, hatch: Hatch::Rising }
        }
    }
}

/// `colour` mixed with white; `share` in [0, 1] is how much of the colour stays.
pub fn tint(colour: Colour, share: f64) -> Colour {
    colour.map(|c| (255.0 - (255.0 - f64::from(c)) * share).round() as u8)
}

/// Anchors of [`ramp`], evenly spaced.
const RAMP: [Colour; 5] =
    [[0xf6, 0xf1, 0xc6], [0xa6, 0xd6, 0xb6], [0x4b, 0xa5, 0xb8], [0x20, 0x6b, 0xa6], [0x16, 0x2a, 0x5e]];

/// A colour between pale yellow (0) and dark blue (1). It darkens evenly, so that it reads in grey.
pub fn ramp(share: f64) -> Colour {
    let place = if share.is_nan() { 0.0 } else { share.clamp(0.0, 1.0) } * (RAMP.len() - 1) as f64;
    let below = (place as usize).min(RAMP.len() - 2);
    let rest = place - below as f64;
    let mix = |c: usize| f64::from(RAMP[below][c]) * (1.0 - rest) + f64::from(RAMP[below + 1][c]) * rest;
    [0, 1, 2].map(|c| mix(c).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lightness(colour: Colour) -> f64 {
        // Relative luminance of the sRGB specification, to CIE L*.
        let linear = colour.map(|c| {
            let v = f64::from(c) / 255.0;
            if v <= 0.04045 { v / 12.92 } else { libm::pow((v + 0.055) / 1.055, 2.4) }
        });
        let y = 0.2126 * linear[0] + 0.7152 * linear[1] + 0.0722 * linear[2];
        116.0 * libm::cbrt(y) - 16.0
    }

    #[test]
    fn predictors_differ_in_grey() {
        let all = [Arm::Baseline, Arm::Tuned, Arm::PredictMean, Arm::SpectrumControl].map(arm);
        for (i, a) in all.iter().enumerate() {
            for b in &all[..i] {
                assert!((lightness(a.colour) - lightness(b.colour)).abs() > 8.0, "{} {}", a.name, b.name);
                assert_ne!(a.mark, b.mark);
            }
        }
    }

    #[test]
    fn the_ramp_darkens_steadily() {
        let steps: Vec<f64> = (0..=20).map(|i| lightness(ramp(f64::from(i) / 20.0))).collect();
        assert!(steps.windows(2).all(|s| (2.0..7.0).contains(&(s[0] - s[1]))), "{steps:?}");
        assert_eq!(ramp(f64::NAN), ramp(0.0));
        assert_eq!(ramp(7.0), RAMP[4]);
    }

    #[test]
    fn tint_goes_from_white_to_the_colour() {
        assert_eq!(tint(BLUE, 0.0), PAPER);
        assert_eq!(tint(BLUE, 1.0), BLUE);
    }
}

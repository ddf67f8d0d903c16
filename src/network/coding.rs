//! What the two outputs stand for.

use serde::{Deserialize, Serialize};

use crate::config::spec::{LabelCoding, SamplingSpec};

/// Smallest 1 + ξ with which a decoupled output is decoded.
const SMALLEST_SCALE: f64 = 0.1;

/// Turns (f, ξ) into the two outputs of a network and back.
///
/// - `raw`: f over its range, ξ over its largest value; labels lie in [0, 1].
/// - `decoupled`: log f/(1+ξ) over its range, ξ over its largest value. f/(1+ξ) is the central scale
///   of the unified model, with which f and ξ trade off (CORRECTIONS, "The unified spherical camera
///   model").
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Coding {
    labels: LabelCoding,
    /// Value of the first quantity that is coded as 0.
    origin: f64,
    /// Range of the first quantity; 1 where the range is empty.
    span: f64,
    /// ξ that is coded as 1.
    xi_unit: f64,
    /// Smallest f that is ever decoded, px.
    f_floor: f64,
}

impl Coding {
    /// The coding of labels drawn from `focal` (px) and `distortion`.
    pub fn new(labels: LabelCoding, focal: &SamplingSpec, distortion: &SamplingSpec) -> Self {
        let (origin, end) = match labels {
            LabelCoding::Raw => (focal.low, focal.high),
            LabelCoding::Decoupled => {
                let scale = |f: f64, xi: f64| libm::log(f / (1.0 + xi));
                (scale(focal.low, distortion.high), scale(focal.high, distortion.low))
            }
        };
        let positive_or_one = |x: f64| if x > 0.0 { x } else { 1.0 };
        Self {
            labels,
            origin,
            span: positive_or_one(end - origin),
            xi_unit: positive_or_one(distortion.high),
            f_floor: focal.low.min(1.0),
        }
    }

    /// The two outputs that stand for f (px, above 0) and ξ (above −1).
    pub fn encode(&self, f_px: f64, xi: f64) -> [f32; 2] {
        let first = match self.labels {
            LabelCoding::Raw => f_px,
            LabelCoding::Decoupled => libm::log(f_px / (1.0 + xi)),
        };
        [((first - self.origin) / self.span) as f32, (xi / self.xi_unit) as f32]
    }

    /// f (px) and ξ that two outputs stand for.
    ///
    /// Outputs outside [0, 1] are extrapolated, not clipped; but f is at least the smaller of 1 px and
    /// the low end of its range, and a decoupled f is decoded with 1 + ξ of at least 0.1, so f > 0.
    pub fn decode(&self, outputs: [f32; 2]) -> (f64, f64) {
        let xi = f64::from(outputs[1]) * self.xi_unit;
        let first = self.origin + f64::from(outputs[0]) * self.span;
        let f_px = match self.labels {
            LabelCoding::Raw => first,
            LabelCoding::Decoupled => libm::exp(first) * (1.0 + xi).max(SMALLEST_SCALE),
        };
        (f_px.max(self.f_floor), xi)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn range(low: f64, high: f64) -> SamplingSpec {
        SamplingSpec { low, high, step: None }
    }

    fn paper(labels: LabelCoding) -> Coding {
        Coding::new(labels, &range(50.0, 500.0), &range(0.0, 1.2))
    }

    #[test]
    fn the_ends_of_the_ranges_are_coded_as_0_and_1() {
        let raw = paper(LabelCoding::Raw);
        assert_eq!([raw.encode(50.0, 0.0), raw.encode(500.0, 1.2)], [[0.0, 0.0], [1.0, 1.0]]);
        assert_eq!(raw.encode(275.0, 0.6), [0.5, 0.5]);
        let decoupled = paper(LabelCoding::Decoupled);
        assert_eq!(decoupled.encode(50.0, 1.2), [0.0, 1.0]);
        assert_eq!(decoupled.encode(500.0, 0.0), [1.0, 0.0]);
        // (ln(200/1.5) − ln(50/2.2)) / (ln 500 − ln(50/2.2)) = 0.57239…
        assert!((decoupled.encode(200.0, 0.5)[0] - 0.572_391_56).abs() < 1e-6);
    }

    #[test]
    fn an_empty_range_is_coded_without_division_by_zero() {
        let coding = Coding::new(LabelCoding::Raw, &range(300.0, 300.0), &range(0.0, 0.0));
        assert_eq!(coding.decode(coding.encode(300.0, 0.0)), (300.0, 0.0));
    }

    proptest! {
        #[test]
        fn decoding_undoes_encoding(f in 50.0..500.0f64, xi in 0.0..1.2f64, raw: bool) {
            let coding = paper(if raw { LabelCoding::Raw } else { LabelCoding::Decoupled });
            let (f_back, xi_back) = coding.decode(coding.encode(f, xi));
            prop_assert!((f_back / f - 1.0).abs() < 1e-6 && (xi_back - xi).abs() < 1e-6, "{f_back} {xi_back}");
        }

        #[test]
        fn a_decoded_focal_length_is_positive(a in -50.0..50.0f32, b in -50.0..50.0f32, raw: bool) {
            let coding = paper(if raw { LabelCoding::Raw } else { LabelCoding::Decoupled });
            prop_assert!(coding.decode([a, b]).0 > 0.0);
        }
    }
}

//! Several networks that estimate together.

use super::Prediction;

/// For each view, the mean of the members' estimates.
///
/// # Panics
/// If the members estimate different views.
pub fn mean_estimates(members: &[&[Prediction]]) -> Vec<Prediction> {
    let Some((first, others)) = members.split_first() else { return Vec::new() };
    assert!(others.iter().all(|other| other.len() == first.len()), "members of other views");
    let mean_of = |i: usize, estimate: fn(&Prediction) -> f64| {
        assert!(others.iter().all(|other| other[i].view == first[i].view), "members of other views");
        members.iter().map(|member| estimate(&member[i])).sum::<f64>() / members.len() as f64
    };
    let both = |i: usize| Prediction {
        f_pred: mean_of(i, |p| p.f_pred),
        xi_pred: mean_of(i, |p| p.xi_pred),
        ..first[i].clone()
    };
    (0..first.len()).map(both).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Subset;

    #[test]
    fn each_view_has_the_mean_of_its_estimates() {
        let member = |offset: f64| -> Vec<Prediction> {
            let prediction = |view: u32| Prediction {
                view,
                panorama: format!("p{view}"),
                subset: Subset::Test,
                f_true: 100.0,
                xi_true: 0.5,
                f_pred: 100.0 * f64::from(view) + offset,
                xi_pred: f64::from(view) - offset,
            };
            (0..4).map(prediction).collect()
        };
        let (a, b, c) = (member(0.0), member(3.0), member(6.0));
        let mean = mean_estimates(&[&a, &b, &c]);
        assert_eq!(mean, member(3.0));
        assert_eq!(mean_estimates(&[]), []);
    }
}

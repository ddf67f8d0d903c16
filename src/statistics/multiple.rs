//! Several tests at once.

/// p-values corrected for being several (Holm 1979), in the order of `p`: of m tests the smallest p is multiplied by m,
/// the next by m − 1 and so on; none is smaller than one before it, nor greater than 1.
pub fn holm(p: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p.len()).collect();
    order.sort_by(|a, b| p[*a].total_cmp(&p[*b]));
    let mut adjusted = vec![0.0; p.len()];
    let mut least = 0.0f64;
    for (rank, i) in order.into_iter().enumerate() {
        least = least.max(p[i] * (p.len() - rank) as f64).min(1.0);
        adjusted[i] = least;
    }
    adjusted
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_corrected_p_lies_between_p_and_bonferronis(p in prop::collection::vec(0.0..1.0f64, 0..20)) {
            let adjusted = holm(&p);
            for (p_i, a) in p.iter().zip(&adjusted) {
                prop_assert!(p_i <= a && *a <= (p_i * p.len() as f64).min(1.0) + 1e-15);
            }
        }
    }
}

//! Permutation tests whose unit is a cluster.
//!
//! Views of one panorama are not independent, so they are exchanged together (Good 2005, section 3.7). Where all
//! arrangements can be gone through the test is exact; elsewhere arrangements are drawn, and p is (b + 1)/(n + 1) of
//! n draws of which b are as extreme as the data (Davison and Hinkley 1997, section 4.2), which is never 0.

use rayon::prelude::*;

use crate::rng;

/// How permutation tests are made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Permutation {
    /// Seed of drawn arrangements.
    pub seed: u64,
    /// Arrangements at most: up to so many all are gone through, elsewhere so many are drawn; at least 1.
    pub arrangements: u32,
}

/// What a test came to, two-sided.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Significance {
    /// Share of the arrangements in which the statistic is at least as far from 0 as in the data.
    pub p: f64,
    /// The smallest p that the test could have given, with so few clusters.
    pub attainable: f64,
    /// Whether all arrangements were gone through.
    pub exact: bool,
}

/// Rounding may move a statistic by less than this share of itself without its being another value.
const ROUNDING: f64 = 1e-12;

impl Permutation {
    /// Tests of paired samples: in each of the `clusters` clusters the two samples may be exchanged.
    ///
    /// `statistics` is given, for each cluster, whether its samples are exchanged, and returns its values, always equally
    /// many; each has to change its sign when all clusters are exchanged.
    pub fn paired(&self, clusters: usize, statistics: impl Fn(&[bool]) -> Vec<f64> + Sync) -> Vec<Significance> {
        let observed = statistics(&vec![false; clusters]);
        let all = u32::try_from(clusters).ok().and_then(|n| 2u64.checked_pow(n));
        let bits = |i: u64| (0..clusters).map(|k| i >> k & 1 == 1).collect();
        match all.filter(|n| *n <= u64::from(self.arrangements)) {
            Some(n) => {
                let attainable = if clusters == 0 { 1.0 } else { 2.0 / n as f64 };
                all_of(&observed, (0..n).map(bits).collect(), attainable, statistics)
            }
            None => self.drawn(&observed, "exchanges", statistics, |stream| {
                (0..clusters).map(|_| stream.word() >> 31 == 1).collect()
            }),
        }
    }

    /// Tests of two independent samples of `sizes` clusters: each cluster may belong to either.
    ///
    /// `statistics` is given, for each cluster, whether it belongs to the first sample.
    pub fn independent(&self, sizes: [usize; 2], statistics: impl Fn(&[bool]) -> Vec<f64> + Sync) -> Vec<Significance> {
        let clusters = sizes[0] + sizes[1];
        let labels: Vec<bool> = (0..clusters).map(|i| i < sizes[0]).collect();
        let observed = statistics(&labels);
        match choices(clusters, sizes[0], self.arrangements.into()) {
            // with equal sizes the two samples can be exchanged as a whole
            Some(all) => {
                let least = if sizes[0] == sizes[1] && clusters > 0 { 2.0 } else { 1.0 };
                let attainable = least / all.len() as f64;
                all_of(&observed, all, attainable, statistics)
            }
            None => self.drawn(&observed, "labels", statistics, |stream| {
                let mut drawn = labels.clone();
                stream.shuffle(&mut drawn);
                drawn
            }),
        }
    }

    fn drawn(
        &self,
        observed: &[f64],
        purpose: &str,
        statistics: impl Fn(&[bool]) -> Vec<f64> + Sync,
        draw: impl Fn(&mut rng::Stream) -> Vec<bool>,
    ) -> Vec<Significance> {
        let stream = |i: u32| rng::stream(self.seed, "statistics", &[i.into()], purpose);
        let arrangements: Vec<Vec<bool>> = (0..self.arrangements).map(|i| draw(&mut stream(i))).collect();
        let total = f64::from(self.arrangements) + 1.0;
        let as_p = |extreme: u64| (extreme as f64 + 1.0) / total;
        let counts = extremes(observed, &arrangements, statistics);
        counts.into_iter().map(|b| Significance { p: as_p(b), attainable: 1.0 / total, exact: false }).collect()
    }
}

fn all_of(
    observed: &[f64],
    arrangements: Vec<Vec<bool>>,
    attainable: f64,
    statistics: impl Fn(&[bool]) -> Vec<f64> + Sync,
) -> Vec<Significance> {
    let total = arrangements.len() as f64;
    let counts = extremes(observed, &arrangements, statistics);
    counts.into_iter().map(|b| Significance { p: b as f64 / total, attainable, exact: true }).collect()
}

/// For each statistic, how many arrangements have a value at least as far from 0 as the observed one.
fn extremes(observed: &[f64], arrangements: &[Vec<bool>], statistics: impl Fn(&[bool]) -> Vec<f64> + Sync) -> Vec<u64> {
    let values: Vec<Vec<f64>> = arrangements.par_iter().map(|arrangement| statistics(arrangement)).collect();
    let extreme = |k: usize, value: f64| value.abs() >= observed[k].abs() * (1.0 - ROUNDING);
    (0..observed.len()).map(|k| values.iter().filter(|v| extreme(k, v[k])).count() as u64).collect()
}

/// Every choice of `chosen` among `n`, in lexicographic order; `None` if there are more than `limit`.
fn choices(n: usize, chosen: usize, limit: u64) -> Option<Vec<Vec<bool>>> {
    let mut count = 1u64;
    for i in 0..chosen.min(n - chosen) as u64 {
        // exact: any i + 1 factors in a row are divisible by (i + 1)!
        count = count.checked_mul(n as u64 - i)? / (i + 1);
        if count > limit {
            return None;
        }
    }
    let mut all = Vec::new();
    let mut places: Vec<usize> = (0..chosen).collect();
    loop {
        all.push((0..n).map(|i| places.contains(&i)).collect());
        let Some(k) = (0..chosen).rev().find(|k| places[*k] < n - chosen + k) else { return Some(all) };
        places[k] += 1;
        for later in k + 1..chosen {
            places[later] = places[later - 1] + 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: Permutation = Permutation { seed: 3, arrangements: 10_000 };

    /// Mean of values whose signs are those of the exchanges.
    fn mean_of<'a>(values: &'a [f64]) -> impl Fn(&[bool]) -> Vec<f64> + Sync + 'a {
        move |swapped| vec![values.iter().zip(swapped).map(|(v, s)| if *s { -v } else { *v }).sum::<f64>()]
    }

    #[test]
    fn few_clusters_cannot_show_anything() {
        for (n, least) in [(0, 1.0), (1, 1.0), (3, 0.25), (5, 0.0625), (6, 0.03125)] {
            let test = ALL.paired(n, mean_of(&vec![1.0; n]))[0];
            assert_eq!((test.p, test.attainable, test.exact), (least, least, true), "{n}");
        }
        let test = ALL.independent([2, 3], |first| vec![if first[0] && first[1] { 1.0 } else { 0.0 }])[0];
        assert_eq!((test.p, test.attainable), (0.1, 0.1));
        assert_eq!(ALL.independent([2, 2], |_| vec![0.0])[0].attainable, 2.0 / 6.0);
    }

    #[test]
    fn drawn_arrangements_come_near_the_exact_value_and_never_to_zero() {
        let values: Vec<f64> = (0..12).map(|i| [0.9, -0.4, 1.7][i % 3] + 0.01 * i as f64).collect();
        let exact = ALL.paired(12, mean_of(&values))[0];
        let drawn = Permutation { seed: 5, arrangements: 4000 }.paired(12, mean_of(&values))[0];
        assert!(exact.exact && !drawn.exact);
        assert!((exact.p - drawn.p).abs() < 4.0 * (exact.p / 4000.0).sqrt(), "{} {}", exact.p, drawn.p);
        let certain = Permutation { seed: 5, arrangements: 99 }.paired(60, mean_of(&[1.0; 60]))[0];
        assert_eq!((certain.p, certain.attainable), (0.01, 0.01));
    }

    #[test]
    fn p_is_uniform_where_nothing_differs() {
        let p = |seed: u64| {
            let mut stream = rng::stream(seed, "test", &[], "null");
            let values: Vec<f64> = (0..9).map(|_| stream.normal()).collect();
            ALL.paired(9, mean_of(&values))[0].p
        };
        let rejected = (0..400).filter(|seed| p(*seed) <= 0.05).count();
        // binomial with n = 400 and p at most 0.05: 20 ± 4 standard deviations
        assert!((4..=38).contains(&rejected), "{rejected}");
    }

    #[test]
    fn choices_are_all_there_and_counted_before_they_are_made() {
        let all = choices(6, 2, 15).unwrap();
        assert_eq!(all.len(), 15);
        let mut sorted = all.clone();
        sorted.sort();
        sorted.dedup();
        assert!(sorted.len() == 15 && all.iter().all(|c| c.iter().filter(|x| **x).count() == 2));
        assert!(choices(6, 2, 14).is_none() && choices(500, 250, u64::MAX).is_none());
        assert_eq!(choices(3, 0, 5).unwrap(), [vec![false; 3]]);
    }
}

//! Subsets by group, so that no panorama is seen in training and in test.

use std::collections::BTreeMap;

use super::{Error, Subset, View, key_of};
use crate::config::spec::SplitSpec;
use crate::panorama::Panorama;
use crate::rng;

const SUBSETS: [Subset; 3] = [Subset::Train, Subset::Validation, Subset::Test];

/// Divides panoramas into subsets; returns the subset of each.
///
/// Panoramas with one `group` stay together. Groups are counted by largest remainder, each subset
/// has at least one, and each kind of scene is spread over the subsets in the same shares. The order
/// of `panoramas` does not matter.
///
/// # Errors
/// Fewer than three groups.
pub fn split(panoramas: &[Panorama], spec: &SplitSpec, seed: u64) -> Result<Vec<Subset>, Error> {
    let mut kinds: BTreeMap<&str, (&str, &str)> = BTreeMap::new();
    for p in panoramas {
        // A group of several kinds counts as that of its first panorama by id.
        let first = (p.id.as_str(), p.kind.as_deref().unwrap_or(""));
        kinds.entry(&p.group).and_modify(|known| *known = first.min(*known)).or_insert(first);
    }
    let counts = counts(kinds.len(), [spec.train, spec.validation, spec.test])?;
    let order = by_kind_shuffled(&kinds, seed);
    let subsets: BTreeMap<&str, Subset> = order.into_iter().zip(spread(counts)).collect();
    Ok(panoramas.iter().map(|p| subsets[p.group.as_str()]).collect())
}

/// Groups of one kind after those of another, in random order within a kind.
fn by_kind_shuffled<'a>(kinds: &BTreeMap<&'a str, (&'a str, &'a str)>, seed: u64) -> Vec<&'a str> {
    let mut strata: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    for (group, (_, kind)) in kinds {
        strata.entry(kind).or_default().push(group);
    }
    for (kind, groups) in &mut strata {
        rng::stream(seed, "split", &[key_of(kind)], "shuffle").shuffle(groups);
    }
    strata.into_values().flatten().collect()
}

/// Number of groups of each subset: largest remainder, then at least one each.
fn counts(groups: usize, shares: [f64; 3]) -> Result<[usize; 3], Error> {
    if groups < SUBSETS.len() {
        return Err(Error::TooFewPanoramas { groups });
    }
    let total: f64 = shares.iter().sum();
    // What lies within rounding of a whole number is that number: 0.8 · 10 has no remainder.
    let quotas = shares.map(|s| (s / total * groups as f64 * 1e9).round() / 1e9);
    let mut counts = quotas.map(|q| q as usize);
    let mut by_remainder = [0, 1, 2];
    by_remainder.sort_by(|&a, &b| (quotas[b] - quotas[b].floor()).total_cmp(&(quotas[a] - quotas[a].floor())));
    let missing = groups - counts.iter().sum::<usize>();
    by_remainder.iter().cycle().take(missing).for_each(|&i| counts[i] += 1);
    while let Some(empty) = counts.iter().position(|&n| n == 0) {
        let largest = (0..3).fold(0, |best, i| if counts[i] > counts[best] { i } else { best });
        counts[largest] -= 1;
        counts[empty] += 1;
    }
    Ok(counts)
}

/// A sequence with `counts` of each subset in which every stretch has nearly the shares of the whole:
/// the next is always the subset that is furthest behind.
fn spread(counts: [usize; 3]) -> Vec<Subset> {
    let total = counts.iter().sum::<usize>() as i64;
    let mut given = [0_i64; 3];
    let mut sequence = Vec::with_capacity(total as usize);
    for step in 1..=total {
        let behind = |i: usize| counts[i] as i64 * step - given[i] * total;
        let open = (0..3).filter(|&i| given[i] < counts[i] as i64);
        // On a tie the smaller subset comes first, or a short stretch would never reach it.
        let Some(next) = open.max_by_key(|&i| (behind(i), std::cmp::Reverse(counts[i]))) else { break };
        given[next] += 1;
        sequence.push(SUBSETS[next]);
    }
    sequence
}

/// Holds a division and its views to the rule that a panorama, and a group, is in one subset only.
///
/// # Errors
/// [`Error::Leak`] names the first panorama that is not, or that a view names but nobody knows.
///
/// # Panics
/// If `split` and `panoramas` differ in length: a mistake of the caller.
pub fn check_no_leak(panoramas: &[Panorama], split: &[Subset], views: &[View]) -> Result<(), Error> {
    assert_eq!(split.len(), panoramas.len(), "one subset a panorama");
    let leak = |panorama: &str, how: String| Err(Error::Leak { panorama: panorama.to_owned(), how });
    let (mut of_group, mut of_id) = (BTreeMap::new(), BTreeMap::new());
    for (panorama, &subset) in panoramas.iter().zip(split) {
        let group = *of_group.entry(&panorama.group).or_insert(subset);
        let id = of_id.entry(&panorama.id).or_insert((&panorama.name, subset)).1;
        if group != subset || id != subset {
            let other = if group != subset { group } else { id };
            return leak(&panorama.name, format!("its group `{}` is in {other:?} and in {subset:?}", panorama.group));
        }
    }
    for view in views {
        match of_id.get(&view.panorama) {
            None => return leak(&view.panorama, format!("view {} is of a panorama without a subset", view.index)),
            Some((name, subset)) if *subset != view.subset => {
                return leak(name, format!("it is in {subset:?}, but its view {} in {:?}", view.index, view.subset));
            }
            Some(_) => {}
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::testing::{panorama, split_spec};
    use proptest::prelude::*;

    fn numbered(n: usize, group: impl Fn(usize) -> usize, kind: impl Fn(usize) -> &'static str) -> Vec<Panorama> {
        (0..n).map(|i| panorama(&format!("{i:03}"), &format!("g{}", group(i)), Some(kind(i)))).collect()
    }

    fn count(subsets: &[Subset]) -> [usize; 3] {
        SUBSETS.map(|s| subsets.iter().filter(|&&x| x == s).count())
    }

    #[test]
    fn shares_are_kept_in_all_and_in_every_kind() {
        let kind = |i| ["room", "street", "land"][i % 3];
        let panoramas = numbered(90, |i| i, kind);
        let subsets = split(&panoramas, &split_spec(), 1).unwrap();
        assert_eq!(count(&subsets), [72, 9, 9]);
        for k in 0..3 {
            let of_kind: Vec<Subset> = subsets.iter().copied().skip(k).step_by(3).collect();
            assert_eq!(count(&of_kind), [24, 3, 3]);
        }
    }

    /// Ten groups at 80/10/10 are 8, 1, 1; five are 4, ½, ½: the rest goes to validation, test takes from training.
    #[test]
    fn small_numbers_leave_no_subset_empty() {
        assert_eq!(counts(10, [0.8, 0.1, 0.1]).unwrap(), [8, 1, 1]);
        assert_eq!(counts(5, [0.8, 0.1, 0.1]).unwrap(), [3, 1, 1]);
        assert_eq!(counts(3, [0.8, 0.1, 0.1]).unwrap(), [1, 1, 1]);
        assert_eq!(counts(46, [0.8, 0.1, 0.1]).unwrap(), [37, 5, 4]);
        let error = counts(2, [0.8, 0.1, 0.1]).unwrap_err().to_string();
        assert!(error.contains("at least 3"), "{error}");
    }

    #[test]
    fn seed_matters_and_order_does_not() {
        let panoramas = numbered(40, |i| i, |_| "room");
        let first = split(&panoramas, &split_spec(), 1).unwrap();
        assert_ne!(first, split(&panoramas, &split_spec(), 2).unwrap());
        let backwards: Vec<Panorama> = panoramas.iter().rev().cloned().collect();
        let again: Vec<Subset> = split(&backwards, &split_spec(), 1).unwrap().into_iter().rev().collect();
        assert_eq!(first, again);
    }

    proptest! {
        #[test]
        fn no_split_leaks(n in 6..60_usize, size in 1..4_usize, seed in any::<u64>()) {
            let panoramas = numbered(n, |i| i / size.min(n / 3), |i| if i % 4 == 0 { "land" } else { "room" });
            prop_assume!(n.div_ceil(size) >= 3);
            let subsets = split(&panoramas, &split_spec(), seed).unwrap();
            check_no_leak(&panoramas, &subsets, &[]).unwrap();
            prop_assert!(count(&subsets).iter().all(|&c| c > 0));
        }
    }

    #[test]
    fn a_leak_names_its_panorama() {
        let panoramas = numbered(3, |i| i, |_| "room");
        let mut views: Vec<View> = SUBSETS
            .iter()
            .zip(&panoramas)
            .map(|(&subset, p)| View { subset, ..crate::dataset::testing::view(0, &p.id, 100.0, 0.0) })
            .collect();
        check_no_leak(&panoramas, &SUBSETS, &views).unwrap();
        views[1].subset = Subset::Test;
        let error = check_no_leak(&panoramas, &SUBSETS, &views).unwrap_err().to_string();
        assert!(error.contains("001.jpg") && error.contains("Validation") && error.contains("Test"), "{error}");
        views[1].panorama = "stranger".to_owned();
        assert!(check_no_leak(&panoramas, &SUBSETS, &views).unwrap_err().to_string().contains("stranger"));
        let twins = numbered(3, |i| i / 2, |_| "room");
        let error = check_no_leak(&twins, &SUBSETS, &[]).unwrap_err().to_string();
        assert!(error.contains("001.jpg") && error.contains("g0"), "{error}");
    }
}

//! Groups of runs with different seeds: variation between seeds apart from variation between views, and groups against
//! each other.

use serde::{Deserialize, Serialize};

use super::Error;
use super::metrics::{CONFIDENCE, QUANTITIES, image_px, permutation, predictions};
use super::run::Run;
use super::verdict::{Judged, Pair, judge};
use crate::dataset::Subset;
use crate::evaluate::{Arm, SeedContrast, SeedSpread, seed_contrasts, seed_spread, why_unpaired};

/// Runs with different seeds.
pub(super) struct Group {
    /// Its name.
    pub name: String,
    /// Its runs, by rising seed.
    pub runs: Vec<(u64, Run)>,
}

/// Errors of a group over its seeds.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupSpread {
    /// The group.
    pub group: String,
    /// Its seeds, in the order of the values.
    pub seeds: Vec<u64>,
    /// Why there are no rows.
    pub problem: Option<String>,
    /// A row a quantity and statistic.
    pub rows: Vec<SeedSpread>,
}

/// Two groups against each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct GroupContrasts {
    /// The one group.
    pub first: String,
    /// The other.
    pub second: String,
    /// Seeds of each.
    pub seeds: [u32; 2],
    /// Why runs are not paired by seed; `None` if they are.
    pub unpaired: Option<String>,
    /// A row a quantity and statistic.
    pub rows: Vec<Judged<SeedContrast>>,
}

/// The errors of each group over its seeds.
///
/// # Errors
/// Predictions that contradict themselves.
pub(super) fn spreads(groups: &[Group], arm: Arm) -> Result<Vec<GroupSpread>, Error> {
    groups.iter().map(|group| spread(group, arm)).collect()
}

fn spread(group: &Group, arm: Arm) -> Result<GroupSpread, Error> {
    let empty = GroupSpread {
        group: group.name.clone(),
        seeds: group.runs.iter().map(|(seed, _)| *seed).collect(),
        problem: None,
        rows: Vec::new(),
    };
    let all = group.runs.iter().map(|(_, run)| predictions(run, arm)).collect::<Result<Vec<_>, _>>();
    let sides = group.runs.iter().map(|(_, run)| image_px(run)).collect::<Result<Vec<_>, _>>();
    let (all, sides) = match (all, sides) {
        (Ok(all), Ok(sides)) => (all, sides),
        (Err(problem), _) | (_, Err(problem)) => return Ok(GroupSpread { problem: Some(problem), ..empty }),
    };
    if sides.windows(2).any(|pair| pair[0] != pair[1]) {
        let problem = format!("the views of group {} are not all of one size in pixels", group.name);
        return Ok(GroupSpread { problem: Some(problem), ..empty });
    }
    let rows = seed_spread(Subset::Test, arm, &all, &QUANTITIES, sides[0])?;
    Ok(GroupSpread { rows, ..empty })
}

/// Every further group against the first; all rows together are one family of tests.
///
/// # Errors
/// Predictions that contradict themselves.
pub(super) fn contrasts(groups: &[Group], spreads: &[GroupSpread], arm: Arm) -> Result<Vec<GroupContrasts>, Error> {
    let mut all = Vec::new();
    let compared = groups.iter().zip(spreads).filter(|(_, spread)| !spread.rows.is_empty()).collect::<Vec<_>>();
    if let Some(((first, of_first), others)) = compared.split_first() {
        for (second, of_second) in others {
            all.push(pair([first, second], [&of_first.rows, &of_second.rows], arm)?);
        }
    }
    let mut judged: Vec<Pair<SeedContrast>> = all
        .iter_mut()
        .map(|pair| Pair {
            rows: &mut pair.rows,
            second: &pair.second,
            units: pair.seeds,
            paired: pair.unpaired.is_none(),
        })
        .collect();
    judge(&mut judged);
    Ok(all)
}

fn pair(groups: [&Group; 2], rows: [&[SeedSpread]; 2], arm: Arm) -> Result<GroupContrasts, Error> {
    let unpaired = unpaired_seeds(groups, arm)?;
    let found = seed_contrasts(rows, unpaired.is_none(), CONFIDENCE, &permutation());
    Ok(GroupContrasts {
        first: groups[0].name.clone(),
        second: groups[1].name.clone(),
        seeds: groups.map(|group| group.runs.len() as u32),
        unpaired,
        rows: found.into_iter().map(Judged::pending).collect(),
    })
}

/// Why the runs of two groups are not paired by seed.
fn unpaired_seeds([a, b]: [&Group; 2], arm: Arm) -> Result<Option<String>, Error> {
    let seeds = |group: &Group| group.runs.iter().map(|(seed, _)| *seed).collect::<Vec<_>>();
    if seeds(a) != seeds(b) {
        return Ok(Some("the groups have other seeds".to_owned()));
    }
    for ((seed, first), (_, second)) in a.runs.iter().zip(&b.runs) {
        if let (Ok(first), Ok(second)) = (predictions(first, arm), predictions(second, arm))
            && let Some(why) = why_unpaired(Subset::Test, arm, [first, second])?
        {
            return Ok(Some(format!("with seed {seed} the groups have other test views ({why})")));
        }
    }
    Ok(None)
}

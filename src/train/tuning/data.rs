//! What a backbone is trained and validated on.

use std::collections::BTreeMap;

use crate::backbone::Intake;
use crate::config::spec::AugmentSpec;
use crate::dataset::{Subset, View};
use crate::features::{FeatureRow, FeatureSet};
use crate::rng::stream;
use crate::store::{Hash, hash_json};
use crate::train::Error;

const SCOPE: &str = "tuning";

/// Gives the image of a copy of a view: RGB, input² × 3 bytes.
pub type Images<'a> = &'a (dyn Fn(FeatureRow) -> Vec<u8> + Sync);

/// Where the inputs of the trained blocks come from.
enum Inputs<'a> {
    /// Made anew each time from the image.
    Images(Images<'a>),
    /// What frozen blocks gave for each copy of each view, by row.
    Stored { maps: &'a FeatureSet, row_of: BTreeMap<FeatureRow, usize> },
}

/// Training and validation views with their labels; test views never enter.
pub struct TuningData<'a> {
    inputs: Inputs<'a>,
    /// Plain training rows.
    plain: Vec<FeatureRow>,
    /// Changed copies of them that are stored.
    changed: Vec<FeatureRow>,
    validation: Vec<FeatureRow>,
    labels: BTreeMap<u32, (f64, f64)>,
    validation_labels: Vec<(f64, f64)>,
    /// Odd copies are mirrored.
    mirror: bool,
    fingerprint: Hash,
}

impl<'a> TuningData<'a> {
    /// Views whose images `images` makes; changed copies are made anew in each epoch. `origin` names views and changes.
    ///
    /// # Errors
    /// An empty training or validation subset.
    pub fn of_images(views: &[View], augment: &AugmentSpec, images: Images<'a>, origin: &Hash) -> Result<Self, Error> {
        let plain = |subset| {
            let of = views.iter().filter(move |v| v.subset == subset);
            of.map(|v| FeatureRow { view: v.index, copy: 0 }).collect::<Vec<_>>()
        };
        let rows = [plain(Subset::Train), plain(Subset::Validation)];
        Self::new(views, rows, Vec::new(), Inputs::Images(images), augment.mirror, origin)
    }

    /// Views for whose copies `maps` holds what the trained blocks begin with. `origin` names `maps`.
    ///
    /// # Errors
    /// An empty training or validation subset.
    pub fn of_maps(views: &[View], maps: &'a FeatureSet, origin: &Hash) -> Result<Self, Error> {
        let subset_of: BTreeMap<u32, Subset> = views.iter().map(|v| (v.index, v.subset)).collect();
        let of = |subset: Subset, changed: bool| {
            let wanted = |r: &&FeatureRow| subset_of.get(&r.view) == Some(&subset) && (r.copy != 0) == changed;
            maps.rows().iter().filter(wanted).copied().collect::<Vec<_>>()
        };
        let row_of = maps.rows().iter().enumerate().map(|(i, row)| (*row, i)).collect();
        let rows = [of(Subset::Train, false), of(Subset::Validation, false)];
        Self::new(views, rows, of(Subset::Train, true), Inputs::Stored { maps, row_of }, false, origin)
    }

    fn new(
        views: &[View],
        [plain, validation]: [Vec<FeatureRow>; 2],
        changed: Vec<FeatureRow>,
        inputs: Inputs<'a>,
        mirror: bool,
        origin: &Hash,
    ) -> Result<Self, Error> {
        for (rows, subset) in [(&plain, Subset::Train), (&validation, Subset::Validation)] {
            if rows.is_empty() {
                return Err(Error::Empty { subset });
            }
        }
        let labels: BTreeMap<u32, (f64, f64)> = views.iter().map(|v| (v.index, (v.f_px, v.xi))).collect();
        let validation_labels = validation.iter().map(|row| labels[&row.view]).collect();
        let fingerprint = hash_json(&(origin, &plain, &changed, &validation, mirror)).map_err(Error::serialise)?;
        Ok(Self { inputs, plain, changed, validation, labels, validation_labels, mirror, fingerprint })
    }

    /// Hash of what makes a training on other data another one.
    pub(super) fn fingerprint(&self) -> &Hash {
        &self.fingerprint
    }

    /// Number of plain training views.
    pub fn train_views(&self) -> usize {
        self.plain.len()
    }

    pub(super) fn plain(&self) -> &[FeatureRow] {
        &self.plain
    }

    pub(super) fn validation(&self) -> &[FeatureRow] {
        &self.validation
    }

    pub(super) fn validation_labels(&self) -> &[(f64, f64)] {
        &self.validation_labels
    }

    pub(super) fn label(&self, row: FeatureRow) -> (f64, f64) {
        self.labels[&row.view]
    }

    /// Rows of epoch `epoch`, shuffled: every training view once, changed with probability `strength` in a way of its
    /// own; or, of stored copies, all plain ones and each changed one with that probability.
    pub(super) fn epoch_rows(&self, strength: f64, seed: u64, epoch: u32) -> Vec<u32> {
        let index = [u64::from(epoch)];
        let mut rows: Vec<u32> = (0..self.plain.len() as u32).collect();
        let mut copies = stream(seed, SCOPE, &index, "copies");
        let stored = self.plain.len() as u32..(self.plain.len() + self.changed.len()) as u32;
        rows.extend(stored.filter(|_| copies.chance(strength)));
        stream(seed, SCOPE, &index, "shuffle").shuffle(&mut rows);
        rows
    }

    /// Which copy of which view row number `row` of epoch `epoch` is.
    pub(super) fn row(&self, row: u32, strength: f64, seed: u64, epoch: u32) -> FeatureRow {
        let row = row as usize;
        let Some(plain) = self.plain.get(row).copied() else { return self.changed[row - self.plain.len()] };
        if matches!(self.inputs, Inputs::Stored { .. }) {
            return plain;
        }
        let mut draws = stream(seed, SCOPE, &[epoch.into(), plain.view.into()], "copy");
        if !draws.chance(strength) {
            return plain;
        }
        // odd copies are mirrored, even ones are not
        let mirrored = u32::from(self.mirror && draws.chance(0.5));
        FeatureRow { copy: 2 * (epoch + 1) - mirrored, ..plain }
    }

    /// Writes the input of `row`: early features, and the map that the trained blocks begin with.
    pub(super) fn fill(&self, intake: &Intake, row: FeatureRow, early: &mut [f32], map: &mut [f32]) {
        match &self.inputs {
            Inputs::Images(image) => intake.prepare(&image(row), early, map),
            Inputs::Stored { maps, row_of } => {
                let (first, rest) = maps.row(row_of[&row]).split_at(early.len());
                early.copy_from_slice(first);
                map.copy_from_slice(rest);
            }
        }
    }
}

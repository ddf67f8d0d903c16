//! Reading features back.

use super::{DESCRIPTION, Description, Error, FORMAT, FeatureRow, MATRIX};
use crate::store::{self, Artefact, Mapped};

/// A matrix of features, mapped from its file: one row for each copy of each view.
#[derive(Debug)]
pub struct FeatureSet {
    matrix: Mapped,
    dim: usize,
    rows: Vec<FeatureRow>,
}

impl FeatureSet {
    /// Opens what [`write`](super::write) wrote.
    ///
    /// # Errors
    /// The disk, or a matrix of another size than its description says.
    pub fn open(artefact: &Artefact) -> Result<Self, Error> {
        let path = artefact.path(DESCRIPTION);
        let damaged = |path, reason: String| Error::Damaged { path, reason };
        let description: Description =
            serde_json::from_slice(&store::read(&path)?).map_err(|e| damaged(path.clone(), e.to_string()))?;
        if description.format != FORMAT {
            let reason = format!("format {} is not {FORMAT}, the one this program reads", description.format);
            return Err(damaged(path, reason));
        }
        let path = artefact.path(MATRIX);
        let matrix = Mapped::open(&path)?;
        let (bytes, expected) = (matrix.len(), description.rows.len() * description.dim * size_of::<f32>());
        if bytes != expected {
            return Err(damaged(path, format!("it has {bytes} bytes and not {expected}")));
        }
        Ok(Self { matrix, dim: description.dim, rows: description.rows })
    }

    /// Gives back the memory of the rows that were looked at.
    pub fn release(&self) {
        self.matrix.release();
    }

    /// Numbers of a row.
    pub fn dim(&self) -> usize {
        self.dim
    }

    /// What each row belongs to.
    pub fn rows(&self) -> &[FeatureRow] {
        &self.rows
    }

    /// The features of row `i`.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn row(&self, i: usize) -> &[f32] {
        &self.all()[i * self.dim..][..self.dim]
    }

    /// All rows, one after the other.
    pub fn all(&self) -> &[f32] {
        const { assert!(cfg!(target_endian = "little"), "the file's numbers are read in place") };
        // SAFETY: every four bytes are a float; the map begins on a page, so nothing is cut off at the front
        unsafe { self.matrix.align_to::<f32>().1 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::backbone::{Backbone, WeightsSource};
    use crate::config::spec::{Architecture, BackboneSpec, Tune};
    use crate::features::write;
    use crate::pipeline::progress::{Progress, Silent};
    use crate::store::{Cache, hash_bytes};

    fn backbone() -> Backbone {
        let spec = BackboneSpec {
            architecture: Architecture::MobilenetV1,
            input_px: 32,
            weights: "seeded".to_owned(),
            tune: Tune::Frozen,
            taps: vec!["block2".to_owned(), "block1".to_owned()],
            rings: 1,
            components: 0,
        };
        Backbone::load(&spec, WeightsSource::Seeded { seed: 1 }).unwrap()
    }

    fn image(row: FeatureRow) -> Vec<u8> {
        (0..32 * 32 * 3).map(|i| (i * (row.view + 3) + row.copy * 7) as u8).collect()
    }

    #[test]
    fn what_is_written_is_read_and_is_what_the_backbone_gives() {
        let folder = tempfile::tempdir().unwrap();
        let backbone = backbone();
        let rows: Vec<FeatureRow> = (0..131).map(|i| FeatureRow { view: i / 2, copy: i % 2 }).collect();
        let make = |w: &store::ArtefactWriter| write(w, &backbone, &rows, &image, &Silent);
        let artefact = Cache::new(folder.path()).open_or_make("features", &hash_bytes(b"a"), make).unwrap();
        let set = FeatureSet::open(&artefact).unwrap();
        assert_eq!((set.dim(), set.rows()), (2 * (128 + 64), &rows[..]));
        for i in [0, 1, 130] {
            assert_eq!(set.row(i), backbone.features(&image(rows[i]), 1), "row {i}");
        }
        assert_eq!(set.all().len(), 131 * set.dim());
    }

    #[test]
    fn no_rows_are_a_set_too() {
        let folder = tempfile::tempdir().unwrap();
        let backbone = backbone();
        let make = |w: &store::ArtefactWriter| write(w, &backbone, &[], &image, &Silent);
        let artefact = Cache::new(folder.path()).open_or_make("features", &hash_bytes(b"a"), make).unwrap();
        let set = FeatureSet::open(&artefact).unwrap();
        assert!(set.rows().is_empty() && set.all().is_empty());
    }

    struct Stop;
    impl Progress for Stop {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn note(&self, _: &str) {}
        fn end(&self) {}
        fn interrupted(&self) -> bool {
            true
        }
    }

    #[test]
    fn an_interruption_leaves_nothing_behind() {
        let folder = tempfile::tempdir().unwrap();
        let cache = Cache::new(folder.path());
        let key = hash_bytes(b"a");
        let backbone = backbone();
        let rows = [FeatureRow { view: 0, copy: 0 }];
        let made = cache.open_or_make("features", &key, |w| write(w, &backbone, &rows, &image, &Stop));
        assert!(matches!(made, Err(Error::Interrupted)) && !cache.contains("features", &key));
    }
}

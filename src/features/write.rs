//! Computing features and writing them down.

use std::io::Write;

use rayon::prelude::*;

use super::{DESCRIPTION, Description, Error, FORMAT, FeatureRow, MATRIX, TapDescription};
use crate::backbone::{Backbone, GROUP};
use crate::pipeline::progress::Progress;
use crate::store::{self, ArtefactWriter, AtomicFile};

/// Rows whose features are in memory at a time.
const BATCH: usize = 128;

/// Computes the features of all `rows` and writes `features.bin` and `features.json`.
///
/// `image` gives a row's image, RGB, input² × 3 bytes. It is called from the threads that run the backbone, so that preparing images
/// and computing features fill all of them; no more images are in memory than the threads work on.
///
/// # Errors
/// An interruption, or the disk.
///
/// # Panics
/// If an image has another size.
pub fn write(
    writer: &ArtefactWriter,
    backbone: &Backbone,
    rows: &[FeatureRow],
    image: &(dyn Fn(FeatureRow) -> Vec<u8> + Sync),
    progress: &dyn Progress,
) -> Result<(), Error> {
    let path = writer.path(MATRIX);
    let mut file = AtomicFile::create(&path)?;
    progress.begin("features", rows.len() as u64);
    for batch in rows.chunks(BATCH) {
        let groups: Vec<Vec<f32>> = batch
            .par_chunks(GROUP)
            .map(|group| {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                let images: Vec<u8> = group.iter().flat_map(|row| image(*row)).collect();
                let features = backbone.features(&images, group.len());
                progress.advance(group.len() as u64);
                Ok(features)
            })
            .collect::<Result<_, _>>()?;
        let bytes: Vec<u8> = groups.iter().flatten().flat_map(|v| v.to_le_bytes()).collect();
        file.write_all(&bytes).map_err(|source| store::Error::Io { action: "write", path: path.clone(), source })?;
    }
    file.commit()?;
    store::write_json(&writer.path(DESCRIPTION), &description(backbone, rows))?;
    progress.end();
    Ok(())
}

/// Writes `values` (one row of `dim` numbers for each of `rows`) as a matrix of features called `name`.
///
/// # Errors
/// The disk.
pub fn write_matrix(
    writer: &ArtefactWriter,
    name: &str,
    dim: usize,
    rows: &[FeatureRow],
    values: &[f32],
) -> Result<(), Error> {
    let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    store::write(&writer.path(MATRIX), &bytes)?;
    let taps = vec![TapDescription { name: name.to_owned(), channels: dim }];
    let description = Description { format: FORMAT, dim, taps, rings: 0, rows: rows.to_vec() };
    Ok(store::write_json(&writer.path(DESCRIPTION), &description)?)
}

fn description(backbone: &Backbone, rows: &[FeatureRow]) -> Description {
    let taps = backbone.taps().map(|(name, channels)| TapDescription { name: name.to_owned(), channels }).collect();
    Description { format: FORMAT, dim: backbone.dim(), taps, rings: backbone.rings(), rows: rows.to_vec() }
}

//! Computing features and writing them down.

use std::io::Write;

use rayon::prelude::*;

use super::{DESCRIPTION, Description, Error, FORMAT, FeatureRow, MATRIX, TapDescription};
use crate::backbone::{Backbone, GROUP, Intake};
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
    let compute = |group: &[FeatureRow]| {
        let images: Vec<u8> = group.iter().flat_map(|row| image(*row)).collect();
        backbone.features(&images, group.len())
    };
    write_rows(writer, rows, "features", &compute, progress)?;
    Ok(store::write_json(&writer.path(DESCRIPTION), &description(backbone, rows))?)
}

/// Computes what frozen blocks hand on to the trained ones, for all `rows`, and writes it as a matrix: of each row the features that
/// come from the frozen blocks, then their last map.
///
/// `image` gives a row's image as in [`write()`]. On disk is one number for each value of the map.
///
/// # Errors
/// An interruption, or the disk.
pub fn write_maps(
    writer: &ArtefactWriter,
    intake: &Intake,
    rows: &[FeatureRow],
    image: &(dyn Fn(FeatureRow) -> Vec<u8> + Sync),
    progress: &dyn Progress,
) -> Result<(), Error> {
    let dim = intake.early_len() + intake.map_len();
    let compute = |group: &[FeatureRow]| {
        let mut values = vec![0.0; group.len() * dim];
        for (row, values) in group.iter().zip(values.chunks_exact_mut(dim)) {
            let (early, map) = values.split_at_mut(intake.early_len());
            intake.prepare(&image(*row), early, map);
        }
        values
    };
    write_rows(writer, rows, "maps", &compute, progress)?;
    describe_matrix(writer, "maps", dim, rows)
}

/// Writes the numbers that `compute` gives for each of `rows`, a group at a time.
fn write_rows(
    writer: &ArtefactWriter,
    rows: &[FeatureRow],
    what: &str,
    compute: &(dyn Fn(&[FeatureRow]) -> Vec<f32> + Sync),
    progress: &dyn Progress,
) -> Result<(), Error> {
    let path = writer.path(MATRIX);
    let mut file = AtomicFile::create(&path)?;
    progress.begin(what, rows.len() as u64);
    for batch in rows.chunks(BATCH) {
        let groups: Vec<Vec<f32>> = batch
            .par_chunks(GROUP)
            .map(|group| {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                let values = compute(group);
                progress.advance(group.len() as u64);
                Ok(values)
            })
            .collect::<Result<_, _>>()?;
        for values in groups {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            file.write_all(&bytes).map_err(|source| store::Error::Io {
                action: "write",
                path: path.clone(),
                source,
            })?;
        }
    }
    file.commit()?;
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
    describe_matrix(writer, name, dim, rows)
}

fn describe_matrix(writer: &ArtefactWriter, name: &str, dim: usize, rows: &[FeatureRow]) -> Result<(), Error> {
    let taps = vec![TapDescription { name: name.to_owned(), channels: dim }];
    let description = Description { format: FORMAT, dim, taps, rings: 0, rows: rows.to_vec() };
    Ok(store::write_json(&writer.path(DESCRIPTION), &description)?)
}

fn description(backbone: &Backbone, rows: &[FeatureRow]) -> Description {
    let taps = backbone.taps().map(|(name, channels)| TapDescription { name: name.to_owned(), channels }).collect();
    Description { format: FORMAT, dim: backbone.dim(), taps, rings: backbone.rings(), rows: rows.to_vec() }
}

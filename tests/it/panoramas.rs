//! Folders of image files: good ones run, bad ones are named.

use std::io::Cursor;
use std::path::Path;

use crate::support::{fail_with, panotune, succeed};

fn picture(width: u32, height: u32, seed: u32) -> image::RgbImage {
    image::RgbImage::from_fn(width, height, |x, y| {
        let cell = (x / 8 * 31 + y / 8 * 17 + seed * 101).wrapping_mul(2_654_435_761) >> 24;
        image::Rgb([cell as u8, (cell as u8).wrapping_mul(3), (y % 256) as u8])
    })
}

fn bytes(image: &image::RgbImage, format: image::ImageFormat) -> Vec<u8> {
    let mut out = Cursor::new(Vec::new());
    image.write_to(&mut out, format).unwrap();
    out.into_inner()
}

fn good_folder(folder: &Path, n: u32) {
    for i in 0..n {
        let image = picture(256, 128, i);
        let format = if i % 2 == 0 { image::ImageFormat::Png } else { image::ImageFormat::Jpeg };
        let ending = if i % 2 == 0 { "png" } else { "jpg" };
        std::fs::write(folder.join(format!("p{i}.{ending}")), bytes(&image, format)).unwrap();
    }
}

fn spoil(folder: &Path) {
    let jpeg = bytes(&picture(256, 128, 90), image::ImageFormat::Jpeg);
    std::fs::write(folder.join("cut.jpg"), &jpeg[..jpeg.len() / 2]).unwrap();
    std::fs::write(folder.join("dot.png"), bytes(&picture(1, 1, 0), image::ImageFormat::Png)).unwrap();
    std::fs::write(folder.join("wide.png"), bytes(&picture(384, 128, 0), image::ImageFormat::Png)).unwrap();
    std::fs::write(folder.join("text.jpg"), "this is a letter").unwrap();
}

fn run(results: &Path, folder: &Path, more: &[&str]) -> std::process::Command {
    let mut command = panotune(results);
    command.args(["run", "experiments/optuna_inception.yaml", "--profile", "tiny"]);
    command.args(["--set", "dataset.panoramas.source=directory"]);
    command.args(["--set", &format!("dataset.panoramas.path={}", folder.display())]).args(more);
    command
}

#[test]
fn every_bad_file_is_named_with_its_reason() {
    let (results, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    good_folder(folder.path(), 6);
    spoil(folder.path());
    let said = fail_with(2, &mut run(results.path(), folder.path(), &[]));
    for part in [
        "cut.jpg",
        "truncated",
        "dot.png",
        "1 × 1",
        "wide.png",
        "384 × 128",
        "text.jpg",
        "text file",
        "on_bad_file: skip",
    ] {
        assert!(said.contains(part), "{part} is missing in:\n{said}");
    }
}

#[test]
fn bad_files_can_be_skipped_and_are_named_in_the_warnings() {
    let (results, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    good_folder(folder.path(), 9);
    spoil(folder.path());
    std::fs::copy(folder.path().join("p0.png"), folder.path().join("again.png")).unwrap();
    let more = ["--set", "dataset.panoramas.on_bad_file=skip"];
    let out = succeed(&mut run(results.path(), folder.path(), &more));
    let warnings = std::fs::read_to_string(Path::new(out.lines().last().unwrap()).join("warnings.json")).unwrap();
    for part in ["cut.jpg", "dot.png", "wide.png", "text.jpg", "same bytes"] {
        assert!(warnings.contains(part), "{part} is missing in {warnings}");
    }
}

#[test]
fn an_empty_or_missing_folder_is_named() {
    let (results, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    assert!(fail_with(2, &mut run(results.path(), folder.path(), &[])).contains("no panorama"));
    let missing = folder.path().join("nowhere");
    assert!(fail_with(2, &mut run(results.path(), &missing, &[])).contains("nowhere"));
}

#[test]
fn too_narrow_panoramas_are_named_with_the_largest_resolution() {
    let (results, folder) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    good_folder(folder.path(), 6);
    let said = fail_with(2, &mut run(results.path(), folder.path(), &["--set", "dataset.resolution=60"]));
    assert!(said.contains("p0.png") && said.contains("24"), "{said}");
}

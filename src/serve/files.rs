//! Files of finished runs.

use std::path::Path;

use super::response::{PAGE_TYPE, Response, Status};
use crate::store::{open_inside, safe_segments};

/// The file `path` in the folder of a finished run; hidden files and links are not there.
pub fn file(run: &Path, path: &str) -> Response {
    let absent = || Response::text(Status::NotFound, "the run has no such file");
    let Some(segments) = safe_segments(path) else { return absent() };
    match open_inside(run, &segments) {
        Ok(Some((file, bytes))) => match content_type(path) {
            PAGE_TYPE => Response::report(file, bytes),
            other => Response::file(other, file, bytes),
        },
        Ok(None) => absent(),
        Err(_) => Response::text(Status::Failed, "the file cannot be read"),
    }
}

/// What browsers are told that a file is, by its ending. Text that they would save is shown as plain text.
fn content_type(path: &str) -> &'static str {
    match path.rsplit(['.', '/']).next().unwrap_or_default() {
        "html" => PAGE_TYPE,
        "svg" => "image/svg+xml",
        "png" => "image/png",
        "csv" => "text/csv; charset=utf-8",
        "json" => "application/json",
        "parquet" => "application/vnd.apache.parquet",
        "db" => "application/vnd.sqlite3",
        "md" | "tex" | "yaml" | "jsonl" | "chain" | "SHA256SUMS" => "text/plain; charset=utf-8",
        _ => "application/octet-stream",
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn types_follow_the_ending() {
        for (path, expected) in [
            ("report.html", "text/html; charset=utf-8"),
            ("figures/figure_3.svg", "image/svg+xml"),
            ("SHA256SUMS", "text/plain; charset=utf-8"),
            ("models/tuned-0.safetensors", "application/octet-stream"),
            ("png/noending", "application/octet-stream"),
        ] {
            assert_eq!(content_type(path), expected, "{path}");
        }
    }
}

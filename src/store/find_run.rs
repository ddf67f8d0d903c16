//! From what the user calls a run to its folder.

use std::path::{Path, PathBuf};

use super::{Error, run_names};

/// The folder of the run `name`: a path, or the beginning of the name of one run under `results`, with or without its
/// experiment (`optuna_inception/s20250101`).
///
/// # Errors
/// No such run, or several, which are listed.
pub fn find_run(name: &str, results: &Path) -> Result<PathBuf, Error> {
    let path = PathBuf::from(name);
    if ["resolved.yaml", "runs.json"].iter().any(|file| path.join(file).is_file()) {
        return Ok(path);
    }
    let runs: Vec<(String, PathBuf)> =
        run_names(results)?.into_iter().map(|run| (run.to_string(), run.folder(results))).collect();
    let wanted = name.trim_end_matches('/');
    let rest = |full: &str| -> Option<String> {
        let id = full.rsplit('/').next().unwrap_or(full);
        full.strip_prefix(wanted).or_else(|| id.strip_prefix(wanted)).map(str::to_owned)
    };
    let found: Vec<(&(String, PathBuf), String)> = runs.iter().filter_map(|run| Some((run, rest(&run.0)?))).collect();
    // `s1` is the seed 1 rather than the beginning of 12
    let whole: Vec<_> = found.iter().filter(|(_, rest)| rest.is_empty() || rest.starts_with(['-', '/'])).collect();
    let names = |runs: &mut dyn Iterator<Item = &(String, PathBuf)>| runs.map(|(name, _)| name.clone()).collect();
    match (found.as_slice(), whole.as_slice()) {
        ([one], _) => Ok(one.0.1.clone()),
        (_, [one]) => Ok(one.0.1.clone()),
        // a folder, of which its reader says what is missing
        ([], _) if path.is_dir() => Ok(path),
        ([], _) => Err(Error::NotFound {
            name: name.to_owned(),
            results: results.to_owned(),
            candidates: names(&mut runs.iter()),
        }),
        _ => Err(Error::Ambiguous { name: name.to_owned(), candidates: names(&mut found.iter().map(|(run, _)| *run)) }),
    }
}

/// A run's name below `results`.
pub fn run_shown(run: &Path, results: &Path) -> String {
    run.strip_prefix(results).unwrap_or(run).to_string_lossy().replace('\\', "/")
}

/// Lines of a hint that lists `names`; at most ten.
pub(crate) fn listed(names: &[String], hint: &str) -> String {
    if names.is_empty() {
        return String::new();
    }
    let mut text = format!("\nhint: {hint}:");
    names.iter().take(10).for_each(|name| text += &format!("\n  {name}"));
    if names.len() > 10 {
        text += &format!("\n  and {} more", names.len() - 10);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::store::create_dir;

    fn results() -> tempfile::TempDir {
        let results = tempfile::tempdir().unwrap();
        for run in ["a/s1-00000000-1", "a/s12-00000000-1", "a/s12-00000000-2", "b/s1-11111111-1", "b/s3-22222222-1"] {
            create_dir(&results.path().join(run)).unwrap();
        }
        results
    }

    #[test]
    fn a_beginning_that_is_one_runs_is_enough() {
        let results = results();
        let found = |name: &str| run_shown(&find_run(name, results.path()).unwrap(), results.path());
        assert_eq!(found("s3"), "b/s3-22222222-1");
        assert_eq!(found("a/s1"), "a/s1-00000000-1", "the seed 1, not the beginning of 12");
        assert_eq!(found("b/s1-1"), "b/s1-11111111-1");
        assert_eq!(found("a/s12-00000000-2"), "a/s12-00000000-2");
        let path = results.path().join("a/s1-00000000-1");
        assert_eq!(find_run(path.to_str().unwrap(), results.path()).unwrap(), path);
    }

    #[test]
    fn what_is_no_run_or_several_is_refused_with_candidates() {
        let results = results();
        let said = |name: &str| find_run(name, results.path()).unwrap_err().to_string();
        let several = said("a/s12");
        assert!(several.contains("several") && several.ends_with("a/s12-00000000-1\n  a/s12-00000000-2"), "{several}");
        assert!(said("s1").contains("b/s1-11111111-1") && said("s1").contains("a/s1-00000000-1"));
        assert!(said("c").contains("no run `c`") && said("c").contains("b/s3-22222222-1"));
    }
}

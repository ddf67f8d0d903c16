//! Which path is what.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use serde_json::json;
use sha2::{Digest, Sha256};

use super::files;
use super::response::{Response, Status};
use crate::live::{self, State};
use crate::store::{self, RunName, files_below};

/// A page's script behind what all pages need.
macro_rules! script {
    ($own:literal) => {
        concat!(
            "\"use strict\";\n",
            include_str!("../assets/shared/element.js"),
            include_str!("../assets/serve/common.js"),
            include_str!($own)
        )
    };
}

const PAGE: &str = include_str!("../assets/serve/page.html");
const STYLE: &str = concat!(include_str!("../assets/shared/base.css"), include_str!("../assets/serve/page.css"));
const LIST_SCRIPT: &str = script!("../assets/serve/list.js");
const RUN_SCRIPT: &str = script!("../assets/serve/run.js");

/// A list is made anew after this time, or after ten times what it took, if that is more.
const LIST_LIFE: Duration = Duration::from_secs(1);

/// A page of our own with its policy.
struct Page {
    html: String,
    policy: String,
}

impl Page {
    /// The page with its style and script in it, and a policy that allows these two alone, by their hashes.
    fn new(title: &str, script: &str) -> Self {
        let html = PAGE.replace("{{title}}", title).replace("{{style}}", STYLE).replace("{{script}}", script);
        let hash = |text: &str| format!("'sha256-{}'", STANDARD.encode(Sha256::digest(text.as_bytes())));
        let policy = format!(
            "default-src 'none'; style-src {}; script-src {}; connect-src 'self'; img-src data:; base-uri 'none'; form-action 'none'; \
             frame-ancestors 'none'",
            hash(STYLE),
            hash(script)
        );
        Self { html, policy }
    }

    fn response(&self) -> Response {
        Response::page(&self.html, &self.policy)
    }
}

/// A list of runs, and until when it is good.
type Known = (Instant, Arc<Vec<u8>>);

/// Everything that can be asked for.
pub struct Site {
    results: PathBuf,
    list: Page,
    run: Page,
    known: Mutex<Option<Known>>,
}

impl Site {
    /// The runs below `results`.
    pub fn new(results: &Path) -> Self {
        let (list, run) = (Page::new("runs", LIST_SCRIPT), Page::new("run", RUN_SCRIPT));
        Self { results: results.to_owned(), list, run, known: Mutex::new(None) }
    }

    /// What stands at the decoded `path`.
    pub fn answer(&self, path: &str) -> Response {
        let path = path.trim_start_matches('/');
        let after = |section: &str| path.strip_prefix(section)?.strip_prefix('/');
        if path.is_empty() {
            self.list.response()
        } else if path == "favicon.ico" {
            Response::icon()
        } else if path == "api/runs" {
            self.runs()
        } else if let Some(name) = after("api/runs") {
            self.with_run(name, Self::state)
        } else if let Some(name) = after("runs") {
            self.with_run(name.trim_end_matches('/'), |_, _| self.run.response())
        } else if let Some(file) = after("files") {
            self.file(file)
        } else {
            nothing()
        }
    }

    fn with_run(&self, name: &str, answer: impl FnOnce(&RunName, &Path) -> Response) -> Response {
        match RunName::parse(name) {
            Some(run) if self.is_there(&run) => answer(&run, &run.folder(&self.results)),
            _ => nothing(),
        }
    }

    /// Whether the run has a folder; links are not followed.
    fn is_there(&self, run: &RunName) -> bool {
        let folder = run.folder(&self.results);
        let is_folder = |path: &Path| path.symlink_metadata().is_ok_and(|m| m.is_dir());
        folder.parent().is_some_and(is_folder) && is_folder(&folder)
    }

    fn runs(&self) -> Response {
        let mut known = self.known.lock().unwrap_or_else(PoisonError::into_inner);
        let began = Instant::now();
        if let Some((_, list)) = known.as_ref().filter(|(until, _)| began < *until) {
            return Response::json(list.to_vec());
        }
        match live::list(&self.results, None).map(|runs| to_json(&runs)) {
            Ok(list) => {
                let until = Instant::now() + LIST_LIFE.max(began.elapsed() * 10);
                *known = Some((until, Arc::new(list.clone())));
                Response::json(list)
            }
            Err(error) => Response::text(Status::Failed, &error.to_string()),
        }
    }

    fn state(run: &RunName, folder: &Path) -> Response {
        match live::read(folder) {
            Ok(live) => {
                let finished = live.summary.state == State::Finished;
                let shown = if finished { shown_files(folder) } else { Ok(Vec::new()) };
                Response::json(to_json(&json!({ "live": live, "files": shown.unwrap_or_default() })))
            }
            Err(_) => Response::text(Status::NotFound, &format!("{run} cannot be read")),
        }
    }

    /// A file of a finished run. `path` begins with the run's name.
    fn file(&self, path: &str) -> Response {
        let mut parts = path.splitn(3, '/');
        let (Some(name), Some(id), Some(file)) = (parts.next(), parts.next(), parts.next()) else { return nothing() };
        self.with_run(&format!("{name}/{id}"), |_, folder| match folder.join(store::SUMS).is_file() {
            true => files::file(folder, file),
            false => Response::text(Status::NotFound, "files are shown of finished runs"),
        })
    }
}

fn nothing() -> Response {
    Response::text(Status::NotFound, "there is nothing here")
}

/// The files of a finished run that people look at.
fn shown_files(folder: &Path) -> Result<Vec<String>, store::Error> {
    const WORTH: [&str; 5] = ["report.html", "tables", "figures", "metrics.json", "resolved.yaml"];
    let worth = |path: &str| WORTH.contains(&path.split('/').next().unwrap_or(path));
    files_below(folder, &worth)
}

/// Values of ours are always JSON: their keys are text.
fn to_json<T: serde::Serialize>(value: &T) -> Vec<u8> {
    serde_json::to_vec(value).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pages_need_nothing_beside_themselves() {
        for page in [Page::new("runs", LIST_SCRIPT), Page::new("run", RUN_SCRIPT)] {
            for word in ["src=", "href=\"http", "@import", "url(", "innerHTML", "eval(", "{{"] {
                assert!(!page.html.contains(word), "{word}");
            }
            assert!(page.policy.contains("default-src 'none'") && !page.policy.contains("unsafe"));
        }
    }

    #[test]
    fn the_policy_names_the_hash_of_what_stands_in_the_page() {
        // printf 'a' | openssl dgst -sha256 -binary | base64
        let page = Page::new("x", "a");
        assert!(
            page.policy.contains("script-src 'sha256-ypeBEsobvcr6wjGzmiPcTaeG7/gUfE5yuYB3ha/uSLs='"),
            "{}",
            page.policy
        );
        assert!(page.html.contains("<script>a</script>"));
    }
}

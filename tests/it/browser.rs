//! Scripts that drive a real browser.

use std::path::{Path, PathBuf};
use std::process::Command;

use crate::support::{root, skipped};

const BROWSERS: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// Where a browser is and playwright-core, as `.ci/browser` installs them, or a message that the test is skipped.
pub struct Browser {
    path: PathBuf,
    modules: PathBuf,
}

impl Browser {
    pub fn find() -> Option<Self> {
        let modules = root().join("target/browser/node_modules");
        let folders = std::env::var_os("PATH").unwrap_or_default();
        let places = || std::env::split_paths(&folders).flat_map(|folder| BROWSERS.map(|name| folder.join(name)));
        let path = places().find(|path| path.is_file());
        match path {
            Some(path) if modules.join("playwright-core").is_dir() => Some(Self { path, modules }),
            _ => {
                skipped("browser", "there is no browser with playwright-core; `.ci/browser` installs them");
                None
            }
        }
    }

    /// Runs `tests/it/browser/<script>`; gives what it printed, and fails with everything that it said if it fails.
    pub fn check(&self, script: &str, args: &[&Path]) -> String {
        let mut node = Command::new("node");
        node.arg(root().join("tests/it/browser").join(script)).args(args);
        node.env("NODE_PATH", &self.modules).env("BROWSER_PATH", &self.path);
        let output = node.output().expect("node starts");
        let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
        let text = said(&output.stdout);
        assert!(output.status.success(), "{script}\n{text}\n{}", said(&output.stderr));
        text
    }
}

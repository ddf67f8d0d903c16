//! What a run was made with: commit, lock file, toolchain, hardware, threads.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

use serde::{Deserialize, Serialize};

use crate::store::hash_bytes;

/// Contents of `provenance.json`; measured, never compared between runs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Provenance {
    /// Version of this file's layout.
    pub format: u32,
    /// Version of the program.
    pub version: String,
    /// Command line.
    pub command: Vec<String>,
    /// Commit of the repository that holds the experiment, if it is one.
    pub commit: Option<String>,
    /// Uncommitted changes to it; `None` without a repository, empty without changes.
    pub diff: Option<String>,
    /// SHA-256 of the lock file that the program was built with.
    pub lock_file_sha256: String,
    /// Compiler.
    pub rustc: String,
    /// Target platform.
    pub target: String,
    /// Processor.
    pub cpu: String,
    /// Instruction set of the numerical kernels.
    pub isa: String,
    /// Threads used.
    pub threads: usize,
    /// Cargo features that are on.
    pub features: Vec<String>,
    /// `bitwise`: a rerun on any x86-64 machine gives the same bits; `tolerance`: it gives nearly the same numbers.
    #[serde(alias = "class")]
    pub exactness: String,
}

impl Provenance {
    /// Looks around: the repository of `experiment_file`, the build, the machine.
    pub fn gather(experiment_file: &Path, isa: &str, threads: usize) -> Self {
        let folder = experiment_file.parent().filter(|f| !f.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let exactness = if cfg!(target_arch = "x86_64") { "bitwise" } else { "tolerance" };
        Self {
            format: 1,
            version: env!("CARGO_PKG_VERSION").to_owned(),
            command: std::env::args().collect(),
            commit: git(folder, &["rev-parse", "HEAD"]),
            diff: git(folder, &["diff", "HEAD"]),
            lock_file_sha256: hash_bytes(include_bytes!("../../Cargo.lock")).to_string(),
            rustc: env!("PANOTUNE_RUSTC").to_owned(),
            target: env!("PANOTUNE_TARGET").to_owned(),
            cpu: cpu(),
            isa: isa.to_owned(),
            threads,
            features: Vec::new(),
            exactness: exactness.to_owned(),
        }
    }
}

impl Provenance {
    /// What may make `later` another result: each field that differs, as it is here and there.
    pub fn differences(&self, later: &Self) -> BTreeMap<&'static str, [String; 2]> {
        let commit = |p: &Self| p.commit.clone().unwrap_or_else(|| "none".to_owned());
        let fields = [
            ("version", self.version.clone(), later.version.clone()),
            ("commit", commit(self), commit(later)),
            ("lock file", self.lock_file_sha256.clone(), later.lock_file_sha256.clone()),
            ("rustc", self.rustc.clone(), later.rustc.clone()),
            ("target", self.target.clone(), later.target.clone()),
            ("processor", self.cpu.clone(), later.cpu.clone()),
            ("instruction set", self.isa.clone(), later.isa.clone()),
            ("threads", self.threads.to_string(), later.threads.to_string()),
        ];
        let differs = fields.into_iter().filter(|(_, then, now)| then != now);
        differs.map(|(name, then, now)| (name, [then, now])).collect()
    }
}

/// Output of a git command in `folder`; `None` without git or outside a repository.
fn git(folder: &Path, args: &[&str]) -> Option<String> {
    let output = Command::new("git").arg("-C").arg(folder).args(args).output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).trim_end().to_owned();
    output.status.success().then_some(text)
}

fn cpu() -> String {
    let text = std::fs::read_to_string("/proc/cpuinfo").unwrap_or_default();
    let model = text.lines().find_map(|l| l.strip_prefix("model name"));
    let model = model.map(|m| m.trim_start_matches([' ', '\t', ':']).to_owned());
    model.unwrap_or_else(|| std::env::consts::ARCH.to_owned())
}

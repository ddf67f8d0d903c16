//! The Python process in which other libraries do the same work.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};

use serde_json::{Value, json};

use super::PEAK_FLAG;
use super::machine::Time;

/// `tests/peers/engine.py`, waiting for names of works.
pub struct Peers(Option<Process>);

struct Process {
    child: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
    versions: Value,
    works: Vec<String>,
}

impl Peers {
    /// Starts the process; without Python or any of the libraries there are no peers, and it says so.
    pub fn start() -> Self {
        let process = Process::start();
        if process.is_none() {
            println!("no peers: {} has no PyTorch, onnxruntime or OpenCV", python().display());
        }
        Self(process)
    }

    /// Versions of the libraries, and of this program.
    pub fn versions(&self) -> Value {
        let mut versions = self.0.as_ref().map_or_else(|| json!({}), |p| p.versions.clone());
        versions["panotune"] = json!(env!("CARGO_PKG_VERSION"));
        versions
    }

    pub fn can(&self, work: &str) -> bool {
        self.0.as_ref().is_some_and(|p| p.works.iter().any(|w| w == work))
    }

    /// Time of `work`, done once.
    pub fn time(&mut self, work: &str, threads: usize) -> Time {
        let answer = self.0.as_mut().and_then(|p| p.ask(&format!("{work} {threads}")));
        let seconds = |key: &str| answer.as_ref().and_then(|a| a[key].as_f64());
        let (Some(seconds), Some(processor)) = (seconds("seconds"), seconds("cpu_seconds")) else {
            panic!("no answer to {work}: see what Python wrote above")
        };
        Time { seconds, processor }
    }

    /// Peak of the memory of a process of its own that does `work`.
    pub fn peak(&self, work: &str) -> Option<Value> {
        let output = command().args([PEAK_FLAG, work]).stderr(Stdio::inherit()).output().ok()?;
        serde_json::from_slice(&output.stdout).ok()
    }
}

impl Process {
    fn start() -> Option<Self> {
        let mut child = command().stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().ok()?;
        let (input, output) = (child.stdin.take()?, BufReader::new(child.stdout.take()?));
        let mut process = Self { child, input, output, versions: Value::Null, works: Vec::new() };
        let greeting = process.read()?;
        process.versions = greeting["versions"].clone();
        process.works = serde_json::from_value(greeting["works"].clone()).ok()?;
        (!process.works.is_empty()).then_some(process)
    }

    fn ask(&mut self, line: &str) -> Option<Value> {
        writeln!(self.input, "{line}").ok()?;
        self.read()
    }

    fn read(&mut self) -> Option<Value> {
        let mut line = String::new();
        self.output.read_line(&mut line).ok()?;
        serde_json::from_str(&line).ok()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // it ends by itself at the end of its input, which is not closed before this returns
        if self.child.kill().and_then(|()| self.child.wait()).is_err() {
            println!("a Python process may be left over");
        }
    }
}

fn python() -> PathBuf {
    let own = || Path::new(env!("CARGO_MANIFEST_DIR")).join("target/python/bin/python");
    std::env::var_os("PANOTUNE_PYTHON").map_or_else(own, PathBuf::from)
}

fn command() -> Command {
    let mut command = Command::new(python());
    command.args(["-B", "-W", "ignore"]).arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/peers/engine.py"));
    command
}

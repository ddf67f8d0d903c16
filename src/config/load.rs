//! From a file to a checked, resolved experiment or suite.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::check::{Mistake, check, make_whole};
use super::compose::{Layers, compose};
use super::error::{ConfigErrors, Diagnostic, Source, choice_hint, quoted};
use super::pieces::{Library, SECTIONS};
use super::rules;
use super::set::Assignment;
use super::source::{parse_mapping_on, read};
use super::spec::{Experiment, Suite};
use super::tree::{Entry, Node, Value};

/// What a file declares.
#[derive(Debug, Clone)]
pub enum Loaded {
    /// One study.
    Experiment(Box<LoadedExperiment>),
    /// Several.
    Suite(Box<LoadedSuite>),
}

/// A resolved experiment that remembers where its values come from.
#[derive(Debug, Clone)]
pub struct LoadedExperiment {
    /// The total specification.
    pub spec: Experiment,
    /// The file.
    pub path: PathBuf,
    /// The file's text, line ends normalised.
    pub source_text: String,
    pub(super) tree: Node,
}

/// A suite and its experiments, in the order in which it lists them.
#[derive(Debug, Clone)]
pub struct LoadedSuite {
    /// The suite.
    pub spec: Suite,
    /// The file.
    pub path: PathBuf,
    /// The file's text, line ends normalised.
    pub source_text: String,
    /// Its experiments.
    pub experiments: Vec<LoadedExperiment>,
}

/// Loads the experiment or suite in `file`, composed with its pieces and with the options.
///
/// `profile` is the argument of `--profile`, `sets` those of `--set` in order. For a suite both go to each of its
/// experiments, all of which are loaded.
///
/// # Errors
/// Every mistake in every file that takes part.
pub fn load(file: &Path, profile: Option<&str>, sets: &[String]) -> Result<Loaded, ConfigErrors> {
    let (sets, mut mistakes) = assignments(sets);
    let loaded = read(file).map_err(|d| vec![d]).and_then(|source| {
        let parsed = parse_mapping_on(&source)?;
        let loader = Loader { profile, sets: &sets };
        match kind(&parsed.0)? {
            "suite" => loader.suite(file, source, parsed).map(|s| Loaded::Suite(Box::new(s))),
            _ => loader.experiment(file, source, parsed).map(|e| Loaded::Experiment(Box::new(e))),
        }
    });
    match loaded {
        Ok(loaded) if mistakes.is_empty() => Ok(loaded),
        Ok(_) => Err(ConfigErrors::new(mistakes)),
        Err(found) => {
            mistakes.extend(found);
            Err(ConfigErrors::new(mistakes))
        }
    }
}

fn assignments(sets: &[String]) -> (Vec<Assignment>, Vec<Diagnostic>) {
    let mut mistakes = Vec::new();
    let parsed = sets.iter().filter_map(|set| Assignment::parse(set).map_err(|found| mistakes.extend(found)).ok());
    (parsed.collect(), mistakes)
}

fn kind(tree: &Node) -> Result<&'static str, Vec<Diagnostic>> {
    let Some(node) = tree.get("kind") else { return Ok("experiment") };
    match node.text() {
        Some("experiment") => Ok("experiment"),
        Some("pretraining") => Ok("pretraining"),
        Some("suite") => Ok("suite"),
        Some("odometry") => Err(vec![
            Diagnostic::new(&node.place, "`kind: odometry` is not part of this version")
                .hint("this version runs `kind: experiment`, `kind: pretraining` and `kind: suite`"),
        ]),
        other => {
            let hint = choice_hint(other.unwrap_or_default(), "kinds", &["experiment", "pretraining", "suite"]);
            Err(vec![Diagnostic::new(&node.place, format!("`kind` cannot be {}", node.kind())).hint(hint)])
        }
    }
}

/// A file's tree, and the mistakes past which it could be read.
type Parsed = (Node, Vec<Diagnostic>);

struct Loader<'a> {
    profile: Option<&'a str>,
    sets: &'a [Assignment],
}

impl Loader<'_> {
    fn experiment(
        &self,
        file: &Path,
        source: Arc<Source>,
        parsed: Parsed,
    ) -> Result<LoadedExperiment, Vec<Diagnostic>> {
        let library = Library::for_file(file);
        let (tree, mut mistakes) = parsed;
        let stem = stem(file);
        let layers =
            Layers { library: &library, file: tree, profile: self.profile, sets: self.sets, default_name: &stem };
        let (mut tree, found) = compose(layers);
        mistakes.extend(found);
        make_whole("Experiment", &mut tree);
        let misfits = check("Experiment", &tree);
        let faulty: Vec<Vec<String>> = misfits.iter().map(|m| m.path.clone()).collect();
        // a section whose piece is not there is missing for that reason only
        let whole = mistakes.is_empty();
        let reported = |m: &Mistake| whole || !SECTIONS.iter().any(|s| m.missing.as_deref() == s.path.last().copied());
        let mut found: Vec<Diagnostic> = misfits.into_iter().filter(reported).map(|m| m.diagnostic).collect();
        found.extend(rules::check(&source, &tree, &faulty));
        // of several mistakes at one value, the one found first explains the others
        found.retain(|d| mistakes.iter().all(|m| m.place != d.place));
        mistakes.extend(found);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        let spec = deserialise(&tree)?;
        Ok(LoadedExperiment { spec, path: file.to_owned(), source_text: source.text.clone(), tree })
    }

    fn suite(&self, file: &Path, source: Arc<Source>, parsed: Parsed) -> Result<LoadedSuite, Vec<Diagnostic>> {
        let (mut tree, mut mistakes) = parsed;
        let unnamed = tree.get("name").is_none();
        if let (true, Value::Map(entries)) = (unnamed, &mut tree.value) {
            let stem = stem(file);
            let name = Source::option("file name", &stem);
            let node = Node { value: Value::Text(stem), place: name.whole() };
            entries.push(Entry { key: "name".to_owned(), key_place: name.whole(), node });
        }
        mistakes.extend(check("Suite", &tree).into_iter().map(|m| m.diagnostic));
        let (experiments, found) = self.members(file, &tree);
        mistakes.extend(found);
        if !mistakes.is_empty() {
            return Err(mistakes);
        }
        Ok(LoadedSuite {
            spec: deserialise(&tree)?,
            path: file.to_owned(),
            source_text: source.text.clone(),
            experiments,
        })
    }

    fn members(&self, suite: &Path, tree: &Node) -> (Vec<LoadedExperiment>, Vec<Diagnostic>) {
        let mut mistakes = Vec::new();
        let mut experiments: Vec<LoadedExperiment> = Vec::new();
        let mut names = BTreeMap::new();
        let Some(Value::List(items)) = tree.get("experiments").map(|n| &n.value) else {
            return (experiments, mistakes);
        };
        // what is not text is a mistake that the schema finds
        for item in items.iter().filter(|item| item.text().is_some()) {
            match self.member(suite, item) {
                Err(found) => mistakes.extend(found),
                Ok(member) => {
                    if let Some(other) = names.insert(member.spec.name.clone(), member.path.clone()) {
                        let message = format!("`{}` has the name `{}` too", other.display(), member.spec.name);
                        let hint = "their results would go to one folder; give each its own `name`";
                        mistakes.push(Diagnostic::new(&item.place, message).hint(hint));
                    }
                    experiments.push(member);
                }
            }
        }
        (experiments, mistakes)
    }

    fn member(&self, suite: &Path, item: &Node) -> Result<LoadedExperiment, Vec<Diagnostic>> {
        let path = suite.parent().unwrap_or(Path::new("")).join(item.text().unwrap_or_default());
        if !path.is_file() {
            let message = format!("there is no experiment {}", quoted(&path.display().to_string()));
            return Err(vec![
                Diagnostic::new(&item.place, message).hint("paths are taken from the suite's own folder"),
            ]);
        }
        let source = read(&path).map_err(|d| vec![d])?;
        let parsed = parse_mapping_on(&source)?;
        let kind = kind(&parsed.0)?;
        if kind != "experiment" {
            let message = format!("{} is a {kind}", quoted(&path.display().to_string()));
            return Err(vec![Diagnostic::new(&item.place, message).hint("a suite lists experiments only")]);
        }
        self.experiment(&path, source, parsed)
    }
}

fn stem(file: &Path) -> String {
    file.file_stem().map(|s| s.to_string_lossy().into_owned()).unwrap_or_default()
}

/// The typed value of a checked tree.
fn deserialise<T: serde::de::DeserializeOwned>(tree: &Node) -> Result<T, Vec<Diagnostic>> {
    let typed = serde_yaml::to_value(tree.to_json()).and_then(serde_yaml::from_value);
    typed.map_err(|e| vec![Diagnostic::new(&tree.place, format!("this is no experiment: {e}"))])
}

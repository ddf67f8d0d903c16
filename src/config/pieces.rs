//! Pieces: the files of `configs/` that experiments are composed from.
//!
//! A piece is looked for in the `configs/` of every folder above the experiment's file, nearest first, then in the
//! current folder's, then among the copies built into the program.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use super::compose::{merge, take_entry};
use super::embedded::EMBEDDED;
use super::error::{Diagnostic, Place, Source, choice_hint, quoted};
use super::source::{parse_mapping, read_if_there, text_of};
use super::tree::{Node, Value};

/// A part of an experiment that can name a piece with `use:`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Section {
    /// Where it stands in an experiment.
    pub path: &'static [&'static str],
    /// Folder of `configs/` that holds its pieces.
    pub folder: &'static str,
    /// The piece when none is named.
    pub default: &'static str,
}

const fn section(path: &'static [&'static str], folder: &'static str, default: &'static str) -> Section {
    Section { path, folder, default }
}

/// Every section; one inside another stands after it.
pub(super) const SECTIONS: [Section; 13] = [
    section(&["dataset"], "dataset", "wide_angle"),
    section(&["split"], "split", "by_group"),
    section(&["augment"], "augment", "paper"),
    section(&["backbone"], "backbone", "inception_v3"),
    section(&["network"], "network", "single_net"),
    section(&["search"], "search", "default"),
    section(&["search", "space"], "space", "table_1"),
    section(&["search", "sampler"], "sampler", "default"),
    section(&["search", "pruner"], "pruner", "median"),
    section(&["train"], "train", "head"),
    section(&["baseline"], "baseline", "aerocalib"),
    section(&["evaluation"], "evaluation", "default"),
    section(&["report"], "report", "default"),
];

/// Names of the built-in pieces of a folder.
pub(super) fn embedded_names(folder: &str) -> Vec<&'static str> {
    let inside = |path: &'static str| path.strip_prefix(folder)?.strip_prefix('/')?.strip_suffix(".yaml");
    EMBEDDED.iter().filter_map(|(path, _)| inside(path)).collect()
}

/// Finds and reads pieces.
#[derive(Debug)]
pub(super) struct Library {
    folders: Vec<PathBuf>,
}

impl Library {
    /// The pieces that an experiment in `file` sees.
    pub fn for_file(file: &Path) -> Self {
        let absolute = std::path::absolute(file).unwrap_or_else(|_| file.to_owned());
        let above = absolute.ancestors().skip(1).map(|folder| shorten(&folder.join("configs")));
        let mut folders: Vec<PathBuf> = above.chain([PathBuf::from("configs")]).filter(|f| f.is_dir()).collect();
        folders.dedup();
        Self { folders }
    }

    /// The piece `name` of `folder`, merged onto the pieces that it names as its base; without its `use` key.
    ///
    /// `named_at` is where the name stands, for messages.
    pub fn load(&self, folder: &str, name: &str, named_at: Option<&Place>) -> Result<Node, Vec<Diagnostic>> {
        self.load_above(folder, name, named_at, &mut Vec::new())
    }

    fn load_above(
        &self,
        folder: &str,
        name: &str,
        named_at: Option<&Place>,
        users: &mut Vec<String>,
    ) -> Result<Node, Vec<Diagnostic>> {
        if users.iter().any(|user| user == name) {
            let circle = users.iter().map(String::as_str).chain([name]).collect::<Vec<_>>().join(" → ");
            let mistake =
                located(named_at, format!("pieces of configs/{folder}/ use each other in a circle: {circle}"));
            return Err(vec![mistake.hint("remove one `use:`")]);
        }
        let source = self.find(folder, name, named_at).map_err(|d| vec![d])?;
        let mut own = parse_mapping(&source)?;
        let Some(base) = take_entry(&mut own, "use") else { return Ok(own) };
        let Some(base_name) = base.node.text() else { return Err(vec![not_a_name(&base.node)]) };
        users.push(name.to_owned());
        let mut whole = self.load_above(folder, base_name, Some(&base.node.place), users)?;
        merge(&mut whole, own);
        Ok(whole)
    }

    fn find(&self, folder: &str, name: &str, named_at: Option<&Place>) -> Result<Arc<Source>, Diagnostic> {
        let plain = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
        let relative = format!("{folder}/{name}.yaml");
        if name.chars().all(plain) && !name.starts_with('.') {
            for configs in &self.folders {
                if let Some(read) = read_if_there(&configs.join(&relative)) {
                    return read;
                }
            }
            if let Some((path, text)) = EMBEDDED.iter().find(|(path, _)| *path == relative) {
                return text_of(&format!("configs/{path} (built in)"), text.as_bytes().to_vec());
            }
        }
        let names = self.names(folder);
        let known: Vec<&str> = names.iter().map(String::as_str).collect();
        let message = format!("there is no piece {} in configs/{folder}/", quoted(name));
        Err(located(named_at, message).hint(choice_hint(name, "there are", &known)))
    }

    fn names(&self, folder: &str) -> Vec<String> {
        let mut names: Vec<String> = embedded_names(folder).into_iter().map(str::to_owned).collect();
        for entry in self.folders.iter().filter_map(|f| std::fs::read_dir(f.join(folder)).ok()).flatten().flatten() {
            names.extend(entry.file_name().to_string_lossy().strip_suffix(".yaml").map(str::to_owned));
        }
        names.sort();
        names.dedup();
        names
    }
}

/// The path from the current folder, if it lies below it.
fn shorten(path: &Path) -> PathBuf {
    let here = std::env::current_dir().unwrap_or_default();
    path.strip_prefix(&here).unwrap_or(path).to_owned()
}

fn located(place: Option<&Place>, message: String) -> Diagnostic {
    Diagnostic { message, hint: None, place: place.cloned() }
}

/// `use:` with something else than a name.
pub(super) fn not_a_name(node: &Node) -> Diagnostic {
    let what = if matches!(node.value, Value::Null) { "nothing".to_owned() } else { node.kind() };
    Diagnostic::new(&node.place, format!("`use` takes the name of a piece, this is {what}"))
        .hint("write e.g. `use: default`; names are those of the files in configs/, without `.yaml`")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_file_of_configs_is_built_in_with_its_text() {
        let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("configs");
        let mut on_disk = Vec::new();
        for folder in std::fs::read_dir(&root).unwrap().map(|e| e.unwrap().path()) {
            // weights descriptions belong to `backbone`, the schema is generated
            if folder.ends_with("weights") || folder.ends_with("schema") {
                continue;
            }
            for file in std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().path()) {
                let name = file.strip_prefix(&root).unwrap().display().to_string();
                on_disk.push((name, std::fs::read_to_string(&file).unwrap()));
            }
        }
        on_disk.sort();
        let mut built_in: Vec<_> = EMBEDDED.iter().map(|(p, t)| ((*p).to_owned(), (*t).to_owned())).collect();
        built_in.sort();
        assert_eq!(on_disk, built_in);
    }

    #[test]
    fn every_section_has_its_default_piece() {
        for section in SECTIONS {
            assert!(embedded_names(section.folder).contains(&section.default), "{section:?}");
        }
    }
}

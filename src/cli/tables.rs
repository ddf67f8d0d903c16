//! `panotune tables`

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use super::Failure;
use super::args::{Global, TableFormat, TablesArgs};
use crate::store;
use crate::store::find_run;
use crate::tables::artefacts::RunArtefacts;
use crate::tables::published::Published;
use crate::tables::{Table, audit, csv, latex, markdown, plain, suite_tables, tables as tables_of, write};

/// Tables of one run, or of several together.
struct Group {
    /// Folder below `--out`; none if there is one group only.
    name: Option<String>,
    tables: Vec<Table>,
}

pub(super) fn tables(global: &Global, args: &TablesArgs) -> Result<(), Failure> {
    let groups = if args.audit {
        vec![Group { name: None, tables: vec![audit(&Published::load()?)] }]
    } else {
        of_runs(&runs(global, args)?)?
    };
    let groups = only(groups, &args.only)?;
    match &args.out {
        Some(folder) => write_all(folder, &groups),
        None => print_all(args.format, &groups),
    }
}

/// The runs that are asked for, or the newest finished one of each experiment.
fn runs(global: &Global, args: &TablesArgs) -> Result<Vec<PathBuf>, Failure> {
    let results = &global.results;
    if !args.runs.is_empty() {
        return args.runs.iter().map(|name| Ok(find_run(name, results)?)).collect();
    }
    let mut newest: BTreeMap<String, (SystemTime, PathBuf)> = BTreeMap::new();
    for run in store::run_names(results)? {
        let folder = run.folder(results);
        // suites have no artefacts of their own
        if !folder.join("metrics.json").is_file() {
            continue;
        }
        if let Ok(finished) = folder.join(store::SUMS).metadata().and_then(|sums| sums.modified()) {
            let entry = (finished, folder);
            newest.entry(run.name).and_modify(|last| *last = entry.clone().max(last.clone())).or_insert(entry);
        }
    }
    if newest.is_empty() {
        let hint = "hint: `panotune run FILE` makes one, or name a run's folder";
        return Err(Failure::input(format!("error: there is no finished run in `{}` ({hint})", results.display())));
    }
    Ok(newest.into_values().map(|(_, folder)| folder).collect())
}

/// Each run's tables; those that compare backbones stand before them if there are several runs.
fn of_runs(paths: &[PathBuf]) -> Result<Vec<Group>, Failure> {
    let runs = paths.iter().map(|path| Ok(RunArtefacts::read(path)?)).collect::<Result<Vec<_>, Failure>>()?;
    if let [run] = &runs[..] {
        return Ok(vec![Group { name: None, tables: tables_of(run)? }]);
    }
    let together = suite_tables(&runs)?;
    let apart = |table: &Table| !together.iter().any(|t| t.id == table.id);
    let mut groups = Vec::new();
    for (path, run) in paths.iter().zip(&runs) {
        let id = path.file_name().map(|id| id.to_string_lossy().into_owned()).unwrap_or_default();
        let tables = tables_of(run)?.into_iter().filter(|table| apart(table)).collect();
        groups.push(Group { name: Some(format!("{}/{id}", run.experiment.name)), tables });
    }
    groups.insert(0, Group { name: None, tables: together });
    Ok(groups)
}

/// The tables with the names `wanted`; all of them if there is none.
fn only(mut groups: Vec<Group>, wanted: &[String]) -> Result<Vec<Group>, Failure> {
    let mut known: Vec<String> = groups.iter().flat_map(|group| group.tables.iter().map(|t| t.id.clone())).collect();
    known.sort();
    known.dedup();
    let unknown: Vec<&str> = wanted.iter().filter(|name| !known.contains(name)).map(String::as_str).collect();
    if !unknown.is_empty() {
        let (unknown, known) = (unknown.join("`, `"), known.join(", "));
        return Err(Failure::input(format!("error: there is no table `{unknown}` (hint: there are {known})")));
    }
    if !wanted.is_empty() {
        groups.iter_mut().for_each(|group| group.tables.retain(|table| wanted.contains(&table.id)));
        groups.retain(|group| !group.tables.is_empty());
    }
    Ok(groups)
}

fn write_all(folder: &Path, groups: &[Group]) -> Result<(), Failure> {
    for group in groups {
        write(&group.name.as_ref().map_or(folder.to_owned(), |name| folder.join(name)), &group.tables)?;
    }
    println!("{}", folder.display());
    Ok(())
}

fn print_all(format: TableFormat, groups: &[Group]) -> Result<(), Failure> {
    let mut texts = Vec::new();
    for group in groups {
        texts.extend(group.name.as_ref().map(|name| heading(format, name)));
        for table in &group.tables {
            texts.push(match format {
                TableFormat::Plain => plain(table),
                TableFormat::Markdown => markdown(table),
                TableFormat::Latex => latex(table),
                TableFormat::Csv => String::from_utf8_lossy(&csv(table)?).into_owned(),
            });
        }
    }
    print!("{}", texts.join("\n"));
    Ok(())
}

/// Whose tables follow.
fn heading(format: TableFormat, name: &str) -> String {
    match format {
        TableFormat::Plain | TableFormat::Csv => format!("{name}\n"),
        TableFormat::Markdown => format!("## {name}\n"),
        TableFormat::Latex => format!("% {name}\n"),
    }
}

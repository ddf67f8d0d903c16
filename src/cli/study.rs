//! `panotune study`

use std::path::Path;

use super::Failure;
use super::args::{ExportPlace, Global, PlotArgs, StudyArgs, StudyCommand, StudyPlace, TrialsFormatArg};
use crate::figures::study::{self as plots, StudyPlot};
use crate::search::storage::{self, StoredStudy, StoredTrial, TrialFormat};
use crate::store;

pub(super) fn study(global: &Global, args: &StudyArgs) -> Result<(), Failure> {
    match &args.command {
        StudyCommand::List { db } => list(global, db),
        StudyCommand::Show { place } => show(global, &load(place)?),
        StudyCommand::Trials { place, format } => {
            let study = load(place)?;
            trials(global, &study, &study.trials.iter().collect::<Vec<_>>(), *format);
            Ok(())
        }
        StudyCommand::Best { place } => best(global, &load(place)?),
        StudyCommand::Export { place, canonical } => export(place, *canonical),
        StudyCommand::Import { file, db } => {
            storage::import(file, db)?.iter().for_each(|name| println!("{name}"));
            Ok(())
        }
        StudyCommand::Plot(args) => plot(args),
        StudyCommand::Enqueue { place, sets } => enqueue(place, sets),
    }
}

fn load(place: &StudyPlace) -> Result<StoredStudy, Failure> {
    Ok(storage::load(&place.db, place.study.as_deref())?)
}

fn list(global: &Global, db: &Path) -> Result<(), Failure> {
    let studies = storage::open_read_only(db)?.studies()?;
    print!("{}", if global.json { storage::studies_json(&studies) } else { storage::studies_table(&studies) });
    Ok(())
}

fn show(global: &Global, study: &StoredStudy) -> Result<(), Failure> {
    print!("{}", if global.json { storage::study_json(study) } else { storage::study_text(study) });
    Ok(())
}

fn trials(global: &Global, study: &StoredStudy, trials: &[&StoredTrial], format: TrialsFormatArg) {
    let format = match format {
        _ if global.json => TrialFormat::JsonLines,
        TrialsFormatArg::Table => TrialFormat::Table,
        TrialsFormatArg::Json => TrialFormat::Json,
        TrialsFormatArg::Csv => TrialFormat::Csv,
    };
    print!("{}", storage::trials_text(study, trials, format));
}

fn best(global: &Global, study: &StoredStudy) -> Result<(), Failure> {
    let best = storage::best_trials(study);
    if best.is_empty() {
        return Err(Failure::input(format!(
            "error: the study `{}` has no complete trial that keeps its constraints",
            study.name
        )));
    }
    trials(global, study, &best, TrialsFormatArg::Table);
    Ok(())
}

fn export(place: &ExportPlace, canonical: bool) -> Result<(), Failure> {
    let study = storage::load(&place.db, place.study.as_deref())?;
    match (&place.file, canonical) {
        (Some(file), false) => storage::export(&[study], file)?,
        (Some(file), true) => store::write(file, storage::canonical(&study).as_bytes())?,
        (None, _) => print!("{}", storage::canonical(&study)),
    }
    Ok(())
}

fn enqueue(place: &StudyPlace, sets: &[String]) -> Result<(), Failure> {
    let read = |text: &String| storage::parse_setting(text).map_err(|e| Failure::input(format!("error: {e}")));
    let settings = sets.iter().map(read).collect::<Result<Vec<_>, _>>()?;
    let mut opened = storage::open(&place.db)?;
    let name = storage::choose(opened.as_mut(), place.study.as_deref())?;
    println!("{}", storage::enqueue(opened.as_mut(), &name, &settings)?.number);
    Ok(())
}

fn plot(args: &PlotArgs) -> Result<(), Failure> {
    let study = load(&args.place)?;
    let named: Vec<StudyPlot> = args.plots.iter().filter_map(|name| StudyPlot::from_name(name)).collect();
    let wanted = if named.is_empty() { plots::applicable(&study) } else { named };
    let importance = plots::importance(&study, args.objective);
    let params = (!args.params.is_empty()).then(|| args.params.clone());
    let options = plots::Options { params, objective: args.objective, importance: &importance, others: &[] };
    for path in plots::write(&args.out, &wanted, &study, &options)? {
        println!("{}", path.display());
    }
    Ok(())
}

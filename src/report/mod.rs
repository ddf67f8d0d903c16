//! The one-page reports of runs and comparisons. Reads artefacts; computes no metric.
//!
//! A page needs nothing beside itself: style, script, figures, pictures and trials stand in it, and its policy forbids
//! it to fetch anything. Without its script it still has every table, figure and text.

mod facts;
mod grids;
mod page;
mod table;
mod trials;
mod views;

pub use facts::KeyFigure;
pub use page::{Document, FigureView, KeyNumber, Page, Section, Tone, Verdict, script_source};
pub use table::TableView;
pub use trials::TrialData;
pub use views::Views;

use std::collections::BTreeMap;

use crate::config::spec::Kind;
use crate::error::{Class, Classify};
use crate::figures::Figure;
use crate::tables::Table;
use crate::tables::artefacts::RunArtefacts;

/// What can go wrong with a report.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The template and its values do not fit; a bug.
    #[error("cannot make the report: {0}")]
    Template(#[from] minijinja::Error),
    /// The resolved experiment does not serialise; a bug.
    #[error("cannot show the resolved experiment: {0}")]
    Experiment(#[source] serde_yaml::Error),
    /// The provenance does not serialise; a bug.
    #[error("cannot show the provenance: {0}")]
    Provenance(#[source] serde_json::Error),
    /// A picture's bytes do not fit its size.
    #[error("a picture of the report has another number of bytes than its size says")]
    Picture,
    /// The JPEG encoder refused.
    #[error("cannot encode a picture of the report: {0}")]
    Encode(#[source] image::ImageError),
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// What was measured while a run was made. Pages show it; nothing follows from it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Measured {
    /// Seconds of each trial, by number.
    pub trials: BTreeMap<u32, f64>,
    /// Seconds of each stage, in the order in which they ended.
    pub stages: Vec<(String, f64)>,
}

/// The page `report.html` of a run, complete in itself; links to files are relative to the run's folder.
///
/// Numbers are rows of `metrics.json` as they stand there.
///
/// # Errors
/// A picture of the gallery that is damaged; everything else is a bug.
pub fn of_run(run: &RunArtefacts, tables: &[Table], figures: &[Figure], measured: &Measured) -> Result<String, Error> {
    let seconds = measured.stages.iter().map(|(_, seconds)| seconds).sum::<f64>();
    let mut sections = [
        Section { id: "all-tables", title: "Tables", ..Section::default() }.tables(tables),
        Section { id: "all-figures", title: "Figures", ..Section::default() }.figures(figures),
    ];
    if run.experiment.kind == Kind::Pretraining {
        sections = sections.map(Section::unfiled);
    }
    let page = Page {
        kind: "run",
        title: run.experiment.name.clone(),
        description: run.experiment.description.clone(),
        verdict: facts::verdict(run),
        warnings: run.warnings.clone(),
        numbers: facts::numbers(run, (seconds > 0.0).then_some(seconds)),
        summary: vec![facts::summary(run)],
        errors: facts::key_figures(run),
        facts: facts::of(run),
        trials: TrialData::of(run, measured),
        views: Views::of(run)?,
        sections: sections.into(),
        documents: documents(run)?,
        durations: measured.stages.clone(),
        files: facts::files(run),
    };
    page.render()
}

fn documents(run: &RunArtefacts) -> Result<Vec<Document>, Error> {
    let resolved = Document {
        id: "configuration",
        title: "Configuration",
        note: "The resolved experiment: every key with the value that this run used.",
        file: "resolved.yaml",
        text: serde_yaml::to_string(&run.experiment).map_err(Error::Experiment)?,
    };
    let provenance = Document {
        id: "provenance",
        title: "Provenance",
        note: "What the run was made with: command, commit and uncommitted changes, lock file, compiler, processor, threads.",
        file: "provenance.json",
        text: match run.provenance.is_null() {
            true => "No provenance was recorded.".to_owned(),
            false => serde_json::to_string_pretty(&run.provenance).map_err(Error::Provenance)?,
        },
    };
    Ok(vec![resolved, provenance])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{self, fixture};
    use crate::tables::{Cell, Column};

    fn tables() -> Vec<Table> {
        let row = |cells: [&str; 4]| cells.map(Cell::text).to_vec();
        vec![Table {
            id: "table_7".to_owned(),
            number: Some(7),
            title: "Errors of focal length".to_owned(),
            columns: ["Metric", "Baseline", "Tuned", "Published <tuned>"].map(|t| Column::text(t, t)).to_vec(),
            notes: vec!["Test subset, 240 views of 20 panoramas.".to_owned()],
            rows: vec![
                row(["MAE (px)", "64.2 [57.1, 72.5]", "51.3 [45.7, 58.0]", "5.66"]),
                row(["MSE (px²)", "7,120", "4,630", "37.56"]),
            ],
        }]
    }

    fn page(run: &RunArtefacts) -> String {
        let measured = Measured { trials: [(0, 2.5)].into(), stages: vec![("study".to_owned(), 61.0)] };
        of_run(run, &tables(), &figures::draw_svg(run), &measured).unwrap()
    }

    #[test]
    fn the_page_needs_nothing_beside_itself() {
        let page = page(&fixture::run(10, 6));
        for part in page.split("src=\"").skip(1).chain(page.split(" href=\"").skip(1)) {
            let target = part.split('"').next().unwrap();
            let own = target.starts_with('#') || target.starts_with("data:") || !target.contains(':');
            assert!(own, "{target}");
        }
        assert!(!page.contains("@import") && !page.contains("url("));
        let source = script_source().replace('\'', "&#x27;").replace('/', "&#x2f;");
        assert!(page.contains(&format!("script-src {source};")) && page.contains("default-src &#x27;none&#x27;"));
    }

    #[test]
    fn ids_are_unique_and_every_link_inside_the_page_has_its_target() {
        let run = fixture::run(10, 6);
        let named = |name: &str| Table { id: name.to_owned(), number: None, ..tables().remove(0) };
        let tables = ["table_1", "controls", "summary"].map(named);
        let page = of_run(&run, &tables, &figures::draw_svg(&run), &Measured::default()).unwrap();
        let ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|p| p.split('"').next()).collect();
        let mut sorted = ids.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), ids.len());
        for target in page.split("href=\"#").skip(1).filter_map(|p| p.split('"').next()) {
            assert!(ids.contains(&target) || target.starts_with("trial-"), "{target}");
        }
    }

    #[test]
    fn numbers_and_warnings_stand_on_the_page() {
        let page = page(&fixture::run(10, 6));
        for words in [
            "its features are random",
            "51.3 px",
            "64.2 px",
            "240 test views",
            "optuna_inception",
            "spectrum control",
            "learning_rate: 0.001",
            "0123456789abcdef",
            "Figure 10. Optimisation history",
            "figures/figure_10.svg",
            "tables/table_7.csv",
            "Published &lt;tuned&gt;",
            "1 min 01 s",
            "View 17: true f",
            "predictions&#x2f;tuned.parquet",
        ] {
            assert!(page.contains(words), "{words}");
        }
    }

    #[test]
    fn text_of_users_cannot_become_markup() {
        let mut run = fixture::run(8, 2);
        run.experiment.description = "<img src=x onerror=alert(1)>".to_owned();
        run.warnings = vec!["</ul><script>1</script>".to_owned()];
        run.gallery.panorama = "<b>bold</b>".to_owned();
        run.trials[5].reason = Some("</script><script>2</script>".to_owned());
        let page = page(&run);
        assert!(!page.contains("<img src=x") && !page.contains("<b>bold"));
        assert!(!page.contains("<script>1") && !page.contains("<script>2"));
        // two blocks of data and one script
        assert_eq!(page.matches("<script").count(), 3);
        assert_eq!(page.matches("</script").count(), 3);
    }

    #[test]
    fn a_run_without_results_has_a_page_that_says_so() {
        let run = fixture::empty();
        let page = of_run(&run, &[], &figures::draw_svg(&run), &Measured::default()).unwrap();
        assert!(page.contains("No arm was evaluated") && !page.contains("id=\"trial-data\""));
        let body = page.split("</style>").nth(1).and_then(|rest| rest.split("<script>").next()).unwrap();
        assert!(!body.contains("NaN") && !body.contains("undefined") && !body.contains("none</"));
    }
}

//! The one-page report. Reads artefacts; computes no metric.
//!
//! The page needs nothing beside itself: styles and figures stand in it, there is no script, and
//! nothing is fetched. It is also readable as text, printed, on a narrow screen and in the dark.

mod facts;

use minijinja::value::Value;
use minijinja::{AutoEscape, Environment, context};

use crate::error::{Class, Classify};
use crate::figures::Figure;
use crate::tables::artefacts::RunArtefacts;

static TEMPLATE: &str = include_str!("../assets/report.html");

/// What can go wrong with the report.
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
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// A table as the page shows it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TableView {
    /// File name without its ending, e.g. `table_5`; the page links to its files.
    pub name: String,
    /// Heading, e.g. `Table 5. Errors of distortion ξ`.
    pub title: String,
    /// What a reader must know; may be empty.
    pub note: String,
    /// Headings of columns.
    pub columns: Vec<String>,
    /// Cells, as text, one for each column; a cell that reads as a number is set to the right.
    pub rows: Vec<Vec<String>>,
}

/// The page `report.html`, complete in itself; links to files are relative to the run's folder.
///
/// Numbers are rows of `metrics.json` as they stand there.
pub fn render(run: &RunArtefacts, tables: &[TableView], figures: &[Figure]) -> Result<String, Error> {
    let mut environment = Environment::new();
    environment.set_auto_escape_callback(|_| AutoEscape::Html);
    environment.add_template("report", TEMPLATE)?;
    let resolved = serde_yaml::to_string(&run.experiment).map_err(Error::Experiment)?;
    let provenance = serde_json::to_string_pretty(&run.provenance).map_err(Error::Provenance)?;
    let page = environment.get_template("report")?.render(context! {
        name => run.experiment.name.clone(),
        description => run.experiment.description.clone(),
        summary => facts::summary(run),
        key_figures => facts::key_figures(run).into_iter().map(fact).collect::<Vec<_>>(),
        facts => facts::of(run).into_iter().map(|(k, v)| context! { key => k, value => v }).collect::<Vec<_>>(),
        warnings => run.warnings.clone(),
        tables => tables.iter().map(table).collect::<Vec<_>>(),
        figures => figures.iter().map(figure).collect::<Vec<_>>(),
        resolved => resolved,
        provenance => if run.provenance.is_null() { String::new() } else { provenance },
    })?;
    Ok(page)
}

fn fact(fact: facts::KeyFigure) -> Value {
    context! { name => fact.name, f => fact.f, xi => fact.xi, own => fact.own }
}

fn table(table: &TableView) -> Value {
    let column = |(i, text): (usize, &String)| {
        let cells = || table.rows.iter().filter_map(|row| row.get(i));
        context! { text => text.clone(), number => cells().next().is_some() && cells().all(|c| is_number(c)) }
    };
    let columns = table.columns.iter().enumerate().map(column).collect::<Vec<_>>();
    let cell = |text: &String| context! { text => text.clone(), number => is_number(text) };
    context! {
        name => table.name.clone(),
        title => table.title.clone(),
        note => table.note.clone(),
        columns => columns,
        rows => table.rows.iter().map(|row| row.iter().map(cell).collect::<Vec<_>>()).collect::<Vec<_>>(),
    }
}

fn figure(figure: &Figure) -> Value {
    context! {
        name => figure.name.clone(),
        title => figure.title.clone(),
        caption => figure.caption.clone(),
        svg => Value::from_safe_string(figure.svg.clone()),
    }
}

/// Whether a cell reads as a number, with or without an interval, unit or percent sign.
fn is_number(text: &str) -> bool {
    let text = text.trim();
    let first = text.trim_start_matches(['−', '-', '+', '±', '<', '≥', '≤', '~']).chars().next();
    let letters = text.chars().filter(|c| c.is_alphabetic()).count();
    text == "–" || text == "—" || (first.is_some_and(|c| c.is_ascii_digit()) && letters <= 3)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::figures::{self, fixture};

    fn tables() -> Vec<TableView> {
        let row = |cells: &[&str]| cells.iter().map(|c| (*c).to_owned()).collect::<Vec<String>>();
        vec![TableView {
            name: "table_7".to_owned(),
            title: "Table 7. Errors of focal length".to_owned(),
            note: "Test subset, 240 views of 20 panoramas; published values rest on ten images.".to_owned(),
            columns: row(&["Metric", "Baseline", "Tuned", "Published <tuned>"]),
            rows: vec![
                row(&["MAE (px)", "64.2 [57.1, 72.5]", "51.3 [45.7, 58.0]", "5.66"]),
                row(&["MSE (px²)", "7,120", "4,630", "37.56"]),
            ],
        }]
    }

    fn page(run: &RunArtefacts) -> String {
        render(run, &tables(), &figures::draw_svg(run)).unwrap()
    }

    #[test]
    fn the_page_needs_nothing_beside_itself() {
        let page = page(&fixture::run(10, 6));
        for part in page.split("src=\"").skip(1).chain(page.split(" href=\"").skip(1)) {
            let target = part.split('"').next().unwrap();
            let own = target.starts_with('#') || target.starts_with("data:") || !target.contains(':');
            assert!(own, "{target}");
        }
        assert!(!page.contains("<script") && !page.contains("@import") && !page.contains("url("));
    }

    #[test]
    fn ids_are_unique_and_every_link_inside_the_page_has_its_target() {
        let run = fixture::run(10, 6);
        let named = |name: &str| TableView { name: name.to_owned(), ..TableView::default() };
        let tables = ["table_1", "controls", "summary"].map(named);
        let page = render(&run, &tables, &figures::draw_svg(&run)).unwrap();
        let ids: Vec<&str> = page.split(" id=\"").skip(1).filter_map(|p| p.split('"').next()).collect();
        let mut sorted = ids.clone();
        sorted.sort_unstable();
        sorted.dedup();
        assert_eq!(sorted.len(), ids.len());
        for target in page.split("href=\"#").skip(1).filter_map(|p| p.split('"').next()) {
            assert!(ids.contains(&target), "{target}");
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
        ] {
            assert!(page.contains(words), "{words}");
        }
    }

    #[test]
    fn text_of_users_cannot_become_markup() {
        let mut run = fixture::run(2, 2);
        run.experiment.description = "<img src=x onerror=alert(1)>".to_owned();
        run.warnings = vec!["</ul><script>1</script>".to_owned()];
        run.gallery.panorama = "<b>bold</b>".to_owned();
        let page = page(&run);
        assert!(!page.contains("<img src=x") && !page.contains("<script") && !page.contains("<b>bold"));
    }

    #[test]
    fn a_run_without_results_has_a_page_that_says_so() {
        let run = fixture::empty();
        let page = render(&run, &[], &figures::draw_svg(&run)).unwrap();
        assert!(page.contains("No arm was evaluated"));
        assert!(!page.contains("NaN") && !page.contains("undefined") && !page.contains("none</"));
    }

    #[test]
    fn cells_with_numbers_are_told_from_words() {
        assert!(["1.5", "−0.2 [−0.3, 0.1]", "64.2 px", "75.4 %", "–"].iter().all(|t| is_number(t)));
        assert!(["relu", "n/a (adam)", "", "not run", "2 – 12 layers"].iter().all(|t| !is_number(t)));
    }

    /// Writes a report to `PANOTUNE_FIGURES_DIR`, for people who want to look at it.
    #[test]
    #[ignore = "writes files for people"]
    fn show() {
        let Some(folder) = std::env::var_os("PANOTUNE_FIGURES_DIR").map(std::path::PathBuf::from) else { return };
        crate::store::write(&folder.join("report.html"), page(&fixture::run(10, 6)).as_bytes()).unwrap();
    }
}

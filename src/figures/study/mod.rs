//! Plots of a study: what a search tried, what it found, and what mattered.
//!
//! Each plot is a function from the stored study to shapes and a caption, in a file of its own. A study in
//! which no trial has finished gives a figure that says so; what the user asked for and cannot have is a
//! [`PlotError`]. Values that are not finite are left out, and the caption counts them.

mod contour;
mod edf;
mod history;
mod importance;
mod intermediate;
mod pairs;
mod panels;
mod parallel;
mod parameters;
mod pareto;
mod rank;
mod rows;
mod slice;
mod timeline;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use super::drawing::Drawing;
use super::{Error, Figure, png, svg};
use crate::error::{Class, Classify};
use crate::search::storage::StoredStudy;
use crate::search::{self, Importance, Trial};

use rows::{Rows, plural};

/// A plot of a study.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum StudyPlot {
    /// Value of each trial and the best so far.
    History,
    /// Importance of the parameters.
    Importance,
    /// Value over each parameter.
    Slice,
    /// Value over pairs of parameters, interpolated.
    Contour,
    /// A line a trial through all parameters.
    ParallelCoordinates,
    /// Reported values step by step.
    Intermediate,
    /// Share of trials up to each value.
    Edf,
    /// Pairs of parameters, coloured by the rank of the value.
    Rank,
    /// When each trial ran.
    Timeline,
    /// Two or three objectives against each other.
    ParetoFront,
}

impl StudyPlot {
    /// Every plot.
    pub const ALL: [StudyPlot; 10] = [
        StudyPlot::History,
        StudyPlot::Importance,
        StudyPlot::Slice,
        StudyPlot::Contour,
        StudyPlot::ParallelCoordinates,
        StudyPlot::Intermediate,
        StudyPlot::Edf,
        StudyPlot::Rank,
        StudyPlot::Timeline,
        StudyPlot::ParetoFront,
    ];

    /// Its name on the command line and of its files.
    pub fn name(self) -> &'static str {
        match self {
            StudyPlot::History => "history",
            StudyPlot::Importance => "importance",
            StudyPlot::Slice => "slice",
            StudyPlot::Contour => "contour",
            StudyPlot::ParallelCoordinates => "parallel-coordinates",
            StudyPlot::Intermediate => "intermediate",
            StudyPlot::Edf => "edf",
            StudyPlot::Rank => "rank",
            StudyPlot::Timeline => "timeline",
            StudyPlot::ParetoFront => "pareto-front",
        }
    }

    /// The plot of that name.
    pub fn from_name(name: &str) -> Option<Self> {
        StudyPlot::ALL.into_iter().find(|plot| plot.name() == name)
    }

    fn heading(self) -> &'static str {
        match self {
            StudyPlot::History => "Optimisation history",
            StudyPlot::Importance => "Importance of parameters",
            StudyPlot::Slice => "Values over single parameters",
            StudyPlot::Contour => "Values over pairs of parameters, interpolated",
            StudyPlot::ParallelCoordinates => "Parallel coordinates",
            StudyPlot::Intermediate => "Intermediate values",
            StudyPlot::Edf => "Empirical distribution of values",
            StudyPlot::Rank => "Ranks over pairs of parameters",
            StudyPlot::Timeline => "Timeline",
            StudyPlot::ParetoFront => "Pareto front",
        }
    }
}

impl std::fmt::Display for StudyPlot {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

/// What a plot shows.
#[derive(Debug, Clone, Default)]
pub struct Options<'a> {
    /// Parameters in this order; the most important ones without.
    pub params: Option<Vec<String>>,
    /// Which objective, from 0; the Pareto front shows all.
    pub objective: usize,
    /// Importance of the parameters, the most important first; it also orders panels and axes.
    pub importance: &'a [Importance],
    /// Further studies that the empirical distribution compares.
    pub others: &'a [&'a StoredStudy],
}

/// Plots for which the study has data.
pub fn applicable(study: &StoredStudy) -> Vec<StudyPlot> {
    let objectives = study.directions.len();
    let reports = study.trials.iter().any(|t| !t.intermediate.is_empty());
    let mut names: Vec<&str> = study.trials.iter().flat_map(|t| &t.params).map(|p| p.name.as_str()).collect();
    names.sort_unstable();
    names.dedup();
    let applies = |plot: &StudyPlot| match plot {
        StudyPlot::ParetoFront => (2..=3).contains(&objectives),
        StudyPlot::Intermediate => reports,
        StudyPlot::Contour | StudyPlot::Rank => names.len() >= 2,
        _ => true,
    };
    StudyPlot::ALL.into_iter().filter(applies).collect()
}

/// Importance of the parameters for one objective, by functional analysis of variance; always from the same seed.
pub fn importance(study: &StoredStudy, objective: usize) -> Vec<Importance> {
    let trials: Vec<Trial> = study.trials.iter().map(|t| t.to_trial(objective)).collect();
    search::importance(&trials, 0)
}

/// Why there is no plot.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// No trial of the study has such a parameter.
    #[error("study `{study}` has no parameter `{name}`{}", hint(.nearest))]
    UnknownParameter {
        /// What was asked for.
        name: String,
        /// The study's name.
        study: String,
        /// The most similar name.
        nearest: Option<String>,
    },
    /// The study has fewer objectives.
    #[error("there is no objective {asked}: the study has {}, numbered from 0", plural(*.count, "objective"))]
    UnknownObjective {
        /// What was asked for.
        asked: usize,
        /// Number of objectives.
        count: usize,
    },
    /// A Pareto front has two or three axes.
    #[error("plot `pareto-front` shows two or three objectives, and the study has {count}")]
    ObjectiveCount {
        /// Number of objectives.
        count: usize,
    },
    /// Pairs need two parameters.
    #[error("plot `{plot}` needs two parameters, not {found}")]
    TooFewParameters {
        /// The plot.
        plot: StudyPlot,
        /// Number of parameters.
        found: usize,
    },
    /// Too few trials have what the plot shows.
    #[error("plot `{plot}` needs {} {what}, and the study has {found}", plural(*.needed, "trial"))]
    TooFewTrials {
        /// The plot.
        plot: StudyPlot,
        /// How many it needs.
        needed: usize,
        /// Which trials count, e.g. `with a finite value`.
        what: String,
        /// How many there are.
        found: usize,
    },
    /// Studies that minimise and maximise do not compare.
    #[error("study `{other}` optimises objective {objective} in the other direction than study `{study}`")]
    Directions {
        /// The first study.
        study: String,
        /// The one that differs.
        other: String,
        /// Position of the objective.
        objective: usize,
    },
    /// A figure could not be painted or written.
    #[error(transparent)]
    Figure(#[from] Error),
}

fn hint(nearest: &Option<String>) -> String {
    nearest.as_ref().map_or_else(String::new, |name| format!("; did you mean `{name}`?"))
}

impl Classify for PlotError {
    fn class(&self) -> Class {
        match self {
            PlotError::Figure(error) => error.class(),
            _ => Class::Input,
        }
    }
}

/// Draws one plot of a study.
pub fn draw(plot: StudyPlot, study: &StoredStudy, options: &Options) -> Result<Figure, PlotError> {
    let (drawing, caption) = shapes(plot, study, options)?;
    let title = format!("{} of study {}", plot.heading(), study.name);
    let svg = svg::render(&drawing, &title)?;
    let png = png::render(&drawing)?;
    Ok(Figure { name: plot.name().to_owned(), title, caption, svg, png })
}

/// Draws plots of a study and writes `<plot>.svg` and `<plot>.png` of each to `dir`; gives the paths written.
///
/// Nothing is written if one of the plots cannot be drawn.
pub fn write(
    dir: &Path,
    plots: &[StudyPlot],
    study: &StoredStudy,
    options: &Options,
) -> Result<Vec<PathBuf>, PlotError> {
    let figures = plots.iter().map(|plot| draw(*plot, study, options)).collect::<Result<Vec<_>, _>>()?;
    Ok(super::write(dir, &figures)?)
}

/// The shapes of a plot and its caption.
fn shapes(plot: StudyPlot, study: &StoredStudy, options: &Options) -> Result<(Drawing, String), PlotError> {
    let rows = Rows::new(study, options.objective)?;
    if plot == StudyPlot::Timeline {
        return timeline::draw(&rows);
    }
    if rows.finished() == 0 {
        let why = format!("No trial of study {} has finished, so there is nothing to show yet.", study.name);
        return Ok((Drawing::sentence(&why), why));
    }
    match plot {
        StudyPlot::History => history::draw(&rows),
        StudyPlot::Importance => importance::draw(&rows, options),
        StudyPlot::Slice => slice::draw(&rows, options),
        StudyPlot::Contour => contour::draw(&rows, options),
        StudyPlot::ParallelCoordinates => parallel::draw(&rows, options),
        StudyPlot::Intermediate => intermediate::draw(&rows),
        StudyPlot::Edf => edf::draw(&rows, options),
        StudyPlot::Rank => rank::draw(&rows, options),
        StudyPlot::Timeline => timeline::draw(&rows),
        StudyPlot::ParetoFront => pareto::draw(study),
    }
}

//! Figures as SVG and PNG. Reads artefacts; computes no metric.
//!
//! Each figure is a function from the run's artefacts to a list of shapes in points
//! ([`drawing::Drawing`]); the SVG and the PNG are both made from that list, so they agree. Nothing
//! depends on a clock or on installed fonts: the same artefacts give the same bytes.

pub mod axes;
pub mod drawing;
pub mod study;
pub mod style;

mod compared;
mod curves;
mod errors;
mod flow;
mod gallery;
mod history;
mod importance;
mod network;
mod png;
mod published;
mod scatter;
mod svg;
mod text;

#[cfg(test)]
pub(crate) mod fixture;
#[cfg(test)]
pub(crate) mod legible;
#[cfg(test)]
mod tests;

pub use compared::{Curve, search_curves};

use std::path::{Path, PathBuf};

use rayon::prelude::*;

use crate::error::{Class, Classify};
use crate::evaluate::Quantity;
use crate::store;
use crate::tables::artefacts::RunArtefacts;

use drawing::Drawing;

/// What can go wrong with a figure.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// The bitmap backend refused.
    #[error("cannot paint a figure: {0}")]
    Paint(String),
    /// A picture's bytes do not fit its size.
    #[error("a picture of a figure has fewer pixels than its size says")]
    Picture,
    /// The PNG encoder refused.
    #[error("cannot encode a figure as PNG: {0}")]
    Encode(#[source] image::ImageError),
    /// The disk refused.
    #[error(transparent)]
    Store(#[from] store::Error),
}

impl Classify for Error {
    fn class(&self) -> Class {
        Class::Run
    }
}

/// A finished figure.
#[derive(Debug, Clone, PartialEq)]
pub struct Figure {
    /// File name without its ending, e.g. `figure_10`.
    pub name: String,
    /// Heading, e.g. `Figure 10. Optimisation history`.
    pub title: String,
    /// What it shows, in sentences.
    pub caption: String,
    /// The SVG document.
    pub svg: String,
    /// The PNG file.
    pub png: Vec<u8>,
}

/// One figure's name, heading, caption and content.
struct Plan {
    name: &'static str,
    title: &'static str,
    caption: String,
    drawing: Drawing,
}

/// Draws every figure of a run, in the order of the paper, then those that the paper does not have.
///
/// Where a run has no data for a figure, the figure says so in a sentence.
pub fn draw_all(run: &RunArtefacts) -> Result<Vec<Figure>, Error> {
    plans(run)
        .into_par_iter()
        .map(|Plan { name, title, caption, drawing }| {
            let svg = svg::render(&drawing, title)?;
            let png = png::render(&drawing)?;
            Ok(Figure { name: name.to_owned(), title: title.to_owned(), caption, svg, png })
        })
        .collect()
}

/// The figures with empty PNG files, for tests that look at pages.
#[cfg(test)]
pub(crate) fn draw_svg(run: &RunArtefacts) -> Vec<Figure> {
    let figure = |Plan { name, title, caption, drawing }: Plan| Figure {
        name: name.to_owned(),
        title: title.to_owned(),
        caption,
        svg: svg::render(&drawing, title).expect("fixtures are drawable"),
        png: Vec::new(),
    };
    plans(run).into_iter().map(figure).collect()
}

/// Writes `<name>.svg` and `<name>.png` of each figure to `dir`; gives the paths written.
pub fn write(dir: &Path, figures: &[Figure]) -> Result<Vec<PathBuf>, Error> {
    let mut paths = Vec::with_capacity(2 * figures.len());
    for figure in figures {
        for (ending, bytes) in [("svg", figure.svg.as_bytes()), ("png", figure.png.as_slice())] {
            let path = dir.join(format!("{}.{ending}", figure.name));
            store::write(&path, bytes)?;
            paths.push(path);
        }
    }
    Ok(paths)
}

fn plans(run: &RunArtefacts) -> Vec<Plan> {
    let plan = |name, title, (drawing, caption): (Drawing, String)| Plan { name, title, caption, drawing };
    vec![
        plan("figure_3", "Figure 3. Input panorama and views generated from it", gallery::grid(run)),
        plan("figure_4", "Figure 4. Views of the dataset", gallery::samples(run)),
        plan("figure_5", "Figure 5. The network of the tuned arm", network::draw(run)),
        plan("figure_6", "Figure 6. Flow of training", flow::training(run)),
        plan("figure_7", "Figure 7. Flow of activation", flow::activation(run)),
        plan("figure_10", "Figure 10. Optimisation history", history::draw(run)),
        plan("figure_11", "Figure 11. Importance of hyper-parameters", importance::draw(run)),
        plan("figure_12", "Figure 12. Errors of distortion ξ", errors::metrics(run, Quantity::Xi)),
        plan("figure_13", "Figure 13. Error reduction, distortion ξ", errors::reductions(run, Quantity::Xi)),
        plan("figure_14", "Figure 14. Errors of focal length f", errors::metrics(run, Quantity::FocalPx)),
        plan("figure_15", "Figure 15. Error reduction, focal length f", errors::reductions(run, Quantity::FocalPx)),
        plan("loss_curves", "Loss curves of the refits", curves::losses(run)),
        plan("trial_curves", "Intermediate values of the trials", curves::trials(run)),
        plan("scatter_f", "Predicted against true focal length f", scatter::draw(run, Quantity::FocalPx)),
        plan("scatter_xi", "Predicted against true distortion ξ", scatter::draw(run, Quantity::Xi)),
    ]
}

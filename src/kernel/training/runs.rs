//! Rows of pixels cut into runs for which the same taps of a window are in place.

use std::cell::RefCell;

use super::windows::Axis;
use crate::kernel::map::{Shape, View, Window};

/// A pixel of other maps that has a part in a pixel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Term {
    /// Counted over all images.
    pub pixel: usize,
    /// The tap of the window that connects them.
    pub tap: usize,
    /// Taps of that window that are inside the image.
    pub inside: usize,
}

/// Some pixels of a row, with the terms of the first of them.
#[derive(Debug, Clone, Copy)]
pub(super) struct Run<'a> {
    /// Column of the first pixel.
    pub first: usize,
    pub pixels: usize,
    /// Columns from a pixel to the next.
    pub step: usize,
    /// In the order in which they are summed.
    pub terms: &'a [Term],
    /// Pixels from a term to that of the next pixel.
    pub term_step: usize,
}

impl<'a> Run<'a> {
    /// The values of a term in `maps`, from the run's first pixel to its last.
    pub fn values(&self, maps: View<'a>, term: &Term) -> &'a [f32] {
        let len = (self.pixels - 1) * self.term_step * maps.stride + maps.shape.channels;
        &maps.data[term.pixel * maps.stride..][..len]
    }
}

/// A term along one axis.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct AxisTerm {
    index: usize,
    tap: usize,
    inside: usize,
}

struct AxisRun {
    first: usize,
    count: usize,
    terms: Vec<AxisTerm>,
}

/// The runs of all rows of maps.
pub(super) struct Runs {
    /// Terms of each row of an image.
    rows: Vec<Vec<AxisTerm>>,
    columns: Vec<AxisRun>,
    step: usize,
    term_step: usize,
    /// Height and width of the terms' maps.
    terms: (usize, usize),
    window: Window,
}

impl Runs {
    /// Runs of outputs; their terms are the inputs under their windows, in the order of taps.
    pub fn forward(window: Window, x: Shape, out: Shape) -> Self {
        let (rows, columns) = Axis::both(window, out);
        let under = |axis: Axis, size: usize| {
            move |place: usize| {
                let range = axis.inside(place, size);
                let inside = range.len();
                let term = |index| AxisTerm { index, tap: index + axis.pad - place * axis.stride, inside };
                range.map(term).collect::<Vec<_>>()
            }
        };
        Self {
            rows: (0..out.height).map(under(rows, x.height)).collect(),
            columns: runs(out.width, 1, under(columns, x.width)),
            step: 1,
            term_step: window.stride,
            terms: (x.height, x.width),
            window,
        }
    }

    /// Runs of inputs; their terms are the outputs whose windows cover them, in the order of outputs.
    pub fn backward(window: Window, x: Shape, out: Shape) -> Self {
        let (rows, columns) = Axis::both(window, out);
        let over = |axis: Axis, size: usize| {
            move |i: usize| {
                let term = |(index, tap)| AxisTerm { index, tap, inside: axis.inside(index, size).len() };
                axis.covering(i).map(term).collect::<Vec<_>>()
            }
        };
        Self {
            rows: (0..x.height).map(over(rows, x.height)).collect(),
            columns: runs(x.width, window.stride, over(columns, x.width)),
            step: window.stride,
            term_step: 1,
            terms: (out.height, out.width),
            window,
        }
    }

    /// Calls `f` for all runs of row `row`, counted over all images. A thread keeps the memory of their terms.
    pub fn of_row(&self, row: usize, mut f: impl FnMut(Run)) {
        thread_local! {
            static TERMS: RefCell<Vec<Term>> = const { RefCell::new(Vec::new()) };
        }
        TERMS.with_borrow_mut(|terms| self.of_row_with(row, terms, &mut f));
    }

    fn of_row_with(&self, row: usize, terms: &mut Vec<Term>, f: &mut impl FnMut(Run)) {
        let first_row = row / self.rows.len() * self.terms.0;
        for columns in &self.columns {
            terms.clear();
            for y in &self.rows[row % self.rows.len()] {
                terms.extend(columns.terms.iter().map(|x| Term {
                    pixel: (first_row + y.index) * self.terms.1 + x.index,
                    tap: y.tap * self.window.width + x.tap,
                    inside: y.inside * x.inside,
                }));
            }
            f(Run { first: columns.first, pixels: columns.count, step: self.step, terms, term_step: self.term_step });
        }
    }
}

/// Puts each index below `count` with the one `step` before it, if their terms are the same taps.
fn runs(count: usize, step: usize, terms: impl Fn(usize) -> Vec<AxisTerm>) -> Vec<AxisRun> {
    let mut runs: Vec<AxisRun> = Vec::new();
    let alike =
        |a: &[AxisTerm], b: &[AxisTerm]| a.iter().map(|t| (t.tap, t.inside)).eq(b.iter().map(|t| (t.tap, t.inside)));
    for phase in 0..step.min(count) {
        let begin = runs.len();
        for i in (phase..count).step_by(step) {
            let terms = terms(i);
            match runs[begin..].last_mut() {
                Some(run) if alike(&run.terms, &terms) => run.count += 1,
                _ => runs.push(AxisRun { first: i, count: 1, terms }),
            }
        }
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::super::testing::{each_pair, window};
    use super::*;
    use proptest::prelude::*;

    /// All pairs of a pixel and a term, from the runs of all rows.
    fn pairs(runs: &Runs, shape: Shape) -> Vec<(usize, Term)> {
        let mut pairs = Vec::new();
        for row in 0..shape.images * shape.height {
            runs.of_row(row, |run| {
                for i in 0..run.pixels {
                    let pixel = row * shape.width + run.first + i * run.step;
                    let shift = |t: &Term| Term { pixel: t.pixel + i * run.term_step, ..*t };
                    pairs.extend(run.terms.iter().map(|t| (pixel, shift(t))));
                }
            });
        }
        // the sort keeps the order of a pixel's terms
        pairs.sort_by_key(|(pixel, _)| *pixel);
        pairs
    }

    proptest! {
        #[test]
        fn runs_hold_every_pair_of_an_input_and_an_output_in_order((window, x, out) in window()) {
            let (mut forward, mut backward) = (Vec::new(), Vec::new());
            let mut inside = vec![0; out.pixels()];
            each_pair(x, window, out, |_, to, _| inside[to] += 1);
            each_pair(x, window, out, |from, to, tap| {
                forward.push((to, Term { pixel: from, tap, inside: inside[to] }));
                backward.push((from, Term { pixel: to, tap, inside: inside[to] }));
            });
            backward.sort_by_key(|(pixel, _)| *pixel);
            prop_assert_eq!(pairs(&Runs::forward(window, x, out), out), forward);
            prop_assert_eq!(pairs(&Runs::backward(window, x, out), x), backward);
        }
    }
}

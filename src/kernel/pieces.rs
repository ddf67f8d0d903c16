//! The parts in which a window is summed over.

/// Depth of a piece: its widest panel of weights stays in the second-level cache, from where it is read as fast as it is
/// needed; the deeper, the seldomer sums are put aside.
const DEPTH: usize = 1024;

/// A part of the window that one pass sums over.
pub(super) struct Piece {
    pub run: usize,
    pub runs: usize,
    pub offset: usize,
    pub len: usize,
}

/// Cuts `runs` runs of `len` floats into pieces of about [`DEPTH`], in order; at least one, which ends a sum of nothing.
pub(super) fn pieces(runs: usize, len: usize) -> Vec<Piece> {
    if runs == 0 {
        return vec![Piece { run: 0, runs: 0, offset: 0, len }];
    }
    if len <= DEPTH {
        let step = DEPTH / len;
        return (0..runs).step_by(step).map(|run| Piece { run, runs: step.min(runs - run), offset: 0, len }).collect();
    }
    let step = len.div_ceil(len.div_ceil(DEPTH));
    let cut =
        |run| (0..len).step_by(step).map(move |offset| Piece { run, runs: 1, offset, len: step.min(len - offset) });
    (0..runs).flat_map(cut).collect()
}

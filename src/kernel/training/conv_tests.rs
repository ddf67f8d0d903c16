use proptest::prelude::*;

use super::testing::{Maps, close, each_pair, norm_of, on_pools, supported, taken_while_writing, values, window};
use super::{GradientSums, Moments, Scratch, TrainableConv};
use crate::kernel::{Isa, Pad, Shape, Window};

/// Output, gradient by the input and gradient by the weights, each as its chain of fused multiply-adds and in f64.
struct Naive {
    chains: [Vec<f32>; 3],
    exact: [Vec<f64>; 3],
}

/// The definitions; a chain's terms come in the order of output pixels, taps, inputs and outputs.
fn naive(window: Window, [x, dy, w]: [&[f32]; 3], x_shape: Shape, out: Shape, start: [&[f32]; 3]) -> Naive {
    let mut chains = start.map(<[f32]>::to_vec);
    let mut exact = start.map(|s| s.iter().map(|v| f64::from(*v)).collect::<Vec<_>>());
    let (inputs, outputs) = (x_shape.channels, out.channels);
    each_pair(x_shape, window, out, |from, to, tap| {
        for i in 0..inputs {
            for o in 0..outputs {
                let at = [to * outputs + o, from * inputs + i, (tap * inputs + i) * outputs + o];
                let terms = [(x[at[1]], w[at[2]]), (dy[at[0]], w[at[2]]), (x[at[1]], dy[at[0]])];
                for (k, (a, b)) in terms.into_iter().enumerate() {
                    chains[k][at[k]] = a.mul_add(b, chains[k][at[k]]);
                    exact[k][at[k]] += f64::from(a) * f64::from(b);
                }
            }
        }
    });
    Naive { chains, exact }
}

/// Checks all three results, on all instruction sets and pools, against the chains.
fn check(window: Window, x_shape: Shape, out: Shape, gaps: (usize, usize), accumulate: bool) {
    let (inputs, outputs) = (x_shape.channels, out.channels);
    let conv = TrainableConv::with_isa(Isa::Portable, window, inputs, outputs);
    let dense = [values(x_shape.len(), 1), values(out.len(), 2), values(conv.weights(), 3)];
    let [x, dy, w] = dense.each_ref().map(|v| v.as_slice());
    let mut before = [vec![0.0; out.len()], vec![0.0; x_shape.len()], vec![0.0; w.len()]];
    if accumulate {
        before[1..].clone_from_slice(&[values(x_shape.len(), 4), values(w.len(), 5)]);
    }
    let naive = naive(window, [x, dy, w], x_shape, out, before.each_ref().map(|v| v.as_slice()));
    for k in 0..3 {
        assert!(close(&naive.chains[k], &naive.exact[k]));
    }
    let (x, dy) = (Maps::new(x, x_shape, gaps.0), Maps::new(dy, out, gaps.1));
    for isa in supported() {
        let conv = TrainableConv::with_isa(isa, window, inputs, outputs);
        let results = on_pools(|| {
            let mut scratch = Scratch::default();
            let mut y = Maps::new(&vec![f32::NAN; out.len()], out, gaps.1);
            conv.forward(x.view(), w, y.view_mut(), &mut Moments::default(), &mut scratch);
            let begin = |before: &Vec<f32>| if accumulate { before.clone() } else { vec![f32::NAN; before.len()] };
            let mut dx = Maps::new(&begin(&before[1]), x_shape, gaps.0);
            conv.by_input(dy.view(), w, dx.view_mut(), accumulate, None, &mut scratch);
            let mut dw = begin(&before[2]);
            conv.by_weights(x.view(), dy.view(), &mut dw, accumulate, &mut scratch);
            [y.dense(), dx.dense(), dw]
        });
        for result in results {
            for (k, values) in result.iter().enumerate() {
                assert!(*values == naive.chains[k], "{isa:?}, result {k} of {window:?} on {x_shape:?}");
            }
        }
    }
}

#[test]
fn many_blocks_of_whole_tiles_do_not_reach_past_the_last_pixel() {
    let shape = Shape { images: 8, height: 28, width: 28, channels: 1 };
    check(Window::square(1, 1), shape, shape, (0, 0), false);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_convolution_and_its_gradients_are_their_chains_with_any_instruction_set_and_threads(
        (window, x_shape, out) in window(), inputs in prop_oneof![1usize..10, Just(40)],
        outputs in prop_oneof![1usize..20, Just(70)], gaps in (0usize..3, 0usize..3), accumulate: bool,
    ) {
        check(window, Shape { channels: inputs, ..x_shape }, Shape { channels: outputs, ..out }, gaps, accumulate);
    }
}

#[test]
fn so_are_those_of_deep_weights_many_pixels_and_few_channels() {
    let padded = Window { pad: Pad { top: 0, left: 1, bottom: 1, right: 1 }, ..Window::square(3, 2) };
    for (window, (height, width), inputs, outputs) in [
        (Window::square(1, 1), (3, 5), 1100, 1030),
        (Window::square(1, 1), (19, 23), 20, 9),
        (padded, (41, 37), 10, 50),
        // rows of the window are contiguous in memory
        (Window::square(3, 2), (31, 45), 3, 40),
        (Window::square(7, 2), (23, 21), 3, 5),
        (Window { pad: Pad::symmetric(3, 3), ..Window::square(7, 2) }, (23, 22), 3, 20),
    ] {
        let (oh, ow) = window.output(height, width).unwrap();
        let x = Shape { images: 2, height, width, channels: inputs };
        check(window, x, Shape { height: oh, width: ow, channels: outputs, ..x }, (0, 1), true);
    }
}

#[test]
fn moments_and_sums_taken_while_writing_are_those_of_what_was_written() {
    let padded = Window { pad: Pad::symmetric(1, 1), ..Window::square(3, 1) };
    for (window, gap) in [(Window::square(1, 1), 0), (padded, 3), (Window::square(1, 2), 0)] {
        let x_shape = Shape { images: 3, height: 37, width: 41, channels: 20 };
        let (height, width) = window.output(37, 41).unwrap();
        let out = Shape { images: 3, height, width, channels: 70 };
        let conv = |isa| TrainableConv::with_isa(isa, window, 20, 70);
        let weights = values(conv(Isa::Portable).weights(), 3);
        let x = Maps::new(&values(x_shape.len(), 1), x_shape, gap);
        let dy = Maps::new(&values(out.len(), 2), out, 0);
        let vector = values(20, 4);
        let norm = norm_of(x.view(), &vector);
        for isa in supported() {
            on_pools(|| {
                let (mut scratch, mut taken) = (Scratch::default(), (Moments::default(), GradientSums::default()));
                let mut y = Maps::new(&vec![f32::NAN; out.len()], out, gap);
                conv(isa).forward(x.view(), &weights, y.view_mut(), &mut taken.0, &mut scratch);
                let mut dx = Maps::new(&values(x_shape.len(), 5), x_shape, gap);
                let sums = Some((&norm, &mut taken.1));
                conv(isa).by_input(dy.view(), &weights, dx.view_mut(), true, sums, &mut scratch);
                taken_while_writing(isa, y.view(), dx.view(), &norm, &taken);
            });
        }
    }
}

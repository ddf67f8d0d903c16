//! Depthwise convolutions and pools.

use proptest::prelude::*;

use super::testing::{Maps, close, each_pair, norm_of, on_pools, supported, taken_while_writing, values, window};
use super::{
    GradientSums, Moments, Scratch, TrainableDepthwise, average_pool_gradient, max_pool_gradient, max_pool_with_winners,
};
use crate::kernel::{Isa, Pad, Shape, View, Window, average_pool};

fn exact(values: &[f32]) -> Vec<f64> {
    values.iter().map(|v| f64::from(*v)).collect()
}

/// What accumulating calls begin with, and others overwrite.
fn begin(shape: Shape, accumulate: bool, index: u64) -> (Vec<f32>, Vec<f32>) {
    let before = if accumulate { values(shape.len(), index) } else { vec![0.0; shape.len()] };
    (before.clone(), if accumulate { before } else { vec![f32::NAN; shape.len()] })
}

fn depthwise_results(
    isa: Isa,
    window: Window,
    [x, dy]: [&Maps; 2],
    w: &[f32],
    [dx, dw]: [&[f32]; 2],
    accumulate: bool,
) -> Vec<[Vec<f32>; 3]> {
    let conv = TrainableDepthwise::with_isa(isa, window, x.shape.channels);
    on_pools(|| {
        let mut y = Maps::new(&vec![f32::NAN; dy.shape.len()], dy.shape, 1);
        conv.forward(x.view(), w, y.view_mut(), &mut Moments::default());
        let mut dx = Maps::new(dx, x.shape, 2);
        conv.by_input(dy.view(), w, dx.view_mut(), accumulate, None);
        let mut dw = dw.to_vec();
        conv.by_weights(x.view(), dy.view(), &mut dw, accumulate, &mut Scratch::default());
        [y.dense(), dx.dense(), dw]
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]
    #[test]
    fn a_depthwise_convolution_and_its_gradients_are_their_definitions(
        (window, x_shape, out) in window(), channels in 1usize..40, gaps in (0usize..3, 0usize..3), accumulate: bool,
    ) {
        let (x_shape, out) = (Shape { channels, ..x_shape }, Shape { channels, ..out });
        let taps = Shape { images: 1, height: window.height, width: window.width, channels };
        let (x, dy, w) = (values(x_shape.len(), 1), values(out.len(), 2), values(taps.len(), 3));
        let (dx_before, dx) = begin(x_shape, accumulate, 4);
        let (dw_before, dw) = begin(taps, accumulate, 5);
        let mut chains = [vec![0.0; out.len()], dx_before];
        let mut dw_exact = exact(&dw_before);
        each_pair(x_shape, window, out, |from, to, tap| {
            for c in 0..channels {
                let [x_at, y_at, w_at] = [from, to, tap].map(|p| p * channels + c);
                chains[0][y_at] = x[x_at].mul_add(w[w_at], chains[0][y_at]);
                chains[1][x_at] = dy[y_at].mul_add(w[w_at], chains[1][x_at]);
                dw_exact[w_at] += f64::from(x[x_at]) * f64::from(dy[y_at]);
            }
        });
        let (x, dy) = (Maps::new(&x, x_shape, gaps.0), Maps::new(&dy, out, gaps.1));
        let first = depthwise_results(Isa::Portable, window, [&x, &dy], &w, [&dx, &dw], accumulate).swap_remove(0);
        prop_assert_eq!(&first[..2], &chains);
        prop_assert!(close(&first[2], &dw_exact));
        for isa in supported() {
            for result in depthwise_results(isa, window, [&x, &dy], &w, [&dx, &dw], accumulate) {
                prop_assert_eq!(&result, &first, "{:?}", isa);
            }
        }
    }

    #[test]
    fn a_maximum_goes_to_the_first_of_equals_and_its_gradient_comes_back_there(
        (window, x_shape, out) in window(), channels in 1usize..40, gaps in (0usize..3, 0usize..3), accumulate: bool,
        levels in 1u8..30,
    ) {
        let (x_shape, out) = (Shape { channels, ..x_shape }, Shape { channels, ..out });
        // few different values, so that many are equal
        let x: Vec<f32> = values(x_shape.len(), 1).iter().map(|v| (v * f32::from(levels)).round()).collect();
        let dy = values(out.len(), 2);
        let (mut dx_expected, dx) = begin(x_shape, accumulate, 3);
        let (mut best, mut winners) = (vec![f32::NEG_INFINITY; out.len()], vec![255; out.len()]);
        let mut from_whom = vec![None; out.len()];
        each_pair(x_shape, window, out, |from, to, tap| {
            for c in 0..channels {
                let (value, at) = (x[from * channels + c], to * channels + c);
                if value > best[at] {
                    (best[at], winners[at], from_whom[at]) = (value, tap as u8, Some(from * channels + c));
                }
            }
        });
        for (from, gradient) in from_whom.iter().zip(&dy) {
            if let Some(from) = from {
                dx_expected[*from] += gradient;
            }
        }
        let (x, dy) = (Maps::new(&x, x_shape, gaps.0), Maps::new(&dy, out, gaps.1));
        for isa in supported() {
            let results = on_pools(|| {
                let mut y = Maps::new(&vec![f32::NAN; out.len()], out, gaps.1);
                let mut won = vec![0; out.len()];
                max_pool_with_winners(isa, window, x.view(), y.view_mut(), &mut won);
                let mut dx = Maps::new(&dx, x_shape, gaps.0);
                max_pool_gradient(isa, window, dy.view(), &won, dx.view_mut(), accumulate);
                (y.dense(), won, dx.dense())
            });
            for result in results {
                prop_assert_eq!(&result, &(best.clone(), winners.clone(), dx_expected.clone()), "{:?}", isa);
            }
        }
    }

    #[test]
    fn the_gradient_of_an_average_is_the_transpose_of_the_average(
        (window, x_shape, out) in window(), channels in 1usize..40, gap in 0usize..3, accumulate: bool, counts_outside: bool,
    ) {
        let (x_shape, out) = (Shape { channels, ..x_shape }, Shape { channels, ..out });
        let dy = values(out.len(), 2);
        let (before, dx) = begin(x_shape, accumulate, 3);
        // the average of each unit vector is a column of its matrix; channels are alike, so units of pixels will do
        let mut expected = exact(&before);
        for p in 0..x_shape.pixels() {
            let one = Shape { channels: 1, ..x_shape };
            let mut unit = vec![0.0; one.len()];
            unit[p] = 1.0;
            let one_out = Shape { channels: 1, ..out };
            let mut column = Maps::new(&vec![0.0; one_out.len()], one_out, 0);
            average_pool(Isa::Portable, window, counts_outside, View::new(&unit, one, 1), column.view_mut());
            for (q, share) in column.data.iter().enumerate() {
                for c in 0..channels {
                    expected[p * channels + c] += f64::from(*share) * f64::from(dy[q * channels + c]);
                }
            }
        }
        let dy = Maps::new(&dy, out, gap);
        let mut first: Option<Vec<f32>> = None;
        for isa in supported() {
            let results = on_pools(|| {
                let mut dx = Maps::new(&dx, x_shape, gap);
                average_pool_gradient(isa, window, counts_outside, dy.view(), dx.view_mut(), accumulate);
                dx.dense()
            });
            for result in results {
                prop_assert!(close(&result, &expected));
                prop_assert_eq!(first.get_or_insert_with(|| result.clone()), &result, "{:?}", isa);
            }
        }
    }
}

#[test]
fn moments_and_sums_taken_while_writing_are_those_of_what_was_written() {
    for (width, stride, channels, gap) in [(32, 1, 33, 0), (29, 1, 48, 2), (64, 2, 16, 0)] {
        let window = Window { pad: Pad::symmetric(1, 1), ..Window::square(3, stride) };
        let shape = Shape { images: 2, height: 80, width, channels };
        let (height, width) = window.output(shape.height, width).unwrap();
        let out = Shape { height, width, ..shape };
        let (x, dy) = (Maps::new(&values(shape.len(), 1), shape, gap), Maps::new(&values(out.len(), 2), out, 0));
        let (weights, vector) = (values(9 * channels, 3), values(channels, 4));
        let norm = norm_of(x.view(), &vector);
        for isa in supported() {
            let conv = TrainableDepthwise::with_isa(isa, window, channels);
            on_pools(|| {
                let mut taken = (Moments::default(), GradientSums::default());
                let mut y = Maps::new(&vec![f32::NAN; out.len()], out, gap);
                conv.forward(x.view(), &weights, y.view_mut(), &mut taken.0);
                let mut dx = Maps::new(&values(shape.len(), 5), shape, gap);
                conv.by_input(dy.view(), &weights, dx.view_mut(), true, Some((&norm, &mut taken.1)));
                taken_while_writing(isa, y.view(), dx.view(), &norm, &taken);
            });
        }
    }
}

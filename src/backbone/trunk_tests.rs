//! A step through a graph against the same graph written naively in f64, and its finite differences.

use super::description::Padding;
use super::graph::{Action, Activation, Builder, Form, Graph, Layer};
use super::parameters::Parameters;
use super::trunk::Trunk;
use crate::kernel::{Pad, Window};
use crate::rng::stream;

const EPSILON: f32 = 1e-3;
const IMAGES: usize = 3;

fn form(outputs: usize, kernel: (usize, usize), stride: usize, padding: Padding) -> Form {
    Form { outputs, kernel, stride, padding, activation: Activation::Relu }
}

/// Branches that are joined, pools of both kinds, a stem whose border is part of the input.
fn branching() -> Graph {
    let mut net = Builder::new(12, Pad { top: 1, left: 1, bottom: 0, right: 0 });
    net.average_counts_padding(false);
    let x = net.conv(("stem", "stem_bn"), 0, form(6, (3, 3), 2, Padding::Valid));
    net.tap("stem", x);
    let joined = net.joined(x, 1, 5 + 4 + 3);
    net.conv_into(("a", "a_bn"), x, form(5, (1, 1), 1, Padding::Symmetric), joined, 0);
    let b = net.conv(("b1", "b1_bn"), x, form(4, (1, 3), 1, Padding::Symmetric));
    net.conv_into(("b2", "b2_bn"), b, form(4, (3, 1), 1, Padding::Symmetric), joined, 5);
    let pooled = net.average_pool(x);
    net.conv_into(("c", "c_bn"), pooled, form(3, (1, 1), 1, Padding::Symmetric), joined, 9);
    let half = net.joined(joined, 2, 4 + 12);
    net.conv_into(("d", "d_bn"), joined, form(4, (3, 3), 2, Padding::Valid), half, 0);
    net.max_pool_into(joined, half, 4);
    net.tap("half", half);
    net.finish().unwrap()
}

/// Sums with and without a projection, and a padded maximum.
fn residual() -> Graph {
    let mut net = Builder::new(11, Pad { top: 1, left: 1, bottom: 1, right: 1 });
    let x = net.conv(("stem", "stem_bn"), 0, form(4, (3, 3), 1, Padding::Valid));
    let x = net.max_pool(x, 3, 2, Padding::Symmetric);
    let a = net.conv(("a", "a_bn"), x, form(3, (3, 3), 1, Padding::Symmetric));
    net.conv_onto(("b", "b_bn"), a, form(4, (1, 1), 1, Padding::Symmetric), x);
    net.tap("first", x);
    let c = net.conv(("c", "c_bn"), x, form(3, (3, 3), 2, Padding::Symmetric));
    let plain = Form { activation: Activation::None, ..form(6, (1, 1), 2, Padding::Symmetric) };
    let shortcut = net.conv(("p", "p_bn"), x, plain);
    net.conv_onto(("d", "d_bn"), c, form(6, (1, 1), 1, Padding::Symmetric), shortcut);
    net.tap("second", shortcut);
    net.finish().unwrap()
}

/// Channels apart, with a bounded activation and asymmetric padding.
fn separable() -> Graph {
    let mut net = Builder::new(10, Pad::default());
    let bounded = |f: Form| Form { activation: Activation::Relu6, ..f };
    let x = net.conv(("stem", "stem_bn"), 0, bounded(form(5, (3, 3), 1, Padding::Valid)));
    let x = net.depthwise(("dw1", "dw1_bn"), x, bounded(form(5, (3, 3), 1, Padding::Symmetric)));
    let x = net.conv(("pw1", "pw1_bn"), x, bounded(form(7, (1, 1), 1, Padding::Valid)));
    let x = net.depthwise(("dw2", "dw2_bn"), x, bounded(form(7, (3, 3), 2, Padding::Same)));
    let x = net.conv(("pw2", "pw2_bn"), x, bounded(form(4, (1, 1), 1, Padding::Valid)));
    net.tap("last", x);
    net.finish().unwrap()
}

fn draws(n: usize, purpose: &str) -> Vec<f32> {
    let mut s = stream(12, "test", &[], purpose);
    (0..n).map(|_| s.normal() as f32).collect()
}

/// A trunk on `graph` with parameters that are no round numbers, and inputs for it.
fn trunk(graph: &Graph) -> (Trunk, Vec<f32>, Vec<f32>) {
    let layers: Vec<Parameters> =
        graph.layers.iter().enumerate().map(|(i, layer)| Parameters::seeded(layer, 5, i)).collect();
    let (trunk, mut parameters) = Trunk::new(graph.clone(), &layers, EPSILON, 0);
    for span in &trunk.spans {
        for range in [&span.scale, &span.shift] {
            parameters[range.clone()].iter_mut().zip(draws(range.len(), "norm")).for_each(|(p, d)| *p += 0.3 * d);
        }
    }
    let input = draws(IMAGES * trunk.input_len(), "input");
    (trunk, parameters, input)
}

/// Places of a window in a row or column: for each, the first pixel, which may lie outside.
fn places(size: usize, before: usize, window: usize, stride: usize, after: usize) -> Vec<isize> {
    let count = (size + before + after - window) / stride + 1;
    (0..count).map(|i| (i * stride) as isize - before as isize).collect()
}

/// Every image's map under each place of a window: `(output pixel, tap, input pixel)`, taps outside left out.
fn windows(window: &Window, height: usize, width: usize) -> (usize, Vec<Vec<(usize, usize)>>) {
    let rows = places(height, window.pad.top, window.height, window.stride, window.pad.bottom);
    let columns = places(width, window.pad.left, window.width, window.stride, window.pad.right);
    let inside = |y: isize, x: isize| (0..height as isize).contains(&y) && (0..width as isize).contains(&x);
    let mut all = Vec::new();
    for y in &rows {
        for x in &columns {
            let taps = (0..window.height * window.width).filter_map(|t| {
                let (yy, xx) = (y + (t / window.width) as isize, x + (t % window.width) as isize);
                inside(yy, xx).then(|| (t, yy as usize * width + xx as usize))
            });
            all.push(taps.collect());
        }
    }
    (columns.len(), all)
}

/// The features of `input` in f64; each layer's (weights, scale, shift) stand one after the other in `parameters`.
fn reference(graph: &Graph, trunk: &Trunk, parameters: &[f64], input: &[f32]) -> Vec<f64> {
    let mut maps: Vec<Vec<f64>> =
        graph.maps.iter().map(|m| vec![0.0; IMAGES * m.height * m.width * m.channels]).collect();
    maps[0] = input.iter().map(|v| f64::from(*v)).collect();
    let mut features = vec![Vec::new(); graph.taps.len()];
    for (i, step) in graph.steps.iter().enumerate() {
        let (from, to) = (graph.maps[step.input], graph.maps[step.output]);
        let pixels = from.height * from.width;
        let pixel = |image: usize, p: usize| &maps[step.input][(image * pixels + p) * from.channels..][..from.channels];
        let (window, channels) = match step.action {
            Action::Layer(l) => (graph.layers[l].window, graph.layers[l].outputs),
            Action::MaxPool(window) | Action::AveragePool(window) => (window, from.channels),
        };
        let (_, places) = windows(&window, from.height, from.width);
        let mut out = Vec::new();
        for image in 0..IMAGES {
            for taps in &places {
                out.extend((0..channels).map(|c| match step.action {
                    Action::MaxPool(_) => taps.iter().map(|t| pixel(image, t.1)[c]).fold(f64::NEG_INFINITY, f64::max),
                    Action::AveragePool(_) => {
                        let all = window.height * window.width;
                        let count = if graph.average_counts_padding { all } else { taps.len() };
                        taps.iter().map(|t| pixel(image, t.1)[c]).sum::<f64>() / count as f64
                    }
                    Action::Layer(l) => {
                        let layer = &graph.layers[l];
                        let w = &parameters[trunk.spans[l].weights.clone()];
                        taps.iter().map(|t| sum(layer, w, t.0, pixel(image, t.1), c)).sum()
                    }
                }));
            }
        }
        if let Action::Layer(l) = step.action {
            let (scale, shift) = (&parameters[trunk.spans[l].scale.clone()], &parameters[trunk.spans[l].shift.clone()]);
            normalise(&mut out, scale, shift);
        }
        for (p, values) in out.chunks_exact(channels).enumerate() {
            let target = &mut maps[step.output][p * to.channels + step.channel..][..channels];
            for (t, v) in target.iter_mut().zip(values) {
                let z = if step.accumulate { *t + v } else { *v };
                *t = match step.action {
                    Action::Layer(l) => {
                        graph.layers[l].activation.bounds().map_or(z, |(a, b)| z.clamp(a.into(), b.into()))
                    }
                    _ => z,
                };
            }
        }
        for (tap, own) in graph.taps.iter().zip(&mut features).filter(|(t, _)| t.steps == i + 1) {
            let map = graph.maps[tap.map];
            let pixels = map.height * map.width;
            *own = maps[tap.map]
                .chunks_exact(pixels * map.channels)
                .map(|image| {
                    let mean = |c: usize| image.iter().skip(c).step_by(map.channels).sum::<f64>() / pixels as f64;
                    (0..map.channels).map(mean).collect::<Vec<f64>>()
                })
                .collect();
        }
    }
    (0..IMAGES).flat_map(|image| features.iter().flat_map(move |f| f[image].clone())).collect()
}

fn sum(layer: &Layer, weights: &[f64], tap: usize, pixel: &[f64], output: usize) -> f64 {
    if layer.depthwise {
        return pixel[output] * weights[tap * layer.outputs + output];
    }
    let weight = |i: usize| weights[(tap * layer.inputs + i) * layer.outputs + output];
    pixel.iter().enumerate().map(|(i, x)| x * weight(i)).sum()
}

fn normalise(z: &mut [f64], scale: &[f64], shift: &[f64]) {
    let channels = scale.len();
    let n = (z.len() / channels) as f64;
    for c in 0..channels {
        let mean = z.iter().skip(c).step_by(channels).sum::<f64>() / n;
        let variance = z.iter().skip(c).step_by(channels).map(|v| (v - mean).powi(2)).sum::<f64>() / n;
        for v in z.iter_mut().skip(c).step_by(channels) {
            *v = scale[c] * (*v - mean) / (variance + f64::from(EPSILON)).sqrt() + shift[c];
        }
    }
}

fn run(trunk: &mut Trunk, parameters: &[f32], input: &[f32]) -> Vec<f32> {
    trunk.begin(IMAGES).copy_from_slice(input);
    trunk.forward(parameters)
}

#[test]
fn features_and_gradients_are_those_of_a_naive_network_in_f64() {
    for (name, graph) in [("branching", branching()), ("residual", residual()), ("separable", separable())] {
        let (mut trunk, parameters, input) = trunk(&graph);
        let features = run(&mut trunk, &parameters, &input);
        let exact: Vec<f64> = parameters.iter().map(|p| f64::from(*p)).collect();
        let expected = reference(&graph, &trunk, &exact, &input);
        assert_eq!(features.len(), expected.len());
        for (f, e) in features.iter().zip(&expected) {
            assert!((f64::from(*f) - e).abs() < 2e-5, "{name}: {f} {e}");
        }
        // the loss is a fixed weighted sum of the features
        let factors = draws(features.len(), "factors");
        trunk.backward(&parameters, &factors, true);
        let loss = |p: &[f64]| -> f64 {
            let features = reference(&graph, &trunk, p, &input);
            features.iter().zip(&factors).map(|(f, c)| f * f64::from(*c)).sum()
        };
        for (layer, span) in graph.layers.iter().zip(&trunk.spans) {
            for range in [&span.weights, &span.scale, &span.shift] {
                let largest = trunk.gradient[range.clone()].iter().fold(0.0f32, |m, g| m.max(g.abs()));
                assert!(largest > 1e-4, "{name} {}: no gradient", layer.conv);
                for i in range.clone().step_by(range.len().div_ceil(12)) {
                    let at = |h: f64| {
                        let mut moved = exact.clone();
                        moved[i] += h;
                        loss(&moved)
                    };
                    let difference = (at(1e-6) - at(-1e-6)) / 2e-6;
                    let error = (f64::from(trunk.gradient[i]) - difference).abs();
                    assert!(error < 1e-3 * f64::from(largest), "{name} {} {i}: {error} of {largest}", layer.conv);
                }
            }
        }
    }
}

#[test]
fn gradients_of_parts_add_up_and_threads_do_not_matter() {
    for graph in [branching(), residual(), separable()] {
        let mut seen: Vec<Vec<u32>> = Vec::new();
        for threads in [1, 2, 3, 4] {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let bits = pool.install(|| {
                let (mut trunk, parameters, input) = trunk(&graph);
                let features = run(&mut trunk, &parameters, &input);
                let factors = draws(features.len(), "factors");
                trunk.backward(&parameters, &factors, true);
                let once = trunk.gradient.clone();
                run(&mut trunk, &parameters, &input);
                trunk.backward(&parameters, &factors, false);
                for (twice, once) in trunk.gradient.iter().zip(&once) {
                    assert!((twice - 2.0 * once).abs() <= 1e-5 * (1.0 + once.abs()), "{twice} {once}");
                }
                [features, once, trunk.running].concat().iter().map(|v| v.to_bits()).collect()
            });
            seen.push(bits);
        }
        assert!(seen.windows(2).all(|w| w[0] == w[1]));
    }
}

#[test]
fn running_statistics_come_to_those_of_a_repeated_batch() {
    let graph = residual();
    let (mut trunk, parameters, input) = trunk(&graph);
    for _ in 0..200 {
        run(&mut trunk, &parameters, &input);
    }
    // at rest with its running statistics the network gives the same features, up to the unbiased variance
    let moving = run(&mut trunk, &parameters, &input);
    let layers = trunk.layers(&parameters);
    let prepared = super::fold(&graph, &layers, EPSILON);
    let preprocessing = super::Variant::seeded(crate::config::spec::Architecture::Resnet50).preprocessing;
    let network = super::network::Network::new(graph, prepared, &preprocessing, 0);
    let mut rest = vec![0.0; moving.len()];
    network.features(super::network::Input::Maps(&input), &mut super::Workspace::default(), &mut rest);
    for (a, b) in moving.iter().zip(&rest) {
        assert!((a - b).abs() < 0.1 * (1.0 + a.abs()), "{a} {b}");
    }
}

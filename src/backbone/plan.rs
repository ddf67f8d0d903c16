//! A graph as training sees it: nothing is overwritten that the backward pass still needs.

use super::graph::{Action, Graph, Map, MapShape};

/// What one step makes: index into [`Plan::values`]. Value 0 is the input.
pub(super) type Value = usize;

/// One step of a plan: an action from one value to some channels of another.
#[derive(Debug, Clone, Copy)]
pub(super) struct PlannedStep {
    pub action: Action,
    pub input: Value,
    pub output: Value,
    /// First channel written.
    pub channel: usize,
    /// Added before the activation.
    pub added: Option<Value>,
}

/// A graph's steps, with a value of its own for each state of a map.
#[derive(Debug, Clone)]
pub(super) struct Plan {
    pub values: Vec<MapShape>,
    pub steps: Vec<PlannedStep>,
    /// For each step, the layer (its step and number) whose output has all of its gradient when this step's input has got its
    /// part.
    pub completes: Vec<Option<(usize, usize)>>,
    /// Value of each of the graph's taps.
    pub taps: Vec<Value>,
    /// Buffer in which each value's gradient is kept while it is needed; that of the input never is.
    pub gradient_of: Vec<usize>,
    /// Floats per image of each of those buffers.
    pub gradient_sizes: Vec<usize>,
}

impl Plan {
    pub(super) fn new(graph: &Graph) -> Self {
        let mut values = vec![graph.maps[0]];
        let mut value_of: Vec<Option<Value>> = vec![None; graph.maps.len()];
        value_of[0] = Some(0);
        let mut taps = vec![0; graph.taps.len()];
        note_taps(graph, 0, &value_of, &mut taps);
        let mut steps = Vec::with_capacity(graph.steps.len());
        for (i, step) in graph.steps.iter().enumerate() {
            let added = if step.accumulate { value_of[step.output] } else { None };
            let known = value_of[step.output].filter(|_| !step.accumulate);
            let output = known.unwrap_or_else(|| {
                values.push(graph.maps[step.output]);
                values.len() - 1
            });
            let input = value_of[step.input].unwrap_or_default();
            steps.push(PlannedStep { action: step.action, input, output, channel: step.channel, added });
            value_of[step.output] = Some(output);
            note_taps(graph, i + 1, &value_of, &mut taps);
        }
        let (gradient_of, gradient_sizes) = gradient_buffers(&values, &steps, &taps);
        Self { completes: completes(&steps), values, steps, taps, gradient_of, gradient_sizes }
    }
}

fn note_taps(graph: &Graph, steps: usize, value_of: &[Option<Value>], taps: &mut [Value]) {
    let map_value = |map: Map| value_of[map].unwrap_or_default();
    for (value, tap) in taps.iter_mut().zip(&graph.taps).filter(|(_, tap)| tap.steps == steps) {
        *value = map_value(tap.map);
    }
}

/// [`Plan::completes`]: going backwards, the first reader of a value comes last. Only one step may make the value.
fn completes(steps: &[PlannedStep]) -> Vec<Option<(usize, usize)>> {
    let of = |(i, step): (usize, &PlannedStep)| {
        let value = step.input;
        let reads = |step: &PlannedStep| step.input == value || step.added == Some(value);
        let mut makers = (0..i).filter(|m| steps[*m].output == value);
        let maker = makers.next()?;
        let Action::Layer(layer) = steps[maker].action else { return None };
        let alone = makers.next().is_none() && step.added != Some(value) && !steps[..i].iter().any(reads);
        alone.then_some((maker, layer))
    };
    steps.iter().enumerate().map(of).collect()
}

/// Gives each value's gradient a buffer such that gradients in use at the same time have different ones.
///
/// Going backwards, a gradient is in use from the first step that reads its value (or from the beginning, for a tap) to
/// the last step that writes it.
fn gradient_buffers(values: &[MapShape], steps: &[PlannedStep], taps: &[Value]) -> (Vec<usize>, Vec<usize>) {
    let mut first_written = vec![usize::MAX; values.len()];
    for (i, step) in steps.iter().enumerate().rev() {
        first_written[step.output] = i;
    }
    let mut buffer_of: Vec<Option<usize>> = vec![None; values.len()];
    let (mut sizes, mut free) = (Vec::new(), Vec::new());
    let mut begin = |value: Value, free: &mut Vec<usize>, buffer_of: &mut Vec<Option<usize>>| {
        if value != 0 && buffer_of[value].is_none() {
            let buffer = free.pop().unwrap_or(sizes.len());
            sizes.resize(sizes.len().max(buffer + 1), 0);
            let MapShape { height, width, channels } = values[value];
            sizes[buffer] = sizes[buffer].max(height * width * channels);
            buffer_of[value] = Some(buffer);
        }
    };
    for tap in taps {
        begin(*tap, &mut free, &mut buffer_of);
    }
    for (i, step) in steps.iter().enumerate().rev() {
        for value in [Some(step.input), step.added].into_iter().flatten() {
            begin(value, &mut free, &mut buffer_of);
        }
        if first_written[step.output] == i {
            free.extend(buffer_of[step.output]);
        }
    }
    (buffer_of.into_iter().map(Option::unwrap_or_default).collect(), sizes)
}

#[cfg(test)]
mod tests {
    use super::super::{Variant, graph_of};
    use super::*;
    use crate::config::spec::Architecture;

    fn plan(architecture: Architecture, side: usize, tap: &str) -> Plan {
        let graph = graph_of(architecture, side, &Variant::seeded(architecture)).unwrap();
        Plan::new(&graph.up_to(&[tap.to_owned()]).unwrap())
    }

    #[test]
    fn a_sum_is_a_value_of_its_own_and_its_terms_stay() {
        let plan = plan(Architecture::Resnet50, 32, "layer1");
        let sums: Vec<&PlannedStep> = plan.steps.iter().filter(|s| s.added.is_some()).collect();
        assert_eq!(sums.len(), 3);
        for sum in &sums {
            assert!(sum.added.is_some_and(|a| a != sum.output));
        }
        // the second block adds the first one's result, which its first layer also reads
        assert_eq!(sums[1].added, Some(sums[0].output));
        assert!(plan.steps.iter().any(|s| s.input == sums[0].output));
        assert_eq!(plan.taps, [sums[2].output]);
    }

    #[test]
    fn the_first_reader_of_a_layers_output_completes_its_gradient() {
        let plan = plan(Architecture::Resnet50, 32, "layer1");
        for (i, step) in plan.steps.iter().enumerate() {
            let mut readers =
                (0..).zip(&plan.steps).filter(|(_, s)| s.input == step.output || s.added == Some(step.output));
            let completed = plan.completes.iter().position(|c| c.is_some_and(|(maker, _)| maker == i));
            let first = readers.next().filter(|(_, reader)| reader.input == step.output);
            let expected = first.filter(|_| matches!(step.action, Action::Layer(_))).map(|(reader, _)| reader);
            assert_eq!(completed, expected, "step {i}");
        }
        // branches that are joined are made by several layers
        let plan = self::plan(Architecture::InceptionV3, 75, "mixed_5b");
        let joined = plan.steps.last().unwrap().output;
        let branches = (0..).zip(&plan.steps).filter(|(_, s)| s.output == joined).map(|(i, _)| i);
        assert!(branches.into_iter().all(|i: usize| !plan.completes.iter().flatten().any(|(maker, _)| *maker == i)));
    }

    #[test]
    fn gradients_in_use_together_have_different_buffers() {
        for (architecture, side, tap) in [
            (Architecture::InceptionV3, 75, "mixed_7c"),
            (Architecture::Resnet50, 32, "layer4"),
            (Architecture::MobilenetV1, 32, "block13"),
        ] {
            let plan = plan(architecture, side, tap);
            let mut owner: Vec<Option<Value>> = vec![None; plan.gradient_sizes.len()];
            owner[plan.gradient_of[plan.taps[0]]] = Some(plan.taps[0]);
            for (i, step) in plan.steps.iter().enumerate().rev() {
                assert_eq!(owner[plan.gradient_of[step.output]], Some(step.output), "{tap}: step {i}");
                for value in [Some(step.input), step.added].into_iter().flatten().filter(|v| *v != 0) {
                    let buffer = plan.gradient_of[value];
                    assert!(owner[buffer].is_none_or(|o| o == value), "{tap}: step {i}");
                    owner[buffer] = Some(value);
                }
                if !plan.steps[..i].iter().any(|s| s.output == step.output) {
                    owner[plan.gradient_of[step.output]] = None;
                }
            }
            let values: usize = plan.values.iter().map(|v| v.height * v.width * v.channels).sum();
            assert!(plan.gradient_sizes.iter().sum::<usize>() < values / 2, "{tap}: little is shared");
        }
    }
}

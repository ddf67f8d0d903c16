//! An architecture as a list of steps, without weights.

use super::description::Padding;
use crate::kernel::{Pad, Window};

/// What follows a layer's batch norm.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Activation {
    None,
    Relu,
    /// min(max(0, x), 6).
    Relu6,
}

impl Activation {
    /// Lowest and highest output.
    pub(super) fn bounds(self) -> Option<(f32, f32)> {
        match self {
            Activation::None => None,
            Activation::Relu => Some((0.0, f32::INFINITY)),
            Activation::Relu6 => Some((0.0, 6.0)),
        }
    }
}

/// A convolution with batch norm and activation.
#[derive(Debug, Clone)]
pub(super) struct Layer {
    /// Tensor `<conv>.weight` holds its weights.
    pub conv: String,
    /// Tensors `<norm>.weight`, `.bias`, `.running_mean`, `.running_var` hold its batch norm.
    pub norm: String,
    pub window: Window,
    pub inputs: usize,
    pub outputs: usize,
    /// Each channel has a window of its own.
    pub depthwise: bool,
    pub activation: Activation,
}

impl Layer {
    /// Shape of its weights in a file: outputs × inputs × rows × columns.
    pub(super) fn shape(&self) -> [usize; 4] {
        [self.outputs, if self.depthwise { 1 } else { self.inputs }, self.window.height, self.window.width]
    }

    /// Numbers that training would change: weights, and scale and shift of the batch norm.
    pub(super) fn parameters(&self) -> usize {
        self.shape().iter().product::<usize>() + 2 * self.outputs
    }
}

/// A feature map: index into [`Graph::maps`].
pub(super) type Map = usize;

/// Height, width and channels of a map of one image.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct MapShape {
    pub height: usize,
    pub width: usize,
    pub channels: usize,
}

#[derive(Debug, Clone, Copy)]
pub(super) enum Action {
    /// Index into [`Graph::layers`].
    Layer(usize),
    MaxPool(Window),
    AveragePool(Window),
}

/// One step: an action from one map to some channels of another.
#[derive(Debug, Clone, Copy)]
pub(super) struct Step {
    pub action: Action,
    pub input: Map,
    pub output: Map,
    /// First channel written.
    pub channel: usize,
    /// Adds to what stands there, before bias and activation.
    pub accumulate: bool,
}

/// A map that features can be taken from, once `steps` steps are done.
#[derive(Debug, Clone)]
pub(super) struct Tap {
    pub name: String,
    pub map: Map,
    pub steps: usize,
}

/// An architecture at one input size. Map 0 is the input, with the first layer's zeros around it.
#[derive(Debug, Clone)]
pub(super) struct Graph {
    pub side: usize,
    pub border: Pad,
    pub maps: Vec<MapShape>,
    pub layers: Vec<Layer>,
    pub steps: Vec<Step>,
    pub taps: Vec<Tap>,
    /// Zeros outside the image count in an average pool's mean.
    pub average_counts_padding: bool,
}

impl Graph {
    /// The part that the taps `names` need, with those taps only, in the order of `names`.
    pub(super) fn up_to(mut self, names: &[String]) -> Result<Self, String> {
        let find = |name: &String| self.taps.iter().find(|t| t.name == *name).cloned().ok_or_else(|| name.clone());
        self.taps = names.iter().map(find).collect::<Result<_, _>>()?;
        self.steps.truncate(self.taps.iter().map(|t| t.steps).max().unwrap_or(0));
        let last =
            self.steps.iter().filter_map(|s| if let Action::Layer(l) = s.action { Some(l + 1) } else { None }).max();
        self.layers.truncate(last.unwrap_or(0));
        Ok(self)
    }

    /// The steps before and after the output of `block`, which is all that the second part sees of the first.
    ///
    /// Taps of earlier blocks belong to the first part; the block's own and later ones to the second, whose map 0 is
    /// the block's output.
    pub(super) fn cut(&self, block: &Tap) -> (Self, Self) {
        let (front_steps, back_steps) = self.steps.split_at(block.steps);
        let layers = front_steps.iter().filter(|s| matches!(s.action, Action::Layer(_))).count();
        let (front_layers, back_layers) = self.layers.split_at(layers);
        let (front_taps, back_taps): (Vec<Tap>, Vec<Tap>) =
            self.taps.iter().cloned().partition(|t| t.steps < block.steps);
        let mut new_map = vec![None; self.maps.len()];
        new_map[block.map] = Some(0);
        let mut maps = vec![self.maps[block.map]];
        let mut renamed = |map: Map| {
            *new_map[map].get_or_insert_with(|| {
                maps.push(self.maps[map]);
                maps.len() - 1
            })
        };
        let moved = |step: &Step| {
            let action = match step.action {
                Action::Layer(number) => Action::Layer(number - layers),
                pool => pool,
            };
            Step { action, input: renamed(step.input), output: renamed(step.output), ..*step }
        };
        let steps: Vec<Step> = back_steps.iter().map(moved).collect();
        let tap = |t: Tap| Tap { map: new_map[t.map].unwrap_or_default(), steps: t.steps - block.steps, ..t };
        let front = Self {
            layers: front_layers.to_vec(),
            steps: front_steps.to_vec(),
            taps: front_taps,
            maps: self.maps.clone(),
            ..*self
        };
        let taps = back_taps.into_iter().map(tap).collect();
        let back = Self { border: Pad::default(), maps, layers: back_layers.to_vec(), steps, taps, ..*self };
        (front, back)
    }

    /// Gives each map a buffer such that maps in use at the same time have different ones: the buffer of each map, and
    /// the floats per image of each buffer.
    pub(super) fn buffers(&self) -> (Vec<usize>, Vec<usize>) {
        let mut last_use = vec![0; self.maps.len()];
        for (i, step) in self.steps.iter().enumerate() {
            last_use[step.input] = i;
            last_use[step.output] = i;
        }
        let mut buffer_of: Vec<Option<usize>> = vec![None; self.maps.len()];
        buffer_of[0] = Some(0);
        let mut sizes = vec![self.map_len(0)];
        let mut free = Vec::new();
        for (i, step) in self.steps.iter().enumerate() {
            let buffer = buffer_of[step.output].or_else(|| free.pop()).unwrap_or(sizes.len());
            buffer_of[step.output] = Some(buffer);
            sizes.resize(sizes.len().max(buffer + 1), 0);
            sizes[buffer] = sizes[buffer].max(self.map_len(step.output));
            free.extend(
                [step.input, step.output].into_iter().filter(|m| last_use[*m] == i).filter_map(|m| buffer_of[m]),
            );
        }
        (buffer_of.into_iter().map(Option::unwrap_or_default).collect(), sizes)
    }

    /// Multiplications, each with an addition, of all layers for one image.
    pub(super) fn multiply_adds(&self) -> u64 {
        let of_step = |step: &Step| match step.action {
            Action::Layer(layer) => {
                let MapShape { height, width, .. } = self.maps[step.output];
                (height * width * self.layers[layer].shape().iter().product::<usize>()) as u64
            }
            Action::MaxPool(_) | Action::AveragePool(_) => 0,
        };
        self.steps.iter().map(of_step).sum()
    }

    /// Floats of a map of one image.
    pub(super) fn map_len(&self, map: Map) -> usize {
        let MapShape { height, width, channels } = self.maps[map];
        height * width * channels
    }
}

/// Writes a [`Graph`], layer by layer. Sizes that do not fit are remembered and reported by
/// [`finish`](Builder::finish).
pub(super) struct Builder {
    graph: Graph,
    impossible: bool,
}

/// A layer's form, beside its place.
#[derive(Clone, Copy)]
pub(super) struct Form {
    pub outputs: usize,
    pub kernel: (usize, usize),
    pub stride: usize,
    pub padding: Padding,
    pub activation: Activation,
}

impl Builder {
    /// An input of `side` × `side` pixels whose first layer has `window`: its border becomes part of map 0.
    pub(super) fn new(side: usize, border: Pad) -> Self {
        let map = MapShape {
            height: side + border.top + border.bottom,
            width: side + border.left + border.right,
            channels: 3,
        };
        let graph = Graph {
            side,
            border,
            maps: vec![map],
            layers: Vec::new(),
            steps: Vec::new(),
            taps: Vec::new(),
            average_counts_padding: true,
        };
        Self { graph, impossible: false }
    }

    pub(super) fn average_counts_padding(&mut self, counts: bool) {
        self.graph.average_counts_padding = counts;
    }

    pub(super) fn channels(&self, map: Map) -> usize {
        self.graph.maps[map].channels
    }

    fn map(&mut self, size: Option<(usize, usize)>, channels: usize) -> Map {
        self.impossible |= size.is_none_or(|(h, w)| h == 0 || w == 0);
        let (height, width) = size.unwrap_or((1, 1));
        self.graph.maps.push(MapShape { height, width, channels });
        self.graph.maps.len() - 1
    }

    fn window(&self, input: Map, kernel: (usize, usize), stride: usize, padding: Padding) -> Window {
        let shape = self.graph.maps[input];
        let (top, bottom) = padding.around(shape.height, kernel.0, stride);
        let (left, right) = padding.around(shape.width, kernel.1, stride);
        Window { height: kernel.0, width: kernel.1, stride, pad: Pad { top, left, bottom, right } }
    }

    fn output(&self, input: Map, window: &Window) -> Option<(usize, usize)> {
        let shape = self.graph.maps[input];
        window.output(shape.height, shape.width)
    }

    fn layer(
        &mut self,
        names: (&str, &str),
        input: Map,
        form: Form,
        depthwise: bool,
    ) -> (Action, Option<(usize, usize)>) {
        let window = self.window(input, form.kernel, form.stride, form.padding);
        self.graph.layers.push(Layer {
            conv: names.0.to_owned(),
            norm: names.1.to_owned(),
            window,
            inputs: self.channels(input),
            outputs: form.outputs,
            depthwise,
            activation: form.activation,
        });
        (Action::Layer(self.graph.layers.len() - 1), self.output(input, &window))
    }

    fn step(&mut self, action: Action, input: Map, output: Map, channel: usize, accumulate: bool) {
        self.graph.steps.push(Step { action, input, output, channel, accumulate });
    }

    /// A layer into a map of its own.
    pub(super) fn conv(&mut self, names: (&str, &str), input: Map, form: Form) -> Map {
        let (action, size) = self.layer(names, input, form, false);
        let output = self.map(size, form.outputs);
        self.step(action, input, output, 0, false);
        output
    }

    /// A layer with one window per channel.
    pub(super) fn depthwise(&mut self, names: (&str, &str), input: Map, form: Form) -> Map {
        let (action, size) = self.layer(names, input, form, true);
        let output = self.map(size, form.outputs);
        self.step(action, input, output, 0, false);
        output
    }

    /// A layer whose result is added to `output`, before its activation.
    pub(super) fn conv_onto(&mut self, names: (&str, &str), input: Map, form: Form, output: Map) {
        let (action, _) = self.layer(names, input, form, false);
        self.step(action, input, output, 0, true);
    }

    /// A layer into some channels of `output`.
    pub(super) fn conv_into(&mut self, names: (&str, &str), input: Map, form: Form, output: Map, channel: usize) {
        let (action, _) = self.layer(names, input, form, false);
        self.step(action, input, output, channel, false);
    }

    /// An empty map as large as what `stride` makes of `input` with a 3 × 3 window (or as `input`, for stride 1), to
    /// be filled by branches.
    pub(super) fn joined(&mut self, input: Map, stride: usize, channels: usize) -> Map {
        let shape = self.graph.maps[input];
        let size = if stride == 1 {
            Some((shape.height, shape.width))
        } else {
            Window::square(3, stride).output(shape.height, shape.width)
        };
        self.map(size, channels)
    }

    /// The maximum under windows.
    pub(super) fn max_pool(&mut self, input: Map, side: usize, stride: usize, padding: Padding) -> Map {
        let window = self.window(input, (side, side), stride, padding);
        let output = self.map(self.output(input, &window), self.channels(input));
        self.step(Action::MaxPool(window), input, output, 0, false);
        output
    }

    /// The maximum under windows of side 3 and stride 2, into some channels of `output`.
    pub(super) fn max_pool_into(&mut self, input: Map, output: Map, channel: usize) {
        self.step(Action::MaxPool(Window::square(3, 2)), input, output, channel, false);
    }

    /// The mean under windows of side 3 and stride 1.
    pub(super) fn average_pool(&mut self, input: Map) -> Map {
        let window = self.window(input, (3, 3), 1, Padding::Symmetric);
        let output = self.map(self.output(input, &window), self.channels(input));
        self.step(Action::AveragePool(window), input, output, 0, false);
        output
    }

    /// Lets features be taken from `map`.
    pub(super) fn tap(&mut self, name: &str, map: Map) {
        self.graph.taps.push(Tap { name: name.to_owned(), map, steps: self.graph.steps.len() });
    }

    /// The graph, or `None` if the input is too small for it.
    pub(super) fn finish(self) -> Option<Graph> {
        (!self.impossible).then_some(self.graph)
    }
}

//! The interpreter: runs a graph's steps on batches of images.

use super::description::Preprocessing;
use super::graph::{Action, Graph, Map, MapShape, Step};
use super::parameters::Prepared;
use super::pooling::Pooling;
use crate::kernel::{Buffer, Shape, View, ViewMut, average_pool, isa, max_pool};

/// From bytes to the values of map 0.
#[derive(Debug, Clone)]
pub(super) struct Preprocessor([(usize, [f32; 256]); 3]);

impl Preprocessor {
    pub(super) fn new(preprocessing: &Preprocessing) -> Self {
        Self(preprocessing.tables())
    }

    /// Puts `images` into `map`, with `graph`'s zeros around them.
    pub(super) fn fill(&self, graph: &Graph, images: &[u8], map: &mut [f32]) {
        map.fill(0.0);
        let (side, border) = (graph.side, graph.border);
        let MapShape { height, width, .. } = graph.maps[0];
        for (row, bytes) in images.chunks_exact(side * 3).enumerate() {
            let at = ((row / side * height + border.top + row % side) * width + border.left) * 3;
            for (pixel, rgb) in map[at..].as_chunks_mut::<3>().0.iter_mut().zip(bytes.as_chunks::<3>().0) {
                *pixel = self.0.each_ref().map(|(from, table)| table[usize::from(rgb[*from])]);
            }
        }
    }
}

/// A graph with its layers ready to run.
pub(super) struct Network {
    pub graph: Graph,
    pub layers: Vec<Prepared>,
    pub rings: usize,
    preprocessor: Preprocessor,
    buffer_of: Vec<usize>,
    buffer_sizes: Vec<usize>,
    poolings: Vec<Pooling>,
}

/// What a network is given.
#[derive(Debug, Clone, Copy)]
pub(super) enum Input<'a> {
    /// Bytes, RGB, side × side an image.
    Images(&'a [u8]),
    /// Values of map 0.
    Maps(&'a [f32]),
}

/// Feature maps of some images, kept from batch to batch.
#[derive(Debug, Default)]
pub(super) struct Workspace {
    images: usize,
    buffers: Vec<Buffer>,
}

impl Network {
    pub(super) fn new(graph: Graph, layers: Vec<Prepared>, preprocessing: &Preprocessing, rings: usize) -> Self {
        let (buffer_of, buffer_sizes) = graph.buffers();
        let pooling = |map: usize| Pooling::new(graph.maps[map].height, graph.maps[map].width, rings);
        let poolings = graph.taps.iter().map(|t| pooling(t.map)).collect();
        Self { preprocessor: Preprocessor::new(preprocessing), graph, layers, rings, buffer_of, buffer_sizes, poolings }
    }

    /// Length of one image's features.
    pub(super) fn dim(&self) -> usize {
        self.graph.taps.iter().zip(&self.poolings).map(|(t, p)| p.len(self.graph.maps[t.map].channels)).sum()
    }

    /// Bytes of one image.
    pub(super) fn image_len(&self) -> usize {
        self.graph.side * self.graph.side * 3
    }

    /// Features of some images into `out` ([`dim`](Network::dim) each), on the calling thread.
    pub(super) fn features(&self, input: Input, workspace: &mut Workspace, out: &mut [f32]) {
        self.begin(input, workspace);
        self.take_taps(0, workspace, out);
        for (i, step) in self.graph.steps.iter().enumerate() {
            self.execute(step, workspace);
            self.take_taps(i + 1, workspace, out);
        }
    }

    /// The values of `map` after [`features`](Network::features), if no step after its last has written over it.
    pub(super) fn map<'a>(&self, map: Map, workspace: &'a Workspace) -> &'a [f32] {
        &workspace.buffers[self.buffer_of[map]][..self.graph.map_len(map) * workspace.images]
    }

    /// Fills map 0.
    pub(super) fn begin(&self, input: Input, workspace: &mut Workspace) {
        let map_len = self.graph.map_len(0);
        workspace.images = match input {
            Input::Images(images) => images.len() / self.image_len(),
            Input::Maps(maps) => maps.len() / map_len,
        };
        workspace.buffers.resize_with(self.buffer_sizes.len(), Buffer::default);
        for (buffer, size) in workspace.buffers.iter_mut().zip(&self.buffer_sizes) {
            buffer.resize(size * workspace.images);
        }
        let map = &mut workspace.buffers[self.buffer_of[0]][..map_len * workspace.images];
        match input {
            Input::Images(images) => self.preprocessor.fill(&self.graph, images, map),
            Input::Maps(maps) => map.copy_from_slice(maps),
        }
    }

    /// Runs one step.
    pub(super) fn execute(&self, step: &Step, workspace: &mut Workspace) {
        let images = workspace.images;
        let wide = self.graph.maps[step.output];
        let channels = self.channels(step);
        let pair = [self.buffer_of[step.input], self.buffer_of[step.output]];
        let Ok([input, output]) = workspace.buffers.get_disjoint_mut(pair) else {
            unreachable!("`Graph::buffers` gives maps in use at the same time different buffers")
        };
        let x_shape = shape(self.graph.maps[step.input], images);
        let x = View::new(input, x_shape, x_shape.channels);
        let out_shape = Shape { channels, ..shape(wide, images) };
        let out = ViewMut::new(&mut output[step.channel..], out_shape, wide.channels);
        match step.action {
            Action::Layer(layer) => self.layers[layer].forward(x, out, step.accumulate),
            Action::MaxPool(window) => max_pool(isa(), window, x, out),
            Action::AveragePool(window) => average_pool(isa(), window, self.graph.average_counts_padding, x, out),
        }
    }

    /// Channels that a step writes.
    fn channels(&self, step: &Step) -> usize {
        match step.action {
            Action::Layer(layer) => self.graph.layers[layer].outputs,
            Action::MaxPool(_) | Action::AveragePool(_) => self.graph.maps[step.input].channels,
        }
    }

    /// Runs `layer` in place of a step's own, into `out`, which becomes as long as its output: all images' pixels × channels.
    pub(super) fn try_out(&self, step: &Step, layer: &Prepared, workspace: &Workspace, out: &mut Buffer) {
        let x_shape = shape(self.graph.maps[step.input], workspace.images);
        let out_shape =
            Shape { channels: self.channels(step), ..shape(self.graph.maps[step.output], workspace.images) };
        out.resize(out_shape.len());
        let x = View::new(&workspace.buffers[self.buffer_of[step.input]], x_shape, x_shape.channels);
        layer.forward(x, ViewMut::new(out, out_shape, out_shape.channels), false);
    }

    fn take_taps(&self, steps: usize, workspace: &Workspace, out: &mut [f32]) {
        let dim = self.dim();
        let mut first = 0;
        for (tap, pooling) in self.graph.taps.iter().zip(&self.poolings) {
            let map = self.graph.maps[tap.map];
            let len = pooling.len(map.channels);
            if tap.steps == steps {
                let maps =
                    View::new(&workspace.buffers[self.buffer_of[tap.map]], shape(map, workspace.images), map.channels);
                for (image, row) in out.chunks_exact_mut(dim).enumerate() {
                    pooling.pool(maps, image, &mut row[first..first + len]);
                }
            }
            first += len;
        }
    }
}

fn shape(map: MapShape, images: usize) -> Shape {
    Shape { images, height: map.height, width: map.width, channels: map.channels }
}

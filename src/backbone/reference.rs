//! The three networks once more, written naively in f64 from the papers' tables, to check the real ones against.

use std::collections::BTreeMap;

use super::description::{Padding, StrideIn, Variant};
use super::graph::{Graph, Layer};
use super::parameters::Parameters;

/// One image's map: height × width × channels.
#[derive(Clone)]
pub(super) struct Image {
    pub height: usize,
    pub width: usize,
    pub channels: usize,
    pub data: Vec<f64>,
}

impl Image {
    fn at(&self, y: isize, x: isize, c: usize) -> Option<f64> {
        let inside = (0..self.height as isize).contains(&y) && (0..self.width as isize).contains(&x);
        inside.then(|| self.data[(y as usize * self.width + x as usize) * self.channels + c])
    }

    /// Mean of each channel.
    pub(super) fn means(&self) -> Vec<f64> {
        let pixels = (self.height * self.width) as f64;
        (0..self.channels).map(|c| self.data.iter().skip(c).step_by(self.channels).sum::<f64>() / pixels).collect()
    }

    fn concat(parts: &[Image]) -> Image {
        let pixel = |p: usize| parts.iter().flat_map(move |i| i.data[p * i.channels..][..i.channels].iter().copied());
        let data = (0..parts[0].height * parts[0].width).flat_map(pixel).collect();
        Image { data, channels: parts.iter().map(|p| p.channels).sum(), ..parts[0].clone() }
    }
}

/// Zeros before and after, and the places of the window.
fn places(padding: Padding, size: usize, side: usize, stride: usize) -> (isize, usize) {
    match padding {
        Padding::Valid => (0, (size - side) / stride + 1),
        Padding::Symmetric => ((side / 2) as isize, (size + 2 * (side / 2) - side) / stride + 1),
        Padding::Same => {
            let out = size.div_ceil(stride);
            (((((out - 1) * stride + side).max(size) - size) / 2) as isize, out)
        }
    }
}

/// Drawn weights by layer name, with a batch norm of mean 0 and variance 1.
pub(super) struct Reference<'a> {
    layers: BTreeMap<&'a str, (usize, &'a Layer)>,
    seed: u64,
    variant: &'a Variant,
}

impl<'a> Reference<'a> {
    pub(super) fn new(graph: &'a Graph, seed: u64, variant: &'a Variant) -> Self {
        let layers = graph.layers.iter().enumerate().map(|(i, l)| (l.conv.as_str(), (i, l))).collect();
        Self { layers, seed, variant }
    }

    /// Convolution and batch norm of the layer `name`; kernel and channels are the caller's, not the graph's.
    #[allow(clippy::too_many_arguments)]
    fn linear(
        &self,
        name: &str,
        x: &Image,
        outputs: usize,
        kernel: (usize, usize),
        stride: usize,
        padding: Padding,
        apart: bool,
    ) -> Image {
        let (number, layer) = self.layers[name];
        let weights = Parameters::seeded(layer, self.seed, number).weights;
        let inputs = if apart { 1 } else { x.channels };
        assert_eq!(weights.len(), kernel.0 * kernel.1 * inputs * outputs, "{name}");
        let factor = 1.0 / (1.0 + f64::from(self.variant.batch_norm_epsilon)).sqrt();
        let (top, height) = places(padding, x.height, kernel.0, stride);
        let (left, width) = places(padding, x.width, kernel.1, stride);
        let mut data = vec![0.0; height * width * outputs];
        for (p, out) in data.chunks_mut(outputs).enumerate() {
            for t in 0..kernel.0 * kernel.1 {
                let y = (p / width * stride + t / kernel.1) as isize - top;
                let xx = (p % width * stride + t % kernel.1) as isize - left;
                for i in 0..x.channels {
                    let Some(value) = x.at(y, xx, i) else { continue };
                    if apart {
                        out[i] += factor * value * f64::from(weights[t * outputs + i]);
                        continue;
                    }
                    let row = &weights[(t * inputs + i) * outputs..][..outputs];
                    for (sum, w) in out.iter_mut().zip(row) {
                        *sum += factor * value * f64::from(*w);
                    }
                }
            }
        }
        Image { height, width, channels: outputs, data }
    }

    fn pool(&self, x: &Image, stride: usize, padding: Padding, mean: bool) -> Image {
        let (top, height) = places(padding, x.height, 3, stride);
        let (left, width) = places(padding, x.width, 3, stride);
        let mut data = Vec::new();
        for p in 0..height * width {
            let corner = ((p / width * stride) as isize - top, (p % width * stride) as isize - left);
            for c in 0..x.channels {
                let seen: Vec<f64> = (0..9).filter_map(|t| x.at(corner.0 + t / 3, corner.1 + t % 3, c)).collect();
                let count = if self.variant.average_counts_padding { 9 } else { seen.len() };
                let highest = seen.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                data.push(if mean { seen.iter().sum::<f64>() / count as f64 } else { highest });
            }
        }
        Image { height, width, channels: x.channels, data }
    }

    fn max_pool(&self, x: &Image) -> Image {
        self.pool(x, 2, Padding::Valid, false)
    }

    /// MobileNet-V1 to its last block.
    pub(super) fn mobilenet_v1(&self, x: &Image) -> Image {
        let (padding, top) = (self.variant.convolution_padding, 6.0);
        let bounded = |x: Image| Image { data: x.data.iter().map(|v| v.clamp(0.0, top)).collect(), ..x };
        let mut x = bounded(self.linear("conv0.conv", x, 32, (3, 3), 2, padding, false));
        for block in 1..=13 {
            let outputs = match block {
                1 => 64,
                2 | 3 => 128,
                4 | 5 => 256,
                6..=11 => 512,
                _ => 1024,
            };
            let stride = if [2, 4, 6, 12].contains(&block) { 2 } else { 1 };
            let channels = x.channels;
            x = bounded(self.linear(&format!("block{block}.dw.conv"), &x, channels, (3, 3), stride, padding, true));
            x = bounded(self.linear(&format!("block{block}.pw.conv"), &x, outputs, (1, 1), 1, padding, false));
        }
        x
    }

    /// ResNet50 to its last block.
    pub(super) fn resnet50(&self, x: &Image) -> Image {
        let padding = self.variant.convolution_padding;
        let x = relu(self.linear("conv1", x, 64, (7, 7), 2, padding, false));
        let mut x = self.pool(&x, 2, self.variant.stem_pool_padding, false);
        for (stage, (blocks, width)) in [(3, 64), (4, 128), (6, 256), (3, 512)].into_iter().enumerate() {
            for block in 0..blocks {
                let name = |part: &str| format!("layer{}.{block}.{part}", stage + 1);
                let stride = if block == 0 && stage > 0 { 2 } else { 1 };
                let (first, second) = if self.variant.stride_in == StrideIn::First { (stride, 1) } else { (1, stride) };
                let a = relu(self.linear(&name("conv1"), &x, width, (1, 1), first, padding, false));
                let b = relu(self.linear(&name("conv2"), &a, width, (3, 3), second, padding, false));
                let c = self.linear(&name("conv3"), &b, 4 * width, (1, 1), 1, padding, false);
                let shortcut = if block == 0 {
                    self.linear(&name("downsample.0"), &x, 4 * width, (1, 1), stride, padding, false)
                } else {
                    x
                };
                let data = c.data.iter().zip(&shortcut.data).map(|(a, b)| a + b).collect();
                x = relu(Image { data, ..c });
            }
        }
        x
    }

    fn conv(&self, name: &str, x: &Image, outputs: usize, height: usize, width: usize) -> Image {
        relu(self.linear(&format!("{name}.conv"), x, outputs, (height, width), 1, Padding::Symmetric, false))
    }

    fn valid(&self, name: &str, x: &Image, outputs: usize, side: usize, stride: usize) -> Image {
        relu(self.linear(&format!("{name}.conv"), x, outputs, (side, side), stride, Padding::Valid, false))
    }

    /// Convolutions of (outputs, height, width) called `<prefix>1`, `<prefix>2`, …
    fn chain(&self, prefix: &str, x: &Image, forms: &[(usize, usize, usize)]) -> Image {
        let step = |x: Image, (i, form): (usize, &(usize, usize, usize))| {
            self.conv(&format!("{prefix}{}", i + 1), &x, form.0, form.1, form.2)
        };
        forms.iter().enumerate().fold(x.clone(), step)
    }

    /// Inception-V3 to its last block.
    pub(super) fn inception_v3(&self, x: &Image) -> Image {
        let x = self.valid("Conv2d_1a_3x3", x, 32, 3, 2);
        let x = self.valid("Conv2d_2a_3x3", &x, 32, 3, 1);
        let x = self.max_pool(&self.conv("Conv2d_2b_3x3", &x, 64, 3, 3));
        let x = self.conv("Conv2d_3b_1x1", &x, 80, 1, 1);
        let mut x = self.max_pool(&self.valid("Conv2d_4a_3x3", &x, 192, 3, 1));
        let pooled = |x: &Image, block: &str, outputs| {
            self.conv(&format!("{block}.branch_pool"), &self.pool(x, 1, Padding::Symmetric, true), outputs, 1, 1)
        };
        for (block, outputs) in [("Mixed_5b", 32), ("Mixed_5c", 64), ("Mixed_5d", 64)] {
            x = Image::concat(&[
                self.conv(&format!("{block}.branch1x1"), &x, 64, 1, 1),
                self.chain(&format!("{block}.branch5x5_"), &x, &[(48, 1, 1), (64, 5, 5)]),
                self.chain(&format!("{block}.branch3x3dbl_"), &x, &[(64, 1, 1), (96, 3, 3), (96, 3, 3)]),
                pooled(&x, block, outputs),
            ]);
        }
        let double = self.chain("Mixed_6a.branch3x3dbl_", &x, &[(64, 1, 1), (96, 3, 3)]);
        x = Image::concat(&[
            self.valid("Mixed_6a.branch3x3", &x, 384, 3, 2),
            self.valid("Mixed_6a.branch3x3dbl_3", &double, 96, 3, 2),
            self.max_pool(&x),
        ]);
        for (block, w) in [("Mixed_6b", 128), ("Mixed_6c", 160), ("Mixed_6d", 160), ("Mixed_6e", 192)] {
            let double = [(w, 1, 1), (w, 7, 1), (w, 1, 7), (w, 7, 1), (192, 1, 7)];
            x = Image::concat(&[
                self.conv(&format!("{block}.branch1x1"), &x, 192, 1, 1),
                self.chain(&format!("{block}.branch7x7_"), &x, &[(w, 1, 1), (w, 1, 7), (192, 7, 1)]),
                self.chain(&format!("{block}.branch7x7dbl_"), &x, &double),
                pooled(&x, block, 192),
            ]);
        }
        let three = self.conv("Mixed_7a.branch3x3_1", &x, 192, 1, 1);
        let seven = self.chain("Mixed_7a.branch7x7x3_", &x, &[(192, 1, 1), (192, 1, 7), (192, 7, 1)]);
        x = Image::concat(&[
            self.valid("Mixed_7a.branch3x3_2", &three, 320, 3, 2),
            self.valid("Mixed_7a.branch7x7x3_4", &seven, 192, 3, 2),
            self.max_pool(&x),
        ]);
        for block in ["Mixed_7b", "Mixed_7c"] {
            let single = self.conv(&format!("{block}.branch3x3_1"), &x, 384, 1, 1);
            let double = self.chain(&format!("{block}.branch3x3dbl_"), &x, &[(448, 1, 1), (384, 3, 3)]);
            x = Image::concat(&[
                self.conv(&format!("{block}.branch1x1"), &x, 320, 1, 1),
                self.conv(&format!("{block}.branch3x3_2a"), &single, 384, 1, 3),
                self.conv(&format!("{block}.branch3x3_2b"), &single, 384, 3, 1),
                self.conv(&format!("{block}.branch3x3dbl_3a"), &double, 384, 1, 3),
                self.conv(&format!("{block}.branch3x3dbl_3b"), &double, 384, 3, 1),
                pooled(&x, block, 192),
            ]);
        }
        x
    }
}

fn relu(x: Image) -> Image {
    Image { data: x.data.iter().map(|v| v.max(0.0)).collect(), ..x }
}

//! Speed and memory of the numerical work, beside PyTorch, onnxruntime and OpenCV.
//!
//! `cargo bench --bench engine` writes `target/bench/engine.json`; words behind `--` choose the jobs whose names contain
//! one of them. Every round runs a job with one thread and with two, and then each peer likewise, so that whatever
//! else the machine does falls on all of them; what is compared is the median of the rounds' ratios. The machine's peak
//! of single-precision arithmetic is measured in every round too.
//!
//! Peers are run by `PANOTUNE_PYTHON` (or else `target/python/bin/python`), as far as it has them.

mod harness;

use harness::{Job, machine, run};
use panotune::backbone::{Backbone, WeightsSource};
use panotune::config::spec::{Architecture, BackboneSpec, PoseAxis, Tune};
use panotune::dataset::render::{Frame, Levels, Pose, Renderer, coarsest_level, plain};
use panotune::dataset::{Subset, View};
use panotune::panorama::Equirect;
use rayon::prelude::*;

/// Images of an extraction, as in `tests/peers/engine.py`.
const BATCH: usize = 16;

/// Panorama and views, likewise; the resolution is that of `configs/dataset/wide_angle.yaml`.
const PANORAMA_WIDTH: usize = 2048;
const VIEW_PX: u32 = 299;
const VIEWS: u32 = 8;
const RESOLUTION: u32 = 97;

const BACKBONES: [(&str, Architecture, u32, &str); 3] = [
    ("inception_v3", Architecture::InceptionV3, 299, "mixed_7c"),
    ("resnet50", Architecture::Resnet50, 224, "layer4"),
    ("mobilenet_v1", Architecture::MobilenetV1, 224, "block13"),
];

/// The whole network on a batch of images, its last map pooled.
fn extraction((name, architecture, input_px, tap): (&str, Architecture, u32, &str)) -> Job {
    let spec = BackboneSpec {
        architecture,
        input_px,
        weights: "seeded".to_owned(),
        tune: Tune::Frozen,
        taps: vec![tap.to_owned()],
        rings: 0,
        components: 0,
    };
    let make = move || {
        let backbone = Backbone::load(&spec, WeightsSource::Seeded { seed: 1 }).unwrap_or_else(|e| panic!("{e}"));
        let bytes = BATCH * input_px as usize * input_px as usize * 3;
        let images: Vec<u8> = (0..bytes).map(|i| ((i * 0x9e37_79b1) >> 7) as u8).collect();
        let multiply_adds = (BATCH as u64 * backbone.multiply_adds()) as f64;
        let work = move || drop(std::hint::black_box(backbone.features(&images, BATCH)));
        harness::Prepared { work: Box::new(work), multiply_adds: Some(multiply_adds) }
    };
    Job {
        name: format!("extraction/{name}"),
        unit: "images",
        units: BATCH as f64,
        peers: vec![format!("torch/extraction/{name}"), format!("onnxruntime/extraction/{name}")],
        memory: true,
        make: Box::new(make),
    }
}

/// Views of a panorama of noise, with (`limited`) and without the band limit; the peer only interpolates.
fn views(limited: bool) -> Job {
    let make = move || {
        let (width, height) = (PANORAMA_WIDTH, PANORAMA_WIDTH / 2);
        let rgb: Vec<u8> = (0..width * height * 3).map(|i| (i * 0x9e37_79b1 >> 7) as u8).collect();
        let frame = Frame { image_px: VIEW_PX, resolution: RESOLUTION };
        let views: Vec<View> = (0..VIEWS).map(view).collect();
        let coarsest = views.iter().map(|view| coarsest_level(view, frame, width)).max();
        let levels = Levels::build(&Equirect { width, height, rgb: &rgb }, 1, coarsest.unwrap_or(0));
        let renderer = Renderer::new(frame);
        let render = move |view: &View| {
            let pose = Pose::of(view, PoseAxis::Horizon);
            let pixels =
                if limited { renderer.render(&levels, view, &pose) } else { plain(&levels, view, &pose, VIEW_PX) };
            drop(std::hint::black_box(pixels));
        };
        harness::Prepared { work: Box::new(move || views.par_iter().for_each(&render)), multiply_adds: None }
    };
    Job {
        name: format!("views/{}", if limited { "band-limited" } else { "plain" }),
        unit: "views",
        units: f64::from(VIEWS),
        peers: vec!["opencv/views".to_owned()],
        memory: false,
        make: Box::new(make),
    }
}

fn view(index: u32) -> View {
    let i = f64::from(index);
    View {
        index,
        panorama: String::new(),
        subset: Subset::Train,
        f_px: 60.0 + 30.0 * i,
        xi: 0.1 * i,
        yaw_deg: 45.0 * i - 170.0,
        pitch_deg: 7.0 * i - 25.0,
        roll_deg: 0.0,
    }
}

fn jobs() -> Vec<Job> {
    BACKBONES.into_iter().map(extraction).chain([false, true].map(views)).collect()
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|a| a != "--bench").collect();
    if let [flag, name] = &arguments[..]
        && flag == harness::PEAK_FLAG
    {
        machine::print_peak_memory(jobs().into_iter().find(|j| j.name == *name));
        return;
    }
    let chosen = |job: &Job| arguments.is_empty() || arguments.iter().any(|a| job.name.contains(a));
    run("engine", jobs().into_iter().filter(chosen).collect());
}

//! Rendering of views of a panorama.

use panotune::config::spec::PoseAxis;
use panotune::dataset::render::{Frame, Levels, Pose, Renderer, coarsest_level, plain};
use panotune::dataset::{Subset, View};
use panotune::panorama::Equirect;
use rayon::prelude::*;

use super::noise;
use crate::harness::{Job, Prepared};

const PANORAMA_WIDTH: usize = 2048;
const VIEW_PX: u32 = 299;
/// As many as take long against what it takes to wake a thread.
const VIEWS: u32 = 96;
/// That of `configs/dataset/wide_angle.yaml`.
const RESOLUTION: u32 = 97;

/// Views without the band limit, as the peer makes them, and with it.
pub fn all() -> [Job; 2] {
    [("plain", false), ("band-limited", true)].map(|(name, limited)| views(name, limited))
}

fn views(name: &str, limited: bool) -> Job {
    let make = move || {
        let (width, height) = (PANORAMA_WIDTH, PANORAMA_WIDTH / 2);
        let rgb = noise(width * height * 3);
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
        Prepared { work: Box::new(move || views.par_iter().for_each(&render)), multiply_adds: None }
    };
    Job {
        name: format!("views/{name}"),
        unit: "views",
        units: f64::from(VIEWS),
        peers: vec!["opencv/views".to_owned()],
        memory: false,
        make: Box::new(make),
    }
}

fn view(index: u32) -> View {
    // the same eight cameras again and again
    let i = f64::from(index % 8);
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

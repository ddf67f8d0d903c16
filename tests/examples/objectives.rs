//! Twelve objectives on which samplers are compared; all are minimised.
//!
//! Six of them (`TUNED`) served to choose the settings of the default sampler, the other six did not.

use std::f64::consts::PI;

use panotune::search::{Ask, Distribution, Ticket};

/// An objective with its space.
pub struct Objective {
    pub name: &'static str,
    /// The least value that it takes.
    #[allow(dead_code, reason = "the latency benchmark does not need it")]
    pub minimum: f64,
    /// Asks for its parameters, in order.
    pub walk: fn(Ask<'_>),
    /// Its value.
    pub value: fn(&Ticket) -> f64,
}

/// Those on which settings were chosen.
#[allow(dead_code, reason = "the latency benchmark does not need it")]
pub const TUNED: [&str; 6] = ["rosenbrock4", "rastrigin3", "int_steps", "cat_table", "cond_branch", "nas_conditional"];

/// All of them, in alphabetical order.
pub fn all() -> Vec<Objective> {
    let new = |name, minimum, walk, value| Objective { name, minimum, walk, value };
    vec![
        new("branin", 0.397_887, |ask| floats(ask, &[("x", -5.0, 10.0), ("y", 0.0, 15.0)]), branin),
        new("cat_table", 1.0, walk_table, cat_table),
        new("cond_branch", 0.105_4, walk_branch, cond_branch),
        new("hartmann6", -3.322_37, |ask| same_floats(ask, 6, 0.0, 1.0), hartmann6),
        new("int_steps", 0.0, walk_steps, int_steps),
        new("log_valley", 0.0, walk_valley, log_valley),
        new("nas_conditional", 0.0, walk_nas, nas_conditional),
        new("nas_flat7", 0.009_85, walk_flat, nas_flat7),
        new("plateau", 0.0, walk_plateau, plateau),
        new("rastrigin3", 0.0, |ask| same_floats(ask, 3, -5.12, 5.12), rastrigin3),
        new("rosenbrock4", 0.0, |ask| same_floats(ask, 4, -2.048, 2.048), rosenbrock4),
        new("sphere_shift5", 0.0, |ask| same_floats(ask, 5, -5.0, 5.0), sphere_shift5),
    ]
}

fn float(low: f64, high: f64) -> Distribution {
    Distribution::float(low, high, false, None).expect("a range")
}

fn log_float(low: f64, high: f64) -> Distribution {
    Distribution::float(low, high, true, None).expect("a range")
}

fn int(low: i64, high: i64, step: i64) -> Distribution {
    Distribution::int(low, high, false, step).expect("a range")
}

fn log_int(low: i64, high: i64) -> Distribution {
    Distribution::int(low, high, true, 1).expect("a range")
}

fn choice(names: &[&str]) -> Distribution {
    Distribution::categorical(names.iter().map(|n| (*n).into()).collect()).expect("choices")
}

fn floats(ask: Ask<'_>, ranges: &[(&str, f64, f64)]) {
    for (name, low, high) in ranges {
        ask(name, &float(*low, *high));
    }
}

fn same_floats(ask: Ask<'_>, count: usize, low: f64, high: f64) {
    for i in 0..count {
        ask(&format!("x{i}"), &float(low, high));
    }
}

fn get(t: &Ticket, name: &str) -> f64 {
    t.get(name).expect("a parameter that was asked for")
}

fn numbered(t: &Ticket, name: &str, i: usize) -> f64 {
    get(t, &format!("{name}{i}"))
}

fn log10(t: &Ticket, name: &str) -> f64 {
    libm::log10(get(t, name))
}

fn square(x: f64) -> f64 {
    x * x
}

fn sphere_shift5(t: &Ticket) -> f64 {
    (0..5).map(|i| square(numbered(t, "x", i) - (1.1 + 0.5 * i as f64))).sum()
}

fn rosenbrock4(t: &Ticket) -> f64 {
    let x: Vec<f64> = (0..4).map(|i| numbered(t, "x", i)).collect();
    x.windows(2).map(|w| 100.0 * square(w[1] - w[0] * w[0]) + square(1.0 - w[0])).sum()
}

fn rastrigin3(t: &Ticket) -> f64 {
    let term = |i: usize| {
        let z = numbered(t, "x", i) - (0.7 + 0.9 * i as f64);
        z * z - 10.0 * libm::cos(2.0 * PI * z)
    };
    30.0 + (0..3).map(term).sum::<f64>()
}

fn branin(t: &Ticket) -> f64 {
    let (x, y) = (get(t, "x"), get(t, "y"));
    square(y - 5.1 / (4.0 * PI * PI) * x * x + 5.0 / PI * x - 6.0)
        + 10.0 * (1.0 - 1.0 / (8.0 * PI)) * libm::cos(x)
        + 10.0
}

fn hartmann6(t: &Ticket) -> f64 {
    const WEIGHTS: [f64; 4] = [1.0, 1.2, 3.0, 3.2];
    const SCALES: [[f64; 6]; 4] = [
        [10.0, 3.0, 17.0, 3.5, 1.7, 8.0],
        [0.05, 10.0, 17.0, 0.1, 8.0, 14.0],
        [3.0, 3.5, 1.7, 10.0, 17.0, 8.0],
        [17.0, 8.0, 0.05, 10.0, 0.1, 14.0],
    ];
    const CENTRES: [[f64; 6]; 4] = [
        [1312.0, 1696.0, 5569.0, 124.0, 8283.0, 5886.0],
        [2329.0, 4135.0, 8307.0, 3736.0, 1004.0, 9991.0],
        [2348.0, 1451.0, 3522.0, 2883.0, 3047.0, 6650.0],
        [4047.0, 8828.0, 8732.0, 5743.0, 1091.0, 381.0],
    ];
    let well = |i: usize| {
        let far = |j: usize| SCALES[i][j] * square(numbered(t, "x", j) - 1e-4 * CENTRES[i][j]);
        WEIGHTS[i] * libm::exp(-(0..6).map(far).sum::<f64>())
    };
    -(0..4).map(well).sum::<f64>()
}

fn walk_valley(ask: Ask<'_>) {
    ask("lr", &log_float(1e-6, 1.0));
    ask("wd", &log_float(1e-8, 1e-1));
    ask("bs", &log_int(8, 1024));
}

fn log_valley(t: &Ticket) -> f64 {
    let c = libm::log2(get(t, "bs") / 64.0);
    let a = log10(t, "lr") - (-3.5 + 0.5 * c * libm::log10(2.0) * 2.0);
    let b = log10(t, "wd") + 4.0;
    a * a + 0.3 * b * b + 0.05 * c * c + 0.1 * (a * b).abs()
}

fn walk_steps(ask: Ask<'_>) {
    ask("a", &int(0, 100, 5));
    ask("b", &int(-20, 20, 1));
    ask("c", &Distribution::float(0.0, 2.0, false, Some(0.25)).expect("a range"));
    ask("d", &log_int(1, 512));
}

fn int_steps(t: &Ticket) -> f64 {
    square((get(t, "a") - 65.0) / 20.0)
        + square((get(t, "b") + 7.0) / 6.0)
        + 4.0 * square(get(t, "c") - 1.25)
        + square(libm::log2(get(t, "d")) - 5.0) / 4.0
}

fn walk_table(ask: Ask<'_>) {
    for i in 0..5 {
        ask(&format!("k{i}"), &choice(&["c0", "c1", "c2", "c3", "c4"]));
    }
}

fn cat_table(t: &Ticket) -> f64 {
    let v: Vec<i32> = (0..5).map(|i| numbered(t, "k", i) as i32).collect();
    let own = (0..5).map(|i| f64::from((2 * v[i] + 3 * i as i32) % 5) * (1.0 + 0.25 * i as f64));
    let pairs = v.windows(2).filter(|w| (w[0] + w[1]) % 3 == 1).count();
    own.sum::<f64>() + 0.5 * pairs as f64
}

fn walk_branch(ask: Ask<'_>) {
    let kind = ask("kind", &choice(&["lin", "poly", "rbf"]));
    ask("C", &log_float(1e-3, 1e3));
    match kind as usize {
        1 => {
            ask("degree", &int(2, 7, 1));
            ask("coef0", &float(0.0, 1.0));
        }
        2 => {
            ask("gamma", &log_float(1e-5, 1e1));
        }
        _ => {}
    }
}

fn cond_branch(t: &Ticket) -> f64 {
    let c = log10(t, "C");
    let base = 0.1 * square(c - 0.7);
    match get(t, "kind") as usize {
        0 => 0.6 + base,
        1 => 0.35 + base + 0.08 * square(get(t, "degree") - 3.0) + 0.4 * square(get(t, "coef0") - 0.8),
        _ => {
            let gamma = log10(t, "gamma");
            0.1 + base + 0.15 * square(gamma + 2.5) + 0.05 * (c + gamma + 1.5).abs()
        }
    }
}

fn walk_plateau(ask: Ask<'_>) {
    floats(ask, &[("x", 0.0, 1.0), ("y", 0.0, 1.0)]);
    ask("flag", &Distribution::categorical(vec![true.into(), false.into()]).expect("choices"));
}

fn plateau(t: &Ticket) -> f64 {
    let far = libm::hypot(get(t, "x") - 0.83, get(t, "y") - 0.21);
    (12.0 * (far + 0.15 * get(t, "flag"))).floor() / 12.0
}

const ACTIVATIONS: [&str; 3] = ["relu", "sigmoid", "tanh"];

fn walk_layer(ask: Ask<'_>, ending: &str) {
    ask(&format!("units{ending}"), &int(32, 256, 1));
    ask(&format!("activation{ending}"), &choice(&ACTIVATIONS));
    ask(&format!("dropout{ending}"), &float(0.0, 0.5));
}

fn walk_optimizer(ask: Ask<'_>) {
    let optimizer = ask("optimizer", &choice(&["adam", "sgd"]));
    ask("learning_rate", &log_float(1e-5, 1e-2));
    if optimizer == 1.0 {
        ask("momentum", &float(0.0, 0.9));
    }
}

/// The paper's space: 8 to 40 parameters.
pub fn walk_nas(ask: Ask<'_>) {
    let layers = ask("n_layers", &int(2, 12, 1));
    for i in 0..layers as usize {
        walk_layer(ask, &format!("_{i}"));
    }
    walk_optimizer(ask);
}

fn walk_flat(ask: Ask<'_>) {
    ask("n_layers", &int(2, 12, 1));
    walk_layer(ask, "");
    walk_optimizer(ask);
}

fn nas(t: &Ticket, ending: impl Fn(usize) -> String) -> f64 {
    let layers = get(t, "n_layers");
    let layer = |i: usize| {
        let k = i as f64;
        let units = (get(t, &format!("units{}", ending(i))) - (200.0 - 10.0 * k)) / 128.0;
        let dropout = get(t, &format!("dropout{}", ending(i))) - (0.10 + 0.02 * k);
        let activation = [0.0, 0.25, 0.10][get(t, &format!("activation{}", ending(i))) as usize];
        (0.30 * square(units) + activation + 1.5 * square(dropout)) / (1.0 + k)
    };
    let rate = log10(t, "learning_rate");
    let optimizer = match t.get("momentum") {
        None => 0.25 * square(rate + 3.2),
        Some(momentum) => 0.10 + 0.25 * square(rate + 2.3) + 0.8 * square(momentum - 0.75),
    };
    0.02 * square(layers - 5.0) + (0..layers as usize).map(layer).sum::<f64>() + optimizer
}

fn nas_conditional(t: &Ticket) -> f64 {
    nas(t, |i| format!("_{i}"))
}

fn nas_flat7(t: &Ticket) -> f64 {
    nas(t, |_| String::new())
}

//! Reading vectors, comparing numbers, and NumPy's generator.

use std::path::{Path, PathBuf};

use panotune::search::{Direction, Distribution, Param, Trial, TrialState, Uniform};
use serde_json::Value;

/// Runs `check` on every item of `list` of the files called `name` of both versions, and prints how many
/// there were. A file without items fails; a file that an overriding folder lacks is left out.
pub fn each(name: &str, list: &str, versions: &[&str], mut check: impl FnMut(&Value, bool)) {
    let mut files = 0;
    for version in versions {
        let label = if version.is_empty() { name.to_owned() } else { format!("{version}/{name}") };
        let Some(file) = read(&label) else { continue };
        let items = file[list].as_array().unwrap_or_else(|| panic!("{label} has no `{list}`"));
        assert!(!items.is_empty(), "{label} has no `{list}`");
        items.iter().for_each(|item| check(item, *version == "v5"));
        say(&format!("{label}: {} of `{list}` checked", items.len()));
        files += 1;
    }
    assert!(files > 0 || folder().1, "no file {name}");
}

/// Prints a line although the test passes: `println!` would be captured.
pub fn say(line: &str) {
    use std::io::Write;
    writeln!(std::io::stderr(), "{line}").expect("standard error is open");
}

/// A file of vectors; `None` if an overriding folder lacks it.
pub fn read(label: &str) -> Option<Value> {
    let (folder, overriding) = folder();
    let path = folder.join(label);
    if overriding && !path.exists() {
        assert!(folder.is_dir(), "PANOTUNE_GOLDEN_DIR names no folder: {}", folder.display());
        say(&format!("{label}: not in {}, left out", folder.display()));
        return None;
    }
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    Some(serde_json::from_str(&text).unwrap_or_else(|e| panic!("{}: {e}", path.display())))
}

pub fn folder() -> (PathBuf, bool) {
    match std::env::var_os("PANOTUNE_GOLDEN_DIR") {
        Some(folder) => (folder.into(), true),
        None => (Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/optuna"), false),
    }
}

/// A number, or one of the words for those that JSON lacks.
pub fn number(value: &Value) -> f64 {
    match value.as_str() {
        Some("nan") => f64::NAN,
        Some("inf") => f64::INFINITY,
        Some("-inf") => f64::NEG_INFINITY,
        Some(other) => panic!("not a number: {other}"),
        None => value.as_f64().unwrap_or_else(|| panic!("not a number: {value}")),
    }
}

pub fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().expect("a list").iter().map(number).collect()
}

/// Fails unless `ours` and `theirs` agree to `tolerance`, relative where they are larger than 1.
pub fn close(ours: f64, theirs: f64, tolerance: f64, what: &str) {
    let same = (ours.is_nan() && theirs.is_nan())
        || ours == theirs
        || (ours - theirs).abs() <= tolerance * theirs.abs().max(1.0);
    assert!(same, "{what}: {ours} instead of {theirs}");
}

pub fn all_close(ours: &[f64], theirs: &[f64], tolerance: f64, what: &str) {
    assert_eq!(ours.len(), theirs.len(), "{what}");
    ours.iter().zip(theirs).enumerate().for_each(|(i, (a, b))| close(*a, *b, tolerance, &format!("{what}[{i}]")));
}

pub fn distribution(space: &Value) -> Distribution {
    let log = space["log"].as_bool().unwrap_or(false);
    let made = match space["type"].as_str() {
        Some("float") => {
            Distribution::float(number(&space["low"]), number(&space["high"]), log, space["step"].as_f64())
        }
        Some("int") => {
            let whole = |key: &str| space[key].as_i64().expect("a whole number");
            Distribution::int(whole("low"), whole("high"), log, whole("step"))
        }
        _ => Distribution::categorical(space["choices"].as_array().expect("choices").clone()),
    };
    made.expect("a distribution")
}

/// Names and distributions, in order.
pub fn space(case: &Value) -> Vec<(String, Distribution)> {
    let one = |s: &Value| (s["name"].as_str().expect("a name").to_owned(), distribution(s));
    case["space"].as_array().expect("a space").iter().map(one).collect()
}

pub fn direction(case: &Value) -> Direction {
    if case["direction"] == "maximize" { Direction::Maximize } else { Direction::Minimize }
}

/// A trial; its parameters are those of `space` for which it has an internal value.
pub fn trial(item: &Value, space: &[(String, Distribution)]) -> Trial {
    let params = space.iter().filter_map(|(name, distribution)| {
        let internal = item["params_internal"].get(name).map(number)?;
        Some(Param { name: name.clone(), distribution: distribution.clone(), internal })
    });
    let mut trial = Trial::running(item["number"].as_u64().unwrap_or(0) as u32, params.collect());
    trial.state = match item["state"].as_str() {
        Some("COMPLETE") => TrialState::Complete,
        Some("PRUNED") => TrialState::Pruned,
        Some("FAIL") => TrialState::Fail,
        Some("RUNNING") => TrialState::Running,
        Some("WAITING") => TrialState::Waiting,
        other => panic!("state {other:?}"),
    };
    trial.values = item.get("value").filter(|v| !v.is_null()).map(number).into_iter().collect();
    for report in item.get("intermediate_values").and_then(Value::as_array).into_iter().flatten() {
        trial.intermediate.insert(report[0].as_u64().expect("a step"), number(&report[1]));
    }
    trial.constraints = item.get("constraints").filter(|c| !c.is_null()).map(numbers);
    trial
}

/// MT19937 (Matsumoto and Nishimura 1998) with NumPy's seeding and doubles.
pub struct Twister {
    state: [u32; 624],
    next: usize,
}

impl Twister {
    pub fn new(seed: u32) -> Self {
        let mut state = [seed; 624];
        for i in 1..624 {
            let last = state[i - 1];
            state[i] = 1_812_433_253u32.wrapping_mul(last ^ (last >> 30)).wrapping_add(i as u32);
        }
        Twister { state, next: 624 }
    }

    fn twist(&mut self) {
        for i in 0..624 {
            let y = (self.state[i] & 0x8000_0000) | (self.state[(i + 1) % 624] & 0x7fff_ffff);
            let odd = if y & 1 == 1 { 0x9908_b0df } else { 0 };
            self.state[i] = self.state[(i + 397) % 624] ^ (y >> 1) ^ odd;
        }
        self.next = 0;
    }

    fn word(&mut self) -> u32 {
        if self.next == 624 {
            self.twist();
        }
        let mut y = self.state[self.next];
        self.next += 1;
        y ^= y >> 11;
        y ^= (y << 7) & 0x9d2c_5680;
        y ^= (y << 15) & 0xefc6_0000;
        y ^ (y >> 18)
    }
}

impl Uniform for Twister {
    fn uniform(&mut self) -> f64 {
        let (a, b) = (self.word() >> 5, self.word() >> 6);
        (f64::from(a) * 67_108_864.0 + f64::from(b)) / 9_007_199_254_740_992.0
    }
}

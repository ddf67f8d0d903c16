//! What a run will do, said before it does it.

use serde::Serialize;

/// Whether a stage has to be executed, and why.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Need {
    /// Its result is there.
    Cached,
    /// Its result is not there.
    Run {
        /// Why.
        why: String,
    },
}

/// One stage of a plan.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Step {
    /// Stage, e.g. `features`.
    pub stage: String,
    /// What it does, with counts.
    pub what: String,
    /// Whether it has to be executed.
    pub need: Need,
    /// Estimated seconds; 0 if cached.
    pub seconds: f64,
    /// Whether the estimate rests on an earlier run on this machine.
    pub measured: bool,
}

/// The plan as an aligned table with a total, ready to print.
pub fn render(steps: &[Step]) -> String {
    let width = |f: &dyn Fn(&Step) -> usize| steps.iter().map(f).max().unwrap_or(0);
    let (stage, what) = (width(&|s| s.stage.chars().count()), width(&|s| s.what.chars().count()));
    let mut text = String::new();
    for step in steps {
        let need = match &step.need {
            Need::Cached => "cached".to_owned(),
            Need::Run { why } => format!("to run, about {} ({why})", duration(step.seconds)),
        };
        let line = format!("{:stage$}  {:what$}  {need}", step.stage, step.what);
        text.push_str(line.trim_end());
        text.push('\n');
    }
    let total: f64 = steps.iter().map(|s| s.seconds).sum();
    let basis = match steps.iter().any(|s| s.seconds > 0.0 && !s.measured) {
        true => "some stages have not run on this machine yet: their times are rough",
        false => "from earlier runs on this machine",
    };
    text.push_str(&format!("in all about {} ({basis})\n", duration(total)));
    text
}

/// Seconds as people say them: `4 s`, `3 min 20 s`, `2 h 05 min`.
pub fn duration(seconds: f64) -> String {
    let s = seconds.max(0.0).round() as u64;
    match s {
        0..60 => format!("{s} s"),
        60..3600 => format!("{} min {:02} s", s / 60, s % 60),
        _ => format!("{} h {:02} min", s / 3600, s % 3600 / 60),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_read_well() {
        assert_eq!([0.4, 59.2, 61.0, 7500.0].map(duration), ["0 s", "59 s", "1 min 01 s", "2 h 05 min"]);
    }

    #[test]
    fn the_total_counts_only_what_runs() {
        let step =
            |stage: &str, need, seconds| Step { stage: stage.into(), what: "x".into(), need, seconds, measured: true };
        let steps = [step("views", Need::Cached, 0.0), step("study", Need::Run { why: "new".into() }, 90.0)];
        let text = render(&steps);
        assert!(text.contains("views  x  cached\n") && text.contains("in all about 1 min 30 s"), "{text}");
    }
}

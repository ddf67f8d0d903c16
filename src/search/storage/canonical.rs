//! A study as text by which studies are compared byte for byte.

use super::codes::{direction_name, state_name};
use super::distribution_json;
use super::json::{Json, write_compact, write_number, write_string};
use super::json_text::{write_list, write_object, write_value};
use super::record::{Attributes, StoredStudy, StoredTrial};

/// Names of system attributes that hold identities or notes, not results.
const LEFT_OUT: [&str; 2] = ["dashboard:", "artifacts:"];

/// JSON lines: the study, then its trials by number.
///
/// There are no times, no identities, no names of study or workers; parameters and attributes stand in order of
/// their names, reports in order of their steps; every double is the shortest text that reads back the same (zero
/// without its sign), with Python's words for not-a-number and infinities. Notes and artefacts of the dashboard are
/// left out.
pub fn canonical(study: &StoredStudy) -> String {
    let mut out = String::from("{\"directions\":");
    write_list(&mut out, &study.directions, |out, d| write_string(out, direction_name(*d)));
    write_attributes(&mut out, "user_attrs", &study.user_attrs);
    write_attributes(&mut out, "system_attrs", &study.system_attrs);
    out.push_str(&format!(",\"trials\":{}}}\n", study.trials.len()));
    study.trials.iter().for_each(|trial| write_trial(&mut out, trial));
    out
}

fn write_trial(out: &mut String, trial: &StoredTrial) {
    out.push_str(&format!("{{\"number\":{},\"state\":\"{}\",\"values\":", trial.number, state_name(trial.state)));
    match &trial.values {
        Some(values) => write_list(out, values, |out, x| write_double(out, *x)),
        None => out.push_str("null"),
    }
    let mut params: Vec<_> = trial.params.iter().collect();
    params.sort_by(|a, b| a.name.cmp(&b.name));
    out.push_str(",\"params\":");
    write_object(
        out,
        params.iter().map(|p| (p.name.as_str(), p.distribution.to_value(p.internal + 0.0))),
        |out, value| write_value(out, &value),
    );
    out.push_str(",\"distributions\":");
    let distributions = params.iter().map(|p| (p.name.as_str(), distribution_json::write(&p.distribution)));
    write_object(out, distributions, |out, text| write_compact(out, Json::parse(&text).unwrap_or(Json::NULL), true));
    out.push_str(",\"intermediate_values\":");
    let reports: Vec<_> = trial.intermediate.iter().collect();
    write_list(out, &reports, |out, (step, x)| {
        out.push_str(&format!("[{step},"));
        write_double(out, **x);
        out.push(']');
    });
    write_attributes(out, "user_attrs", &trial.user_attrs);
    write_attributes(out, "system_attrs", &trial.system_attrs);
    out.push_str("}\n");
}

/// Databases do not keep the sign of zero, so it does not count.
fn write_double(out: &mut String, x: f64) {
    write_number(out, x + 0.0);
}

fn write_attributes(out: &mut String, name: &str, attributes: &Attributes) {
    let kept = |key: &str| !LEFT_OUT.iter().any(|prefix| key.starts_with(prefix));
    let mut sorted: Vec<_> = attributes.iter().filter(|(key, _)| name == "user_attrs" || kept(key)).collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0));
    out.push_str(&format!(",\"{name}\":"));
    let members = sorted.into_iter().map(|(key, value)| (key.as_str(), value));
    write_object(out, members, |out, value| write_compact(out, value.json(), true));
}

#[cfg(test)]
mod tests {
    use super::super::super::{Direction, Distribution, Param, TrialState};
    use super::super::json_text::JsonText;
    use super::super::time;
    use super::*;

    #[test]
    fn order_times_and_spelling_do_not_matter_values_do() {
        let param = |name: &str, x: f64| Param {
            name: name.into(),
            distribution: Distribution::float(0.0, 1.0, false, None).unwrap(),
            internal: x,
        };
        let mut a = StoredStudy::new("a", &[Direction::Minimize]);
        let mut trial = StoredTrial::new(0, TrialState::Complete);
        trial.values = Some(vec![0.1 + 0.2]);
        trial.params = vec![param("y", 0.5), param("x", 1e-5)];
        trial.intermediate.insert(3, f64::NAN);
        trial.user_attrs.push(("k".into(), JsonText::parse("[1.50, 1]").unwrap()));
        a.trials.push(trial);
        let mut b = a.clone();
        b.name = "b".into();
        b.trials[0].params.reverse();
        b.trials[0].started = Some(time::now());
        b.trials[0].user_attrs[0].1 = JsonText::parse("[15e-1, 1]").unwrap();
        b.system_attrs.push(("dashboard:1:note_ver".into(), JsonText::from(1)));
        assert_eq!(canonical(&a), canonical(&b));
        let expected = concat!(
            "{\"directions\":[\"MINIMIZE\"],\"user_attrs\":{},\"system_attrs\":{},\"trials\":1}\n",
            "{\"number\":0,\"state\":\"COMPLETE\",\"values\":[0.30000000000000004],\"params\":{\"x\":1e-05,\"y\":0.5},",
            "\"distributions\":{\"x\":{\"name\":\"FloatDistribution\",\"attributes\":{\"step\":null,\"low\":0.0,",
            "\"high\":1.0,\"log\":false}},\"y\":{\"name\":\"FloatDistribution\",\"attributes\":{\"step\":null,",
            "\"low\":0.0,\"high\":1.0,\"log\":false}}},\"intermediate_values\":[[3,NaN]],\"user_attrs\":",
            "{\"k\":[1.5,1]},\"system_attrs\":{}}\n",
        );
        assert_eq!(canonical(&a), expected);
        b.trials[0].params[0].internal = 0.25;
        assert_ne!(canonical(&a), canonical(&b));
    }
}

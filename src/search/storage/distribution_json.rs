//! Distributions as storages write them.

use serde_json::Value;

use super::super::Distribution;
use super::json::{Json, Members, member, write_compact, write_number};
use super::json_text::JsonText;

/// The text that Optuna writes for a distribution.
pub fn write(distribution: &Distribution) -> String {
    match distribution {
        Distribution::Float { low, high, log, step } => {
            let step = step.map_or("null".into(), number);
            let (low, high) = (number(*low), number(*high));
            let attributes = format!(r#""step": {step}, "low": {low}, "high": {high}, "log": {log}"#);
            named("FloatDistribution", &attributes)
        }
        Distribution::Int { low, high, log, step } => {
            let attributes = format!(r#""log": {log}, "step": {step}, "low": {low}, "high": {high}"#);
            named("IntDistribution", &attributes)
        }
        Distribution::Categorical { choices } => {
            let choices: Vec<_> = choices.iter().map(|c| JsonText::from(c).as_text().to_owned()).collect();
            named("CategoricalDistribution", &format!(r#""choices": [{}]"#, choices.join(", ")))
        }
    }
}

fn named(name: &str, attributes: &str) -> String {
    format!(r#"{{"name": "{name}", "attributes": {{{attributes}}}}}"#)
}

fn number(x: f64) -> String {
    let mut text = String::new();
    write_number(&mut text, x);
    text
}

/// Reads the text of a distribution, of the present classes or of those before Optuna 3.
///
/// # Errors
/// What is wrong with it: not JSON, an unknown class or attribute, a missing one, an impossible range.
pub fn read(text: &str) -> Result<Distribution, String> {
    let broken = || format!("`{text}` is not a distribution");
    let whole = Json::parse(text).map_err(|e| e.to_string())?.members().ok_or_else(broken)?;
    let name = member(&whole, "name").and_then(Json::string).ok_or_else(broken)?;
    let members = member(&whole, "attributes").and_then(Json::members).ok_or_else(broken)?;
    let attributes = Attributes { class: &name, members };
    attributes.distribution().map_err(|why| format!("{name}: {why}"))
}

struct Attributes<'a> {
    class: &'a str,
    members: Members<'a>,
}

impl Attributes<'_> {
    fn distribution(&self) -> Result<Distribution, String> {
        match self.class {
            "FloatDistribution" => {
                self.only(&["low", "high", "log", "step"])?;
                let step = member(&self.members, "step").filter(|s| !s.is_null());
                let step = step.map(|_| self.real("step")).transpose()?;
                Distribution::float(self.real("low")?, self.real("high")?, self.log()?, step)
            }
            "UniformDistribution" => self.float(&["low", "high"], false),
            "LogUniformDistribution" => self.float(&["low", "high"], true),
            "DiscreteUniformDistribution" => {
                self.only(&["low", "high", "q"])?;
                Distribution::float(self.real("low")?, self.real("high")?, false, Some(self.real("q")?))
            }
            "IntDistribution" => self.int(&["low", "high", "log", "step"], self.log()?),
            "IntUniformDistribution" => self.int(&["low", "high", "step"], false),
            "IntLogUniformDistribution" => {
                self.only(&["low", "high", "step"])?;
                Distribution::int(self.whole("low")?, self.whole("high")?, true, 1)
            }
            "CategoricalDistribution" => self.categorical(),
            _ => Err("the class is unknown".into()),
        }
    }

    fn float(&self, known: &[&str], log: bool) -> Result<Distribution, String> {
        self.only(known)?;
        Distribution::float(self.real("low")?, self.real("high")?, log, None)
    }

    fn int(&self, known: &[&str], log: bool) -> Result<Distribution, String> {
        self.only(known)?;
        let step = if member(&self.members, "step").is_some() { self.whole("step")? } else { 1 };
        Distribution::int(self.whole("low")?, self.whole("high")?, log, step)
    }

    /// Lists that an experiment may not have (equal choices, `null`) are legal in a storage.
    fn categorical(&self) -> Result<Distribution, String> {
        self.only(&["choices"])?;
        let items = member(&self.members, "choices").and_then(Json::items).ok_or("`choices` is not a list")?;
        let choices = items.into_iter().map(choice).collect::<Result<Vec<Value>, _>>()?;
        match choices.is_empty() {
            true => Err("`choices` is empty".into()),
            false => Ok(Distribution::Categorical { choices }),
        }
    }

    fn only(&self, known: &[&str]) -> Result<(), String> {
        match self.members.iter().find(|(name, _)| !known.contains(&name.as_ref())) {
            Some((name, _)) => Err(format!("the attribute `{name}` is unknown")),
            None => Ok(()),
        }
    }

    fn attribute<T>(&self, name: &str, read: impl Fn(Json<'_>) -> Option<T>) -> Result<T, String> {
        let value = member(&self.members, name).ok_or_else(|| format!("the attribute `{name}` is missing"))?;
        read(value).ok_or_else(|| format!("`{name}` cannot be {}", value.as_text()))
    }

    fn real(&self, name: &str) -> Result<f64, String> {
        self.attribute(name, |x| x.number())
    }

    fn whole(&self, name: &str) -> Result<i64, String> {
        self.attribute(name, |x| x.whole())
    }

    fn log(&self) -> Result<bool, String> {
        if member(&self.members, "log").is_some() { self.attribute("log", |x| x.boolean()) } else { Ok(false) }
    }
}

fn choice(json: Json<'_>) -> Result<Value, String> {
    json.to_value().ok_or_else(|| {
        let mut text = String::new();
        write_compact(&mut text, json, false);
        format!("choice {text} is neither finite, nor of at most 64 bits, nor text")
    })
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn texts_are_those_of_optuna() {
        let float = Distribution::float(0.0, 0.5, false, None).unwrap();
        let text =
            r#"{"name": "FloatDistribution", "attributes": {"step": null, "low": 0.0, "high": 0.5, "log": false}}"#;
        assert_eq!(write(&float), text);
        let int = Distribution::int(2, 12, false, 1).unwrap();
        let text = r#"{"name": "IntDistribution", "attributes": {"log": false, "step": 1, "low": 2, "high": 12}}"#;
        assert_eq!(write(&int), text);
        let choices = vec![json!("relu"), json!(null), json!(true), json!(2.5), json!(7), json!("日")];
        let list = Distribution::Categorical { choices };
        let text =
            r#"{"name": "CategoricalDistribution", "attributes": {"choices": ["relu", null, true, 2.5, 7, "\u65e5"]}}"#;
        assert_eq!(write(&list), text);
        for d in [float, int, list] {
            assert_eq!(read(&write(&d)), Ok(d));
        }
    }

    #[test]
    fn older_classes_are_read() {
        let of =
            |class: &str, attributes: &str| read(&format!(r#"{{"name":"{class}","attributes":{{{attributes}}}}}"#));
        let bounds = r#""low":1,"high":8"#;
        assert_eq!(of("UniformDistribution", bounds), Distribution::float(1.0, 8.0, false, None));
        assert_eq!(of("LogUniformDistribution", bounds), Distribution::float(1.0, 8.0, true, None));
        assert_eq!(
            of("DiscreteUniformDistribution", r#""low":1,"high":8,"q":0.5"#),
            Distribution::float(1.0, 8.0, false, Some(0.5))
        );
        assert_eq!(of("IntUniformDistribution", r#""low":1,"high":8,"step":2"#), Distribution::int(1, 8, false, 2));
        assert_eq!(of("IntLogUniformDistribution", r#""low":1,"high":8,"step":1"#), Distribution::int(1, 8, true, 1));
    }

    #[test]
    fn what_is_wrong_is_said() {
        let of = |class: &str, attributes: &str| {
            read(&format!(r#"{{"name":"{class}","attributes":{{{attributes}}}}}"#)).unwrap_err()
        };
        assert!(of("NormalDistribution", "").contains("NormalDistribution"));
        assert!(of("FloatDistribution", r#""low":0.0"#).contains("`high` is missing"));
        assert!(of("IntDistribution", r#""low":0,"high":1,"q":1"#).contains("`q` is unknown"));
        assert!(of("IntDistribution", r#""low":0.5,"high":1"#).contains("0.5"));
        assert!(of("CategoricalDistribution", r#""choices":[]"#).contains("empty"));
        assert!(of("CategoricalDistribution", r#""choices":[NaN]"#).contains("NaN"));
        assert!(of("FloatDistribution", r#""low":2.0,"high":1.0"#).contains("exceed"));
        assert!(read("[]").is_err() && read("{").is_err());
    }
}

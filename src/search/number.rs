//! Doubles in JSON, which has no word for infinities and not-a-number: they become strings.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

#[derive(Serialize, Deserialize)]
#[serde(transparent)]
struct Number(#[serde(serialize_with = "write", deserialize_with = "read")] f64);

fn write<S: Serializer>(x: &f64, serializer: S) -> Result<S::Ok, S::Error> {
    if x.is_finite() {
        serializer.serialize_f64(*x)
    } else if x.is_nan() {
        serializer.serialize_str("nan")
    } else {
        serializer.serialize_str(if *x > 0.0 { "inf" } else { "-inf" })
    }
}

fn read<'de, D: Deserializer<'de>>(deserializer: D) -> Result<f64, D::Error> {
    let value = serde_json::Value::deserialize(deserializer)?;
    match value.as_str() {
        Some("nan") => Ok(f64::NAN),
        Some("inf") => Ok(f64::INFINITY),
        Some("-inf") => Ok(f64::NEG_INFINITY),
        _ => value.as_f64().ok_or_else(|| serde::de::Error::custom("expected a number, `nan`, `inf` or `-inf`")),
    }
}

/// Numbers in a list.
pub mod list {
    use super::*;

    /// Writes them.
    pub fn serialize<S: Serializer>(values: &[f64], serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(values.iter().map(|x| Number(*x)))
    }

    /// Reads them.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vec<f64>, D::Error> {
        Ok(Vec::<Number>::deserialize(deserializer)?.into_iter().map(|n| n.0).collect())
    }
}

/// Numbers by step, as a list of pairs in order of step.
pub mod by_step {
    use std::collections::BTreeMap;

    use super::*;

    /// Writes them.
    pub fn serialize<S: Serializer>(values: &BTreeMap<u64, f64>, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(values.iter().map(|(step, x)| (step, Number(*x))))
    }

    /// Reads them.
    pub fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<BTreeMap<u64, f64>, D::Error> {
        let pairs = Vec::<(u64, Number)>::deserialize(deserializer)?;
        Ok(pairs.into_iter().map(|(step, n)| (step, n.0)).collect())
    }
}

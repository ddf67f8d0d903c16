//! JSON values that are kept as text.

use serde_json::Value;

use super::json::{Json, JsonError, write_compact, write_number, write_string};

/// A JSON value as text, in the form in which Python writes it compactly. Python writes `NaN`, `Infinity` and
/// `-Infinity` as bare words and whole numbers of any size, which a strict parser refuses; the text keeps them
/// all. Numbers keep the digits with which they were written.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct JsonText(String);

impl JsonText {
    /// Reads one value.
    ///
    /// # Errors
    /// The text is not JSON, or more than one value.
    pub fn parse(text: &str) -> Result<Self, JsonError> {
        Json::parse(text).map(JsonText::from)
    }

    /// The text: ASCII, one line, no spaces outside strings.
    pub fn as_text(&self) -> &str {
        &self.0
    }

    /// The value, to be looked into.
    pub fn json(&self) -> Json<'_> {
        // The text was made from a well-formed value.
        Json::parse(&self.0).unwrap_or(Json::NULL)
    }

    /// A string, or `None` if it is something else.
    pub fn as_str(&self) -> Option<String> {
        self.json().string().map(|s| s.into_owned())
    }

    /// A number, `NaN` and infinities included, or `None` if it is something else.
    pub fn as_f64(&self) -> Option<f64> {
        self.json().number()
    }

    /// A list of numbers, or `None` if it is something else.
    pub fn as_f64_list(&self) -> Option<Vec<f64>> {
        self.json().numbers()
    }

    /// A boolean, or `None` if it is something else.
    pub fn as_bool(&self) -> Option<bool> {
        self.json().boolean()
    }

    /// The value as `serde_json` has it; `None` for bare words, large numbers and broken characters.
    pub fn to_value(&self) -> Option<Value> {
        self.json().to_value()
    }

    fn written(write: impl FnOnce(&mut String)) -> Self {
        let mut text = String::new();
        write(&mut text);
        JsonText(text)
    }
}

impl From<Json<'_>> for JsonText {
    fn from(json: Json<'_>) -> Self {
        Self::written(|out| write_compact(out, json, false))
    }
}

impl From<&str> for JsonText {
    fn from(text: &str) -> Self {
        Self::written(|out| write_string(out, text))
    }
}

impl From<f64> for JsonText {
    fn from(x: f64) -> Self {
        Self::written(|out| write_number(out, x))
    }
}

impl From<i64> for JsonText {
    fn from(x: i64) -> Self {
        JsonText(x.to_string())
    }
}

impl From<bool> for JsonText {
    fn from(x: bool) -> Self {
        JsonText(x.to_string())
    }
}

impl From<&[f64]> for JsonText {
    fn from(numbers: &[f64]) -> Self {
        Self::written(|out| write_list(out, numbers, |out, x| write_number(out, *x)))
    }
}

impl From<&Value> for JsonText {
    fn from(value: &Value) -> Self {
        Self::written(|out| write_value(out, value))
    }
}

/// Appends a list, without spaces.
pub fn write_list<T>(out: &mut String, items: &[T], mut write: impl FnMut(&mut String, &T)) {
    out.push('[');
    for (i, item) in items.iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        write(out, item);
    }
    out.push(']');
}

/// Appends an object, without spaces.
pub fn write_object<'a, T>(
    out: &mut String,
    members: impl IntoIterator<Item = (&'a str, T)>,
    mut write: impl FnMut(&mut String, T),
) {
    out.push('{');
    for (i, (name, value)) in members.into_iter().enumerate() {
        if i > 0 {
            out.push(',');
        }
        write_string(out, name);
        out.push(':');
        write(out, value);
    }
    out.push('}');
}

/// Appends `value` as Python writes it.
pub fn write_value(out: &mut String, value: &Value) {
    match value {
        Value::String(text) => write_string(out, text),
        Value::Number(n) => match n.as_f64().filter(|_| n.is_f64()) {
            Some(x) => write_number(out, x),
            None => out.push_str(&n.to_string()),
        },
        Value::Array(items) => write_list(out, items, write_value),
        Value::Object(map) => write_object(out, map.iter().map(|(k, v)| (k.as_str(), v)), write_value),
        other => out.push_str(&other.to_string()),
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn compact(text: &str) -> String {
        JsonText::parse(text).unwrap().as_text().to_owned()
    }

    #[test]
    fn python_s_words_large_numbers_and_escapes_are_kept() {
        assert_eq!(compact(" [NaN, -Infinity,Infinity , 1e5, -0] "), "[NaN,-Infinity,Infinity,1e5,-0]");
        assert_eq!(compact("123456789012345678901234567890"), "123456789012345678901234567890");
        assert_eq!(compact("\"ü🚀\\/\\u0041\\ud83d\""), r#""\u00fc\ud83d\ude80/A\ud83d""#);
        assert_eq!(compact("{\"a b\" : {} , \"c\":[ ]}"), r#"{"a b":{},"c":[]}"#);
        assert_eq!(JsonText::from("\u{7f}\n\u{1}é").as_text(), r#""\u007f\n\u0001\u00e9""#);
    }

    #[test]
    fn shapes_are_read() {
        assert_eq!(JsonText::parse("[1, NaN, -2.5e-3]").unwrap().as_f64_list().map(|l| l.len()), Some(3));
        assert!(JsonText::parse("NaN").unwrap().as_f64().unwrap().is_nan());
        assert_eq!(JsonText::parse(r#""\ud83d\ude80""#).unwrap().as_str().as_deref(), Some("🚀"));
        assert_eq!(JsonText::parse(r#""\ud83d""#).unwrap().as_str(), None);
        assert_eq!(JsonText::from(true).as_bool(), Some(true));
        assert_eq!(JsonText::from("true").as_bool(), None);
        let members = JsonText::parse(r#"{"a":1,"b":[2],"a":3.0}"#).unwrap();
        let members = members.json().members().unwrap();
        assert_eq!(super::super::json::member(&members, "a").and_then(|a| a.whole()), Some(3));
    }

    #[test]
    fn doubles_are_written_as_python_writes_them() {
        let cases = [
            (0.1 + 0.2, "0.30000000000000004"),
            (3.0, "3.0"),
            (-0.0, "-0.0"),
            (1e16, "1e+16"),
            (1.5e-5, "1.5e-05"),
            (0.0001, "0.0001"),
            (123456789012345680.0, "1.2345678901234568e+17"),
            (9999999999999998.0, "9999999999999998.0"),
            (5e-324, "5e-324"),
            (f64::MAX, "1.7976931348623157e+308"),
        ];
        for (x, text) in cases {
            assert_eq!(JsonText::from(x).as_text(), text);
        }
    }

    #[test]
    fn what_is_not_json_is_refused_however_deep() {
        for text in
            ["", "[1,]", "{\"a\":1,}", "{a:1}", "01", "1.", "+1", "\"", "\"\\x\"", "\"\n\"", "nul", "[", "1 2", "]"]
        {
            assert!(JsonText::parse(text).is_err(), "{text}");
        }
        let deep = "[".repeat(1_000_000);
        assert!(JsonText::parse(&deep).is_err());
        assert_eq!(compact(&(deep.clone() + &"]".repeat(1_000_000))).len(), 2_000_000);
    }

    proptest! {
        #[test]
        fn doubles_and_strings_come_back(bits in any::<u64>(), text in any::<String>()) {
            let x = f64::from_bits(bits);
            let back = JsonText::from(x).as_f64().unwrap();
            prop_assert!(back.to_bits() == bits || (x.is_nan() && back.is_nan()));
            let written = JsonText::from(text.as_str());
            prop_assert!(written.as_text().bytes().all(|b| (0x20..0x7f).contains(&b)));
            prop_assert_eq!(written.as_str(), Some(text));
            prop_assert_eq!(JsonText::parse(written.as_text()).unwrap(), written);
        }

        #[test]
        fn no_text_makes_it_panic(text in r#"[\[\]{}":,0-9eE.\-+NaInfity \\u]{0,40}"#) {
            if let Ok(value) = JsonText::parse(&text) {
                let json = value.json();
                let _ = (json.items(), json.members(), json.string(), json.whole(), json.to_value());
                prop_assert_eq!(JsonText::parse(value.as_text()).unwrap(), value);
            }
        }
    }
}

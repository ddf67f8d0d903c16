//! JSON as Python writes it: bare `NaN`, `Infinity` and `-Infinity`, whole numbers of any size, escapes of lone
//! halves of surrogate pairs. A value stays text, and is read where it is needed.

use std::borrow::Cow;

use serde_json::Value;

/// Text that is not JSON.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("it is not JSON at byte {at}: {why}")]
pub struct JsonError {
    /// Where.
    pub at: usize,
    /// What is wrong there.
    pub why: &'static str,
}

/// A well-formed JSON value: a slice of the text in which it stands.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Json<'a>(&'a str);

/// Members of an object in the order in which they stand.
pub type Members<'a> = Vec<(Cow<'a, str>, Json<'a>)>;

impl<'a> Json<'a> {
    /// The value `null`.
    pub const NULL: Json<'static> = Json("null");

    /// The one value that `text` consists of, white space around it left out.
    ///
    /// # Errors
    /// The text is not JSON, or more than one value.
    pub fn parse(text: &'a str) -> Result<Self, JsonError> {
        let scan = Scan(text.as_bytes());
        let begin = scan.space(0);
        let end = scan.value(begin)?;
        match scan.space(end) == text.len() {
            true => Ok(Json(&text[begin..end])),
            false => Err(JsonError { at: end, why: "something follows the value" }),
        }
    }

    /// The text of the value.
    pub fn as_text(self) -> &'a str {
        self.0
    }

    /// Whether it is `null`.
    pub fn is_null(self) -> bool {
        self.0 == "null"
    }

    /// A boolean.
    pub fn boolean(self) -> Option<bool> {
        self.0.parse().ok()
    }

    /// A number as the nearest double, `NaN` and infinities included.
    pub fn number(self) -> Option<f64> {
        match self.0 {
            "NaN" => Some(f64::NAN),
            "Infinity" => Some(f64::INFINITY),
            "-Infinity" => Some(f64::NEG_INFINITY),
            text if text.starts_with(|c: char| c == '-' || c.is_ascii_digit()) => text.parse().ok(),
            _ => None,
        }
    }

    /// A whole number of at most 64 bits; `3.0` is one.
    pub fn whole(self) -> Option<i64> {
        let fits = |x: &f64| x.fract() == 0.0 && x.abs() < 9e18;
        self.0.parse().ok().or_else(|| self.number().filter(fits).map(|x| x as i64))
    }

    /// A string; `None` also for one with half a surrogate pair, which is no text.
    pub fn string(self) -> Option<Cow<'a, str>> {
        let inner = self.0.strip_prefix('"')?.strip_suffix('"')?;
        match inner.contains('\\') {
            false => Some(Cow::Borrowed(inner)),
            true => String::from_utf16(&Units(inner.chars(), None).collect::<Vec<_>>()).ok().map(Cow::Owned),
        }
    }

    /// The items of a list.
    pub fn items(self) -> Option<Vec<Json<'a>>> {
        let scan = Scan(self.0.as_bytes());
        let mut items = Vec::new();
        let mut at = scan.space(self.0.starts_with('[').then_some(1)?);
        while scan.byte(at) != Some(b']') {
            let end = scan.value(at).ok()?;
            items.push(Json(&self.0[at..end]));
            at = scan.next_item(end);
        }
        Some(items)
    }

    /// The members of an object; `None` also if a name is no text.
    pub fn members(self) -> Option<Members<'a>> {
        let scan = Scan(self.0.as_bytes());
        let mut members = Vec::new();
        let mut at = scan.space(self.0.starts_with('{').then_some(1)?);
        while scan.byte(at) != Some(b'}') {
            let name_end = scan.string(at).ok()?;
            let begin = scan.space(scan.key(at).ok()?);
            let end = scan.value(begin).ok()?;
            members.push((Json(&self.0[at..name_end]).string()?, Json(&self.0[begin..end])));
            at = scan.next_item(end);
        }
        Some(members)
    }

    /// A list of numbers.
    pub fn numbers(self) -> Option<Vec<f64>> {
        self.items()?.into_iter().map(Json::number).collect()
    }

    /// The value as `serde_json` has it; `None` for what that cannot hold.
    pub fn to_value(self) -> Option<Value> {
        let whole =
            self.0.starts_with(|c: char| c == '-' || c.is_ascii_digit()) && !self.0.contains(['.', 'e', 'E', 'I']);
        if whole && self.0.parse::<i64>().is_err() && self.0.parse::<u64>().is_err() {
            return None;
        }
        serde_json::from_str(self.0).ok()
    }
}

/// The member called `name`; the last one, as in Python, if there are several.
pub fn member<'a>(members: &Members<'a>, name: &str) -> Option<Json<'a>> {
    members.iter().rev().find(|(n, _)| n == name).map(|(_, value)| *value)
}

/// UTF-16 code units of a string's inside.
struct Units<'a>(std::str::Chars<'a>, Option<u16>);

impl Units<'_> {
    fn escape(&mut self) -> Option<u16> {
        Some(match self.0.next()? {
            'b' => 8,
            'f' => 12,
            'n' => 10,
            'r' => 13,
            't' => 9,
            'u' => {
                let (digits, rest) = self.0.as_str().split_at_checked(4)?;
                self.0 = rest.chars();
                u16::from_str_radix(digits, 16).ok()?
            }
            other => u16::try_from(u32::from(other)).ok()?,
        })
    }
}

impl Iterator for Units<'_> {
    type Item = u16;

    fn next(&mut self) -> Option<u16> {
        if let Some(unit) = self.1.take() {
            return Some(unit);
        }
        match self.0.next()? {
            '\\' => self.escape(),
            c => {
                let mut pair = [0; 2];
                let units = c.encode_utf16(&mut pair);
                self.1 = units.get(1).copied();
                units.first().copied()
            }
        }
    }
}

/// Finds where values end. Nesting costs memory, not stack, so no text is too deep.
struct Scan<'a>(&'a [u8]);

impl Scan<'_> {
    fn byte(&self, at: usize) -> Option<u8> {
        self.0.get(at).copied()
    }

    fn space(&self, mut at: usize) -> usize {
        while matches!(self.byte(at), Some(b' ' | b'\t' | b'\n' | b'\r')) {
            at += 1;
        }
        at
    }

    /// Where the next item of a well-formed list or object begins, or its end.
    fn next_item(&self, end: usize) -> usize {
        let at = self.space(end);
        if self.byte(at) == Some(b',') { self.space(at + 1) } else { at }
    }

    /// The end of the value that begins at `at`.
    fn value(&self, mut at: usize) -> Result<usize, JsonError> {
        let mut closers = Vec::new();
        loop {
            at = self.space(at);
            let opener = self.byte(at);
            at = match opener {
                Some(b'{' | b'[') => {
                    let closer = if opener == Some(b'{') { b'}' } else { b']' };
                    let inside = self.space(at + 1);
                    if self.byte(inside) != Some(closer) {
                        closers.push(closer);
                        at = if closer == b'}' { self.key(inside)? } else { inside };
                        continue;
                    }
                    inside + 1
                }
                Some(b'"') => self.string(at)?,
                _ => self.scalar(at)?,
            };
            match self.close(&mut closers, at)? {
                (end, true) => return Ok(end),
                (next, false) => at = next,
            }
        }
    }

    /// What follows a value: the end of all that is open, or where the next value begins.
    fn close(&self, closers: &mut Vec<u8>, mut at: usize) -> Result<(usize, bool), JsonError> {
        while let Some(closer) = closers.last().copied() {
            at = self.space(at);
            match self.byte(at) {
                Some(b',') if closer == b'}' => return Ok((self.key(self.space(at + 1))?, false)),
                Some(b',') => return Ok((at + 1, false)),
                Some(b) if b == closer => {
                    closers.pop();
                    at += 1;
                }
                _ => return Err(JsonError { at, why: "a comma or a closing bracket is missing" }),
            }
        }
        Ok((at, true))
    }

    /// A name and its colon.
    fn key(&self, at: usize) -> Result<usize, JsonError> {
        if self.byte(at) != Some(b'"') {
            return Err(JsonError { at, why: "a name in quotes is missing" });
        }
        let colon = self.space(self.string(at)?);
        match self.byte(colon) {
            Some(b':') => Ok(colon + 1),
            _ => Err(JsonError { at: colon, why: "a colon is missing" }),
        }
    }

    fn string(&self, begin: usize) -> Result<usize, JsonError> {
        let mut at = begin + 1;
        loop {
            match self.byte(at) {
                Some(b'"') => return Ok(at + 1),
                Some(b'\\') => at = self.escape(at)?,
                Some(0..0x20) => return Err(JsonError { at, why: "a control character stands in a string" }),
                Some(_) => at += 1,
                None => return Err(JsonError { at: begin, why: "a string does not end" }),
            }
        }
    }

    fn escape(&self, at: usize) -> Result<usize, JsonError> {
        match self.byte(at + 1) {
            Some(b'"' | b'\\' | b'/' | b'b' | b'f' | b'n' | b'r' | b't') => Ok(at + 2),
            Some(b'u') if self.0.get(at + 2..at + 6).is_some_and(|d| d.iter().all(u8::is_ascii_hexdigit)) => Ok(at + 6),
            _ => Err(JsonError { at, why: "an escape is unknown" }),
        }
    }

    fn scalar(&self, at: usize) -> Result<usize, JsonError> {
        for word in ["null", "true", "false", "NaN", "Infinity", "-Infinity"] {
            if self.0[at.min(self.0.len())..].starts_with(word.as_bytes()) {
                return Ok(at + word.len());
            }
        }
        self.numeral(at).ok_or(JsonError { at, why: "a value is missing" })
    }

    fn digits(&self, mut at: usize) -> Option<usize> {
        let begin = at;
        while self.byte(at).is_some_and(|b| b.is_ascii_digit()) {
            at += 1;
        }
        (at > begin).then_some(at)
    }

    fn numeral(&self, at: usize) -> Option<usize> {
        let begin = if self.byte(at) == Some(b'-') { at + 1 } else { at };
        let mut end = self.digits(begin)?;
        if self.byte(begin) == Some(b'0') {
            end = begin + 1;
        }
        if self.byte(end) == Some(b'.') {
            end = self.digits(end + 1)?;
        }
        if matches!(self.byte(end), Some(b'e' | b'E')) {
            let sign = usize::from(matches!(self.byte(end + 1), Some(b'+' | b'-')));
            end = self.digits(end + 1 + sign)?;
        }
        Some(end)
    }
}

/// Appends `json` as Python writes it compactly: no spaces, ASCII only. With `shortest` every real number is
/// written as the shortest text that reads back as the same double, otherwise as it stands.
pub fn write_compact(out: &mut String, json: Json<'_>, shortest: bool) {
    let (text, scan) = (json.0, Scan(json.0.as_bytes()));
    let mut at = 0;
    while let Some(byte) = scan.byte(at) {
        let end = match byte {
            b'"' => scan.string(at).unwrap_or(text.len()),
            b'-' | b'0'..=b'9' => scan.scalar(at).unwrap_or(text.len()),
            _ => at + 1,
        };
        let part = &text[at..end];
        match byte {
            b' ' | b'\t' | b'\n' | b'\r' => {}
            b'"' => write_units(out, Units(part[1..part.len() - 1].chars(), None)),
            b'-' | b'0'..=b'9' if shortest && part.contains(['.', 'e', 'E']) => {
                write_number(out, Json(part).number().unwrap_or(f64::NAN));
            }
            _ => out.push_str(part),
        }
        at = end;
    }
}

/// Appends `text` as a JSON string in ASCII.
pub fn write_string(out: &mut String, text: &str) {
    write_units(out, text.encode_utf16());
}

fn write_units(out: &mut String, units: impl Iterator<Item = u16>) {
    out.push('"');
    for unit in units {
        match unit {
            0x22 => out.push_str("\\\""),
            0x5c => out.push_str("\\\\"),
            0x20..=0x7e => out.push(char::from(unit as u8)),
            8 => out.push_str("\\b"),
            9 => out.push_str("\\t"),
            10 => out.push_str("\\n"),
            12 => out.push_str("\\f"),
            13 => out.push_str("\\r"),
            _ => out.push_str(&format!("\\u{unit:04x}")),
        }
    }
    out.push('"');
}

/// Appends a double as Python writes it: the shortest digits that read back as the same double, with an exponent
/// below 10⁻⁴ and from 10¹⁶ on.
pub fn write_number(out: &mut String, x: f64) {
    if x.is_nan() {
        return out.push_str("NaN");
    }
    if x.is_infinite() {
        return out.push_str(if x > 0.0 { "Infinity" } else { "-Infinity" });
    }
    let size = x.abs();
    if size == 0.0 || (1e-4..1e16).contains(&size) {
        return out.push_str(&format!("{x:?}"));
    }
    let text = format!("{x:e}");
    let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
    let (sign, exponent) = exponent.strip_prefix('-').map_or(('+', exponent), |e| ('-', e));
    out.push_str(&format!("{digits}e{sign}{exponent:0>2}"));
}

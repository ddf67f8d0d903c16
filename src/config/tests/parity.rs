//! The located tree means what `serde_yaml` means, and no input makes it panic.

use std::sync::Arc;

use proptest::prelude::*;

use crate::config::error::Source;
use crate::config::source::text_of;
use crate::config::tree::parse;

fn mine(text: &str) -> Option<serde_json::Value> {
    let source: Arc<Source> = text_of("t.yaml", text.as_bytes().to_vec()).ok()?;
    Some(parse(&source, 0).ok()?.to_json())
}

fn theirs(text: &str) -> Option<serde_json::Value> {
    serde_yaml::from_str(text).ok()
}

/// Every construct of YAML that the tree accepts, and its traps.
const TEXTS: &[&str] = &[
    "a: yes\nb: no\nc: on\nd: off\ne: y\nf: ~\ng:\nh: null\n",
    "a: 1e3\nb: 0o17\nc: 0x1f\nd: 017\ne: 1_000\nf: +5\ng: -0\nh: .5\ni: 1.\n",
    "a: 2001-12-14\nb: 12:30:45\nc: 1:30\nd: v1.2.3\n",
    "a: \"1\"\nb: '1'\nc: \"\"\nd: ''\ne: \"a\\nb\\t\\u00e9\\x41\"\nf: 'it''s'\n",
    "a: |\n  one\n  two\nb: >\n  one\n  two\n\n  three\nc: |-\n  x\nd: |+\n  x\n\ne: >-\n  y\n  z\n",
    "a: |2\n    indented\n  less\n",
    "a: one\n  two\n  three\nb: \"one\n  two\"\nc: 'one\n\n  two'\n",
    "a: &x 1\nb: *x\nc: &y {p: 1, q: [1, 2]}\nd: *y\ne: [*x, *y]\n",
    "a: [1, 2, [3, {b: c}], ]\nd: {e: f, g: , h}\n",
    "- 1\n- - 2\n  - 3\n- a: b\n  c: d\n-\n- null\n",
    "a:\n- 1\n- 2\nb:\n  - 3\n",
    "? a\n: b\n? c\n",
    "--- \na: b\n...\n",
    "%YAML 1.2\n---\na: b\n",
    "# only\na: b # comment\nc: d#not\ne: '#'\nf: a #b\n",
    "a: http://x.y/z?q=1&r=2\nb: a:b\nc: -x\nd: ?x\ne: a,b\nf: [a:b]\n",
    "\"quoted key\": 1\n'other': 2\nwith space: 3\n",
    "a: {\"b\":1}\nc: [\"d\",'e']\n",
    "a: \"line \\\n  continued\"\n",
    "a:\tb\n",
    "ä: ö\n日本: 語\n",
    "a: !\nb: c\n",
    "42",
    "text",
    "\"a\"",
    "[]",
    "{}",
    "a: b\r\nc: d\r\n",
    "\u{feff}a: b\n",
];

#[test]
fn both_parsers_agree_on_every_construct() {
    let mut accepted = 0;
    for text in TEXTS {
        if let Some(value) = mine(text) {
            assert_eq!(Some(value), theirs(text), "{text}");
            accepted += 1;
        }
    }
    assert!(accepted >= TEXTS.len() - 3, "only {accepted} of {} were accepted", TEXTS.len());
}

/// Corners in which YAML 1.1 and 1.2 differ, found by the property test below.
#[test]
fn what_the_parsers_read_differently_is_refused() {
    for text in ["&a: ", ">\n a: "] {
        let source = text_of("t.yaml", text.as_bytes().to_vec()).unwrap();
        let mistakes = parse(&source, 0).unwrap_err();
        assert_eq!(mistakes[0].message, "versions of YAML read this differently", "{text}");
        assert!(theirs(text).is_some());
    }
}

#[test]
fn both_parsers_agree_on_every_shipped_file() {
    for (path, text) in crate::config::embedded::EMBEDDED {
        assert_eq!(mine(text), theirs(text), "{path}");
        assert!(mine(text).is_some(), "{path}");
    }
}

/// A random value, made of what an experiment may hold.
fn value() -> impl Strategy<Value = serde_json::Value> {
    let number = any::<f64>().prop_filter("finite", |x| x.is_finite()).prop_map(Into::into);
    let leaf = prop_oneof![
        Just(serde_json::Value::Null),
        any::<bool>().prop_map(Into::into),
        any::<i64>().prop_map(Into::into),
        any::<u64>().prop_map(Into::into),
        number,
        "\\PC{0,12}".prop_map(Into::into),
        "[-+0-9xobe.~ :#'\"\\[\\]{},&*!|>%@?a\n]{0,8}".prop_map(Into::into),
    ];
    leaf.prop_recursive(4, 32, 5, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Into::into),
            prop::collection::btree_map("\\PC{1,8}", inner, 0..5)
                .prop_map(|m| serde_json::Value::Object(m.into_iter().collect())),
        ]
    })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 400, failure_persistence: None, ..Default::default() })]

    #[test]
    fn what_serde_yaml_writes_is_read_as_it_was(value in value()) {
        let text = serde_yaml::to_string(&value).unwrap();
        // some characters are refused as unusual; `<<` is no key of an experiment
        if let Some(read) = mine(&text) {
            prop_assert_eq!(read, value, "{}", text);
        } else {
            prop_assert!(text.contains("<<") || text.chars().any(|c| c.is_control() && c != '\n' || "\u{feff}\u{2028}\u{2029}".contains(c)), "{}", text);
        }
    }

    #[test]
    fn texts_that_both_accept_mean_the_same(text in "([a-c]: |- |[ ]{1,3}|\n|[0-9.e+x~-]{1,4}|[\\[\\]{},'\"#&*?|>!%:]|[a-c]{1,3}){0,25}") {
        if let (Some(mine), Some(theirs)) = (mine(&text), theirs(&text)) {
            prop_assert_eq!(mine, theirs, "{}", text);
        }
    }

    #[test]
    fn no_bytes_make_it_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        if let Ok(source) = text_of("t.yaml", bytes) {
            let _ = parse(&source, 0);
        }
    }

    #[test]
    fn no_text_makes_it_panic(text in "([\\[\\]{},:?|>'\"&*!%@`#~ \t\n<=-]|\\PC|a|b: ){0,80}") {
        if let Ok(source) = text_of("t.yaml", text.into_bytes()) {
            let _ = parse(&source, 0);
        }
    }
}

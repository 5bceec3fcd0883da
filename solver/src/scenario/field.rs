//! The vocabulary of the field table: fields, sections, types, defaults and ranges.

use std::fmt;

use serde_json::{Value, json};

/// A field of the scenario.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    /// JSON pointer of the field; its last name ends in the unit.
    pub pointer: &'static str,
    /// Allowed values.
    pub kind: FieldKind,
    /// Unit; empty without one.
    pub unit: &'static str,
    /// The default.
    pub default: Preset,
    /// The default under `"condition": "wet"`, where it differs.
    pub wet: Option<Preset>,
    /// Whether the field belongs only to the experiments whose declaration names it. Other experiments refuse it.
    pub by_name: bool,
    /// The value in experiments that do not name the field, where it differs from the default.
    pub otherwise: Option<Preset>,
    /// The field that makes this one null when it is given: exactly one of the two is in use.
    pub yields_to: Option<&'static str>,
    /// Whether the field acts only from t = 0 on: fills that differ in it alone are the same.
    pub from_start: bool,
    /// Source of the default.
    pub source: &'static str,
    /// Meaning, in one sentence.
    pub doc: &'static str,
}

/// A section of a scenario: an object of fields, or a list of such objects.
#[derive(Clone, Copy, Debug)]
pub struct Section {
    /// JSON pointer.
    pub pointer: &'static str,
    /// For a list: the pointer of its items in the table, with `*` for the index.
    pub items: Option<&'static str>,
    /// Maximum number of items of a list.
    pub max_items: usize,
    /// The experiment that the section belongs to; none belongs to all.
    pub experiment: Option<&'static str>,
    /// Content, in one sentence.
    pub doc: &'static str,
}

/// The allowed values of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum FieldKind {
    /// A number.
    Number(Range),
    /// A number, or null.
    Nullable(Range),
    /// A number, or the word `auto`.
    NumberOrAuto(Range),
    /// A whole number (`191.0` is one).
    Integer(Range),
    /// One of some words.
    Choice(&'static [&'static str]),
    /// True or false.
    Flag,
    /// A whole number, or null.
    NullableInteger(Range),
    /// A list of length, width and thickness, each within the range.
    Sizes(Range),
    /// Three numbers, each within the range.
    Vector(Range),
    /// Three whole numbers, each within the range.
    Counts(Range),
    /// Text of at most [`LONGEST_TEXT`] characters.
    Text,
    /// A mesh by the digest of its file, with its unit; or null.
    Mesh,
    /// Three vectors, a corner and two edges, each number within the range; or null.
    Plate(Range),
}

/// Maximum number of characters of a text.
pub const LONGEST_TEXT: usize = 60;
/// Maximum number of surfaces.
pub const MAX_SURFACES: usize = 1000;
/// Maximum number of bodies of a scene, that of `/product/count`.
pub const MAX_BODIES: usize = 100_000;
/// Maximum number of sizes.
pub const MAX_SIZES: usize = 32;

/// A default value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Preset {
    /// No default: the document must have the field.
    Required,
    /// Null.
    Null,
    /// A number.
    Number(f64),
    /// A whole number.
    Integer(u64),
    /// A word.
    Word(&'static str),
    /// True or false.
    Flag(bool),
    /// Length, width and thickness of each size.
    Sizes(&'static [[f64; 3]]),
    /// Three numbers.
    Vector([f64; 3]),
    /// Three whole numbers.
    Counts([u64; 3]),
    /// The value of another field, earlier in the table.
    SameAs(&'static str),
}

/// An interval of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Range {
    /// Lower bound.
    pub low: f64,
    /// Upper bound.
    pub high: f64,
    /// Whether the lower bound itself is out.
    pub low_open: bool,
    /// Whether the upper bound itself is out.
    pub high_open: bool,
}

/// From `low` to `high`, both included.
pub const fn from_to(low: f64, high: f64) -> Range {
    Range { low, high, low_open: false, high_open: false }
}

/// Above `low`, which is out, up to `high`.
pub const fn above_to(low: f64, high: f64) -> Range {
    Range { low, high, low_open: true, high_open: false }
}

/// Between `low` and `high`, both out.
pub const fn between(low: f64, high: f64) -> Range {
    Range { low, high, low_open: true, high_open: true }
}

impl Range {
    /// Whether `number` lies within; NaN never does.
    pub fn contains(&self, number: f64) -> bool {
        let above = if self.low_open { number > self.low } else { number >= self.low };
        let below = if self.high_open { number < self.high } else { number <= self.high };
        above && below
    }
}

impl fmt::Display for Range {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (above, below) = (if self.low_open { '>' } else { '≥' }, if self.high_open { '<' } else { '≤' });
        write!(f, "{above} {} and {below} {}", plain(self.low), plain(self.high))
    }
}

/// A number with an exponent where that is much shorter.
pub(super) fn plain(number: f64) -> String {
    let (digits, exponent) = (format!("{number}"), format!("{number:e}"));
    if exponent.len() + 3 < digits.len() { exponent } else { digits }
}

impl Preset {
    /// The value; none without a default, or where another field holds it.
    pub fn value(&self) -> Option<Value> {
        match *self {
            Self::Required | Self::SameAs(_) => None,
            Self::Null => Some(Value::Null),
            Self::Number(number) => Some(json!(number)),
            Self::Integer(number) => Some(json!(number)),
            Self::Word(word) => Some(json!(word)),
            Self::Flag(flag) => Some(json!(flag)),
            Self::Sizes(sizes) => Some(json!(sizes)),
            Self::Vector(vector) => Some(json!(vector)),
            Self::Counts(counts) => Some(json!(counts)),
        }
    }
}

impl Field {
    /// The name of the field: the last part of its pointer.
    pub fn name(&self) -> &'static str {
        self.pointer.rsplit('/').next().unwrap_or_default()
    }

    /// The name as a heading: without its unit, in words.
    pub fn title(&self) -> String {
        let name = self.name();
        let stem = match unit_suffix(self.unit) {
            suffix if suffix.is_empty() => name,
            suffix => name.strip_suffix(suffix.as_str()).unwrap_or(name),
        };
        let mut letters = stem.replace('_', " ").chars().collect::<Vec<_>>();
        letters[0] = letters[0].to_ascii_uppercase();
        letters.into_iter().collect()
    }

    /// The allowed values in words, with the unit.
    pub fn allowed(&self) -> String {
        let range = |range: Range| match self.unit {
            "" => range.to_string(),
            unit => format!("{range} {unit}"),
        };
        match self.kind {
            FieldKind::Number(within) => range(within),
            FieldKind::Nullable(within) => format!("{}, or null", range(within)),
            FieldKind::NumberOrAuto(within) => format!("{}, or \"auto\"", range(within)),
            FieldKind::Integer(within) => format!("a whole number {}", range(within)),
            FieldKind::Choice([only]) => format!("\"{only}\""),
            FieldKind::Choice(words) => format!("one of \"{}\"", words.join("\", \"")),
            FieldKind::Flag => "true or false".to_owned(),
            FieldKind::NullableInteger(within) => format!("a whole number {}, or null", range(within)),
            FieldKind::Vector(within) => format!("three numbers {}", range(within)),
            FieldKind::Counts(within) => format!("three whole numbers {}", range(within)),
            FieldKind::Text => format!("text of at most {LONGEST_TEXT} characters"),
            FieldKind::Mesh => {
                "{\"digest\": blake3 of the STL file in hex, \"units\": \"mm\" or \"m\"}, or null".to_owned()
            }
            FieldKind::Plate(within) => {
                format!("a corner and two edges, each three numbers {}; or null", range(within))
            }
            FieldKind::Sizes(within) => format!("1 to {MAX_SIZES} sizes of three numbers {}", range(within)),
        }
    }
}

/// The suffix of a name for its unit: `_kg_m3` for kg/m³.
pub fn unit_suffix(unit: &str) -> String {
    match unit {
        "" => String::new(),
        "°" => "_deg".to_owned(),
        "°/s" => "_deg_s".to_owned(),
        _ => format!("_{}", unit.to_lowercase().replace(['/', ' '], "_").replace('²', "2").replace('³', "3")),
    }
}

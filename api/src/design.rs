//! Designs of sweeps: factors, their combination to design points, and extensions.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::words::words;

words!(
    /// How levels are combined to design points.
    DesignKind {
        /// Every combination of all levels, the last factor varying fastest.
        Grid = "grid",
        /// The base, then each level of each factor with all other factors as in the base.
        OneAtATime = "one_at_a_time",
        /// Independent random points, uniform over each factor.
        Random = "random",
        /// Random points, exactly one in each of `points` equal parts of every factor.
        LatinHypercube = "latin_hypercube",
        /// Points of a Sobol sequence with Owen's scrambling, which cover the factors evenly; best at powers of two.
        Sobol = "sobol",
        /// Box–Behnken points, for quadratic models of 3 to 7 factors: two or three factors are low or high, and the others in the
        /// middle. One more point is the centre.
        BoxBehnken = "box_behnken",
        /// The points in `rows`.
        List = "list",
        /// The points in `table`.
        Csv = "csv",
    }
);

/// How levels are combined to design points. The description of a field names the kinds that take it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The kind.
    pub kind: DesignKind,
    /// Number of points: `random`, `latin_hypercube` and `sobol`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u32>,
    /// Seed of these points, independent of the seeds of jobs; 1 unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// `list`: a row for each point, with a value for each factor in order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<Value>>>,
    /// `csv`: the text of a CSV file, with a column for each factor under its pointer, and a line for each point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
}

words!(
    /// The scale of values between `low` and `high`.
    Scale {
        /// Linear.
        Linear = "linear",
        /// Logarithmic.
        Log = "log",
    }
);

/// A factor: one field, or several fields with the same value, and its levels or range.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// JSON pointer of the scenario field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
    /// In place of `pointer`: several fields with the same value. The first one names the factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointers: Option<Vec<String>>,
    /// Its levels: numbers, words, or any value of the field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<Vec<Value>>,
    /// In place of levels: the lowest value of the range.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// The highest value of the range. Values of an integer field are integers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// Scale between the two; `linear` unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scale>,
    /// Number of levels from `low` to `high` in a `grid` or `one_at_a_time`; 2 unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
}

impl Factor {
    /// The pointers of its fields.
    pub fn fields(&self) -> Vec<&str> {
        let linked = self.pointers.iter().flatten().map(String::as_str);
        self.pointer.as_deref().into_iter().chain(linked).collect()
    }

    /// The name of the factor, which is the pointer of its first field.
    pub fn name(&self) -> &str {
        self.fields().first().copied().unwrap_or_default()
    }
}

/// An extension of a sweep: more points of the same design, more replicates of all points, or both.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Extension {
    /// `random` and `sobol`: number of further points of the same sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u32>,
    /// `grid` and `one_at_a_time`: further levels by factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<BTreeMap<String, Vec<Value>>>,
    /// `list` and `csv`: further rows, as in the design.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<Value>>>,
    /// `list` and `csv`: further rows as the text of a CSV file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
    /// Every design: number of further replicates of each point, with the next seeds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replicates: Option<u32>,
}

//! Designs of sweeps: what is varied, how values are combined to points, and how a sweep is extended.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

use crate::job::words;

words!(
    /// How values are combined to design points.
    DesignKind {
        /// Every combination of all levels, the last factor varying fastest.
        Grid = "grid",
        /// The base, then each factor through its levels with all others as in the base.
        OneAtATime = "one_at_a_time",
        /// Points drawn independently, every value of a factor as likely as any other.
        Random = "random",
        /// Points drawn so that each of `points` equal parts of every factor holds exactly one.
        LatinHypercube = "latin_hypercube",
        /// Points of a Sobol sequence with Owen's scrambling: even at every length, most so at powers of two.
        Sobol = "sobol",
        /// Box and Behnken's points on the middles of edges, for quadratic models of 3 to 7 factors, with one centre.
        BoxBehnken = "box_behnken",
        /// The points in `rows`.
        List = "list",
        /// The points in `table`.
        Csv = "csv",
    }
);

/// How values are combined to design points. Which fields a kind takes, it says in their descriptions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Design {
    /// The kind.
    pub kind: DesignKind,
    /// How many points to draw: `random`, `latin_hypercube` and `sobol`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u32>,
    /// Seed of the same; 1 unless given. It has nothing to do with the seeds of the runs.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// `list`: a row a point, a value a factor in their order.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<Value>>>,
    /// `csv`: the text of a CSV file, a column a factor with its pointer as heading, a line a point.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
}

words!(
    /// How values lie between `low` and `high`.
    Scale {
        /// Evenly.
        Linear = "linear",
        /// Evenly in their logarithms.
        Log = "log",
    }
);

/// A varied input: one field, or several that take the same value, and the values it may take.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Factor {
    /// JSON pointer of the scenario field.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointer: Option<String>,
    /// In its place: several fields, which take the same value; the factor is called by the first.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pointers: Option<Vec<String>>,
    /// Its values: numbers, words or whatever the field takes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<Vec<Value>>,
    /// In place of levels: the lowest value of a number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low: Option<f64>,
    /// The highest value. Of a field of whole numbers, whole numbers are taken.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high: Option<f64>,
    /// How values lie between the two; `linear` unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scale: Option<Scale>,
    /// How many levels there are from `low` to `high` in a `grid` or `one_at_a_time`; 2 unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub count: Option<u32>,
}

impl Factor {
    /// The fields that it varies.
    pub fn fields(&self) -> Vec<&str> {
        let linked = self.pointers.iter().flatten().map(String::as_str);
        self.pointer.as_deref().into_iter().chain(linked).collect()
    }

    /// What it is called: the pointer of its first field.
    pub fn name(&self) -> &str {
        self.fields().first().copied().unwrap_or_default()
    }
}

/// More of a sweep: points of the same design, replicates of all points, or both.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Extension {
    /// `random` and `sobol`: so many more points of the same sequence.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<u32>,
    /// `grid` and `one_at_a_time`: more levels, by the name of their factor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub levels: Option<BTreeMap<String, Vec<Value>>>,
    /// `list` and `csv`: more rows, as in the design.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rows: Option<Vec<Vec<Value>>>,
    /// `list` and `csv`: more rows as the text of a CSV file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
    /// Every design: so many more runs of every point, with the seeds that follow.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replicates: Option<u32>,
}

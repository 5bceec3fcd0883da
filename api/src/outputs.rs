//! The table of results: what each experiment returns.

use roost_solver::experiments::{all_curves, all_responses, all_series};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A response: a number, an indicator, a word, or true or false.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct ResponseRow {
    /// Name, with its unit last.
    pub name: String,
    /// Unit; empty without one.
    pub unit: String,
    /// `number`, `indicator` (1 if an event happened, else 0), `word` or `boolean`.
    pub r#type: String,
    /// Meaning.
    pub meaning: String,
    /// Experiments that return it.
    pub experiments: Vec<String>,
    /// Whether short tables show it.
    pub headline: bool,
}

/// A quantity sampled over belt time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct SeriesRow {
    /// Name; `<name>` in it stands for the name of a surface.
    pub name: String,
    /// Unit, `1` without one.
    pub unit: String,
    /// Meaning.
    pub meaning: String,
    /// Experiments that return it.
    pub experiments: Vec<String>,
    /// Whether pictures of a result show it.
    pub headline: bool,
    /// Whether the last value holds after the end of the simulation.
    pub constant_after_end: bool,
}

/// A quantity over something other than time.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct CurveRow {
    /// Name.
    pub name: String,
    /// Unit, `1` without one.
    pub unit: String,
    /// Quantity along the curve.
    pub over: String,
    /// Unit of that quantity, `1` without one.
    pub over_unit: String,
    /// Meaning.
    pub meaning: String,
    /// Experiments that return it.
    pub experiments: Vec<String>,
    /// Whether pictures of a result show it.
    pub headline: bool,
    /// Whether each point is of one body, with no value between two points.
    pub per_body: bool,
}

/// The results of all experiments. One row serves all experiments that show a result alike; a row is unique by name and
/// experiment.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct OutputTable {
    /// Responses.
    pub responses: Vec<ResponseRow>,
    /// Series.
    pub series: Vec<SeriesRow>,
    /// Curves.
    pub curves: Vec<CurveRow>,
}

impl OutputTable {
    /// The table of this solver.
    pub fn of_solver() -> Self {
        let words = |words: &[&str]| words.iter().map(|word| (*word).to_owned()).collect();
        let response = all_responses().into_iter().map(|shared| ResponseRow {
            name: shared.row.name.to_owned(),
            unit: shared.row.unit.to_owned(),
            r#type: shared.row.kind.as_str().to_owned(),
            meaning: shared.row.doc.to_owned(),
            experiments: words(&shared.experiments),
            headline: shared.row.headline,
        });
        let series = all_series().into_iter().map(|shared| SeriesRow {
            name: shared.row.name.to_owned(),
            unit: shared.row.unit.to_owned(),
            meaning: shared.row.doc.to_owned(),
            experiments: words(&shared.experiments),
            headline: shared.row.headline,
            constant_after_end: shared.row.constant_after_end,
        });
        let curve = all_curves().into_iter().map(|shared| CurveRow {
            name: shared.row.name.to_owned(),
            unit: shared.row.unit.to_owned(),
            over: shared.row.over.to_owned(),
            over_unit: shared.row.over_unit.to_owned(),
            meaning: shared.row.doc.to_owned(),
            experiments: words(&shared.experiments),
            headline: shared.row.headline,
            per_body: shared.row.per_body,
        });
        Self { responses: response.collect(), series: series.collect(), curves: curve.collect() }
    }
}

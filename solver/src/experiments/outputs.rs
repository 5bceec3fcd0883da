//! The table of results: what each experiment returns as responses, series and curves.
//!
//! The rows of an experiment stand with it; rows that several experiments share stand here. Documents, API, command
//! and dashboard read this table.

use std::collections::BTreeSet;
use std::sync::LazyLock;

use super::{ALL, definition};
use crate::observe::{Clock, Recorder, SeriesId};
use crate::result::Curve;
use crate::scenario::{DECLARATIONS, Declaration, Experiment};

/// Type of a response.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResponseType {
    /// A number.
    Number,
    /// 1 if an event happened, else 0: its mean over replicates is a share.
    Indicator,
    /// True or false.
    Boolean,
    /// A word.
    Word,
}

impl ResponseType {
    /// Its name.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Number => "number",
            Self::Indicator => "indicator",
            Self::Boolean => "boolean",
            Self::Word => "word",
        }
    }
}

/// A response: a number, an indicator, a word, or true or false. A response that was not reached is null.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResponseDefinition {
    /// Name, with its unit last.
    pub name: &'static str,
    /// Unit; empty without one.
    pub unit: &'static str,
    /// Type.
    pub kind: ResponseType,
    /// Meaning, in one sentence.
    pub doc: &'static str,
    /// Whether short tables show it.
    pub headline: bool,
}

/// A quantity sampled over time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SeriesRow {
    /// Name.
    pub name: &'static str,
    /// Unit, `1` without one.
    pub unit: &'static str,
    /// Clock.
    pub clock: Clock,
    /// Meaning, in one sentence.
    pub doc: &'static str,
    /// Whether pictures of a result show it.
    pub headline: bool,
    /// Whether the last value holds after the end of the simulation.
    pub constant_after_end: bool,
}

/// A quantity over something other than time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurveRow {
    /// Name.
    pub name: &'static str,
    /// Unit, `1` without one.
    pub unit: &'static str,
    /// Quantity along the curve, such as `strain`.
    pub over: &'static str,
    /// Unit of that quantity.
    pub over_unit: &'static str,
    /// Meaning, in one sentence.
    pub doc: &'static str,
    /// Whether pictures of a result show it.
    pub headline: bool,
    /// Whether each point is of one body, with no value between two points.
    pub per_body: bool,
}

/// The results of an experiment. Tables and pictures keep this order.
#[derive(Clone, Copy, Debug)]
pub struct Outputs {
    /// Every response that a run returns, whatever its options and its end. A cancelled run has none.
    pub responses: &'static [ResponseDefinition],
    /// Every series.
    pub series: &'static [SeriesRow],
    /// Every curve.
    pub curves: &'static [CurveRow],
}

pub(super) const fn number(name: &'static str, unit: &'static str, doc: &'static str) -> ResponseDefinition {
    ResponseDefinition { name, unit, kind: ResponseType::Number, doc, headline: false }
}

/// 1 if an event happened, else 0.
pub(super) const fn indicator(name: &'static str, doc: &'static str) -> ResponseDefinition {
    ResponseDefinition { name, unit: "", kind: ResponseType::Indicator, doc, headline: false }
}

pub(super) const fn boolean(name: &'static str, doc: &'static str) -> ResponseDefinition {
    ResponseDefinition { name, unit: "", kind: ResponseType::Boolean, doc, headline: false }
}

pub(super) const fn word(name: &'static str, doc: &'static str) -> ResponseDefinition {
    ResponseDefinition { name, unit: "", kind: ResponseType::Word, doc, headline: false }
}

/// A series from t = 0 on.
pub(super) const fn series(name: &'static str, unit: &'static str, doc: &'static str) -> SeriesRow {
    SeriesRow { name, unit, clock: Clock::Belt, doc, headline: false, constant_after_end: false }
}

pub(super) const fn curve(
    name: &'static str,
    unit: &'static str,
    (over, over_unit): (&'static str, &'static str),
    doc: &'static str,
) -> CurveRow {
    CurveRow { name, unit, over, over_unit, doc, headline: false, per_body: false }
}

impl ResponseDefinition {
    pub(super) const fn headline(self) -> Self {
        Self { headline: true, ..self }
    }
}

impl SeriesRow {
    pub(super) const fn headline(self) -> Self {
        Self { headline: true, ..self }
    }

    pub(super) const fn constant_after_end(self) -> Self {
        Self { constant_after_end: true, ..self }
    }
}

impl CurveRow {
    /// The curve with these points.
    pub(super) fn curve(&self, x: Vec<f64>, values: Vec<f64>) -> Curve {
        let [name, unit, over, over_unit] =
            [self.name, self.unit, self.over, self.over_unit].map(str::to_owned);
        Curve { name, unit, over, over_unit, x, values }
    }

    pub(super) const fn headline(self) -> Self {
        Self { headline: true, ..self }
    }

    pub(super) const fn per_body(self) -> Self {
        Self { per_body: true, ..self }
    }
}

pub(super) const BONDS_INTACT_FRACTION: ResponseDefinition = number(
    "bonds_intact_fraction",
    "",
    "Share of unbroken bonds among all bonds. A bond that was unbroken when one of its sub-particles left the simulation counts as \
     unbroken until the end.",
);
pub(super) const MAX_OVERLAP_RATIO: ResponseDefinition = number(
    "max_overlap_ratio",
    "",
    "Maximum overlap of two sub-particles that no bond joins, divided by R. The maximum covers the whole simulation. The overlap is the \
     distance by which the two spheres penetrate each other. The ratio can exceed 1 while fillets drop onto each other.",
);
pub(super) const KINETIC_ENERGY_END_J: ResponseDefinition =
    number("kinetic_energy_end_j", "J", "Kinetic energy of all bodies at the end of the simulation.");
pub(super) const ESCAPED_KG: ResponseDefinition = number(
    "escaped_kg",
    "kg",
    "Mass that left the simulated space (a box around all bodies and surfaces), for example fragments (broken parts of fillets), or \
     fillets that fell beside the equipment. In a hopper, mass that passed the gate does not count. If no body should leave the simulated \
     space, this mass is 0 in a correct simulation.",
);
pub(super) const PASSED_THROUGH: ResponseDefinition = number(
    "passed_through",
    "",
    "Number of times that a sub-particle went through a surface to the other side of this surface. A sub-particle that moves \
     around an edge of the surface does not count. The number is 0 in a correct simulation.",
);
pub(super) const KINETIC_ENERGY: SeriesRow = SeriesRow {
    clock: Clock::Simulated,
    ..series(
        "kinetic_energy",
        "J",
        "Kinetic energy of all bodies, from translation and rotation. In `hopper`, `bend` and `slide`, samples from before t = 0 have negative \
         times.",
    )
};
pub(super) const BONDS_INTACT: SeriesRow = SeriesRow {
    clock: Clock::Simulated,
    ..series(
        "bonds_intact_fraction",
        "1",
        "Share of unbroken bonds among all bonds. In `hopper`, `bend` and `slide`, samples from before t = 0 have negative times.",
    )
    .constant_after_end()
};

impl Recorder {
    /// Adds the series of a row.
    pub(super) fn add_row(&mut self, row: &SeriesRow) -> SeriesId {
        self.add(row.name, row.unit, row.clock)
    }
}

/// The results of an experiment.
pub fn outputs(experiment: &Experiment) -> &'static Outputs {
    definition(experiment).outputs()
}

/// The results of an experiment by its word under `/experiment`.
pub fn outputs_of(experiment: &str) -> Option<&'static Outputs> {
    ALL.iter().find(|(name, _)| *name == experiment).map(|(_, outputs)| *outputs)
}

/// Names of the responses that a run of this experiment returns, sorted.
pub fn response_names(experiment: &Experiment) -> Vec<&'static str> {
    let mut names: Vec<_> = outputs(experiment).responses.iter().map(|response| response.name).collect();
    names.sort_unstable();
    names
}

/// Whether a response of this name is an indicator, in any experiment.
pub fn is_indicator(response: &str) -> bool {
    static NAMES: LazyLock<BTreeSet<&'static str>> = LazyLock::new(|| {
        let rows = ALL.iter().flat_map(|(_, outputs)| outputs.responses);
        rows.filter(|row| row.kind == ResponseType::Indicator).map(|row| row.name).collect()
    });
    NAMES.contains(response)
}

/// A row of the table with the experiments that have it.
#[derive(Clone, Debug)]
pub struct Shared<T> {
    /// The row.
    pub row: T,
    /// Words of the experiments.
    pub experiments: Vec<&'static str>,
}

/// Rows of all experiments. Experiments whose rows are equal, `headline` included, share one.
fn merged<T: Copy + PartialEq + 'static>(rows: impl Fn(&Outputs) -> &'static [T]) -> Vec<Shared<T>> {
    let mut merged: Vec<Shared<T>> = Vec::new();
    for (experiment, outputs) in ALL {
        for row in rows(outputs) {
            match merged.iter_mut().find(|known| known.row == *row) {
                Some(known) => known.experiments.push(experiment),
                None => merged.push(Shared { row: *row, experiments: vec![experiment] }),
            }
        }
    }
    merged
}

/// The responses of all experiments.
pub fn all_responses() -> Vec<Shared<ResponseDefinition>> {
    merged(|outputs| outputs.responses)
}

/// The series of all experiments.
pub fn all_series() -> Vec<Shared<SeriesRow>> {
    merged(|outputs| outputs.series)
}

/// The curves of all experiments.
pub fn all_curves() -> Vec<Shared<CurveRow>> {
    merged(|outputs| outputs.curves)
}

/// The results of an experiment as Markdown tables.
pub fn output_tables_markdown(experiment: &str) -> String {
    let Some(outputs) = outputs_of(experiment) else { return String::new() };
    let mut page = String::from("| response | unit | type | meaning |\n|---|---|---|---|\n");
    for row in outputs.responses {
        page += &line(&[&format!("`{}`", row.name), row.unit, row.kind.as_str(), row.doc]);
    }
    page += "\n| series | unit | over | meaning |\n|---|---|---|---|\n";
    for row in outputs.series {
        page += &line(&[&format!("`{}`", row.name), unit(row.unit), "belt time", row.doc]);
    }
    if !outputs.curves.is_empty() {
        page += "\n| curve | unit | over | meaning |\n|---|---|---|---|\n";
    }
    for row in outputs.curves {
        page += &line(&[&format!("`{}`", row.name), unit(row.unit), &format!("`{}`", row.over), row.doc]);
    }
    page
}

/// The experiments with their questions and first headline responses, as a Markdown table; `pages` is the folder of their pages.
pub fn overview_markdown(pages: &str) -> String {
    let mut page = String::from("| experiment | question | main responses |\n|---|---|---|\n");
    for Declaration { name, question, .. } in DECLARATIONS {
        let responses = outputs_of(name).into_iter().flat_map(|outputs| outputs.responses);
        let main: Vec<_> =
            responses.filter(|row| row.headline).take(3).map(|row| format!("`{}`", row.name)).collect();
        page += &format!("| [{name}]({pages}{name}.md) | {question} | {} |\n", main.join(", "));
    }
    page
}

fn unit(unit: &str) -> &str {
    if unit == "1" { "" } else { unit }
}

pub(super) fn line(cells: &[&str]) -> String {
    let cells: Vec<_> = cells.iter().map(|cell| cell.replace('|', "\\|")).collect();
    format!("| {} |\n", cells.join(" | "))
}

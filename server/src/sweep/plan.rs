//! From the specification to a plan: factors with the values that they take, and how points are made of them. Every fault of
//! both is told.

use roost_api::Fault;
use roost_api::design::{Design, DesignKind, Factor};
use roost_api::sweep::SweepSpec;
use serde_json::{Value, json};

use super::draw::{MAX_SOBOL_FACTORS, MAX_SOBOL_POINTS};
use super::levels::same;
use super::matrix::BOX_BEHNKEN_FACTORS;
use super::values::Values;
use super::{inputs, names, rows};
use crate::document::fault;

/// What is varied and how.
#[derive(Clone, Debug)]
pub(super) struct Plan {
    pub(super) factors: Vec<Input>,
    pub(super) points: Points,
}

/// A factor: fields that take the same value.
#[derive(Clone, Debug)]
pub(super) struct Input {
    pub(super) fields: Vec<String>,
    pub(super) values: Values,
}

impl Input {
    /// What it is called: its first field.
    pub(super) fn name(&self) -> &str {
        self.fields.first().map_or("", String::as_str)
    }
}

/// How points are made of the values.
#[derive(Clone, Debug)]
pub(super) enum Points {
    Grid,
    OneAtATime,
    Random { points: u32, seed: u64 },
    LatinHypercube { points: u32, seed: u64 },
    Sobol { points: u32, seed: u64 },
    BoxBehnken,
    Rows(Vec<Vec<Value>>),
}

/// The seed of a design that names none.
const SEED: u64 = 1;

/// The factors of a specification; those of a table without others are its columns.
pub(crate) fn factors(spec: &SweepSpec) -> Vec<Factor> {
    match &spec.design.table {
        Some(table) if spec.factors.is_empty() => {
            let column = |pointer| Factor { pointer: Some(pointer), ..Factor::default() };
            rows::headings(table).into_iter().map(column).collect()
        }
        _ => spec.factors.clone(),
    }
}

/// Plans a sweep whose complete base is known, unless that is at fault; none where something of the plan is at fault.
pub(super) fn plan(spec: &SweepSpec, complete: Option<&Value>, faults: &mut Vec<Fault>) -> Option<Plan> {
    let before = faults.len();
    let factors = factors(spec);
    names::check(&factors, complete, faults);
    if factors.is_empty() && spec.design.kind != DesignKind::Grid {
        let detail = "nothing is varied; replicates alone are a grid without factors";
        faults.push(fault("/factors", json!([]), detail, "at least one factor"));
    }
    let mut inputs = Vec::new();
    for (index, factor) in factors.iter().enumerate() {
        let at = format!("/factors/{index}");
        let fields: Vec<String> = factor.fields().into_iter().map(str::to_owned).collect();
        let mut values = inputs::values(&at, factor, spec.design.kind, faults);
        if let (DesignKind::OneAtATime, Some(Values::Levels(levels)), Some(complete)) =
            (spec.design.kind, &mut values, complete)
        {
            // The base is a point already.
            let base = fields.first().and_then(|field| complete.pointer(field));
            levels.retain(|level| !base.is_some_and(|base| same(base, level)));
        }
        inputs.extend(values.map(|values| Input { fields, values }));
    }
    let points = points(&spec.design, &factors, faults)?;
    (faults.len() == before).then_some(Plan { factors: inputs, points })
}

/// The fields of a design that a kind takes.
fn takes(kind: DesignKind) -> &'static [&'static str] {
    match kind {
        DesignKind::Grid | DesignKind::OneAtATime | DesignKind::BoxBehnken => &[],
        DesignKind::Random | DesignKind::LatinHypercube | DesignKind::Sobol => &["points", "seed"],
        DesignKind::List => &["rows"],
        DesignKind::Csv => &["table"],
    }
}

fn points(design: &Design, factors: &[Factor], faults: &mut Vec<Fault>) -> Option<Points> {
    let kind = design.kind;
    let given = [
        ("points", design.points.map(|points| json!(points))),
        ("seed", design.seed.map(|seed| json!(seed))),
        ("rows", design.rows.as_ref().map(|rows| json!(rows.len()))),
        ("table", design.table.as_ref().map(|table| json!(table.len()))),
    ];
    for (name, value) in given {
        let is_taken = takes(kind).contains(&name);
        match value {
            Some(value) if !is_taken => {
                let allowed = match takes(kind) {
                    [] => "nothing beside `kind`".to_owned(),
                    names => format!("{} beside `kind`", names.join(", ")),
                };
                faults.push(fault(
                    &format!("/design/{name}"),
                    value,
                    &format!("{kind} takes no such field"),
                    &allowed,
                ));
            }
            None if is_taken && name != "seed" => {
                faults.push(fault(
                    &format!("/design/{name}"),
                    Value::Null,
                    &format!("{kind} needs this field"),
                    "",
                ));
            }
            _ => {}
        }
    }
    if let Some(seed) = design.seed.filter(|seed| *seed > (1 << 53) - 1) {
        faults.push(fault("/design/seed", json!(seed), "out of range", "0 to 2^53 - 1"));
    }
    if design.points == Some(0) {
        faults.push(fault("/design/points", json!(0), "a sweep has at least one point", "1 or more"));
    }
    let seed = design.seed.unwrap_or(SEED);
    let names: Vec<String> = factors.iter().map(|factor| factor.name().to_owned()).collect();
    match kind {
        DesignKind::Grid => Some(Points::Grid),
        DesignKind::OneAtATime => Some(Points::OneAtATime),
        DesignKind::Random => Some(Points::Random { points: design.points?, seed }),
        DesignKind::LatinHypercube => Some(Points::LatinHypercube { points: design.points?, seed }),
        DesignKind::Sobol => {
            let points = design.points?;
            if factors.len() > MAX_SOBOL_FACTORS {
                let allowed = format!("at most {MAX_SOBOL_FACTORS}");
                faults.push(fault(
                    "/factors",
                    json!(factors.len()),
                    "too many for a Sobol sequence",
                    &allowed,
                ));
            }
            check_sobol("/design/points", points, points.into(), faults);
            Some(Points::Sobol { points, seed })
        }
        DesignKind::BoxBehnken => {
            if !BOX_BEHNKEN_FACTORS.contains(&factors.len()) {
                let (low, high) = (BOX_BEHNKEN_FACTORS.start(), BOX_BEHNKEN_FACTORS.end());
                let detail = "there is no Box-Behnken design of so many factors";
                faults.push(fault(
                    "/factors",
                    json!(factors.len()),
                    detail,
                    &format!("{low} to {high} factors"),
                ));
            }
            Some(Points::BoxBehnken)
        }
        DesignKind::List => {
            let rows = design.rows.clone()?;
            rows::check("/design/rows", &rows, factors.len(), faults);
            rows::repeats("/design/rows", &rows, &[], faults);
            Some(Points::Rows(rows))
        }
        DesignKind::Csv => {
            let before = faults.len();
            let rows = rows::of_table("/design/table", design.table.as_ref()?, &names, faults);
            if faults.len() == before {
                rows::check("/design/table", &rows, factors.len(), faults);
                rows::repeats("/design/table", &rows, &[], faults);
            }
            Some(Points::Rows(rows))
        }
    }
}

/// Looks whether a Sobol sequence goes as far as that.
pub(super) fn check_sobol(at: &str, asked: u32, end: u64, faults: &mut Vec<Fault>) {
    if end > u64::from(MAX_SOBOL_POINTS) {
        let detail = format!("the sequence would have {end} points");
        faults.push(fault(at, json!(asked), &detail, &format!("at most {MAX_SOBOL_POINTS} points in all")));
    }
}

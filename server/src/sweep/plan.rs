//! From the specification to a plan: factors with the values that they take, and how points are made of them. Every fault of
//! both is told.

use roost_api::Fault;
use roost_api::design::{Design, DesignKind, Factor, Scale};
use roost_api::sweep::SweepSpec;
use roost_solver::scenario::field::Kind;
use roost_solver::scenario::fields;
use serde_json::{Value, json};

use super::draw::{MAX_SOBOL_FACTORS, MAX_SOBOL_POINTS};
use super::levels::{self, same};
use super::matrix::BOX_BEHNKEN_FACTORS;
pub(super) use super::values::{Between, Values};
use super::{names, rows};
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
        let mut values = values(&at, factor, spec.design.kind, faults);
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

/// The values of a factor in a design of that kind; none when they are at fault.
fn values(at: &str, factor: &Factor, kind: DesignKind, faults: &mut Vec<Fault>) -> Option<Values> {
    let before = faults.len();
    let numbers = [
        ("low", factor.low.map(|low| json!(low))),
        ("high", factor.high.map(|high| json!(high))),
        ("scale", factor.scale.map(|scale| json!(scale))),
        ("count", factor.count.map(|count| json!(count))),
    ];
    let given: Vec<(&str, Value)> =
        numbers.into_iter().filter_map(|(name, value)| value.map(|value| (name, value))).collect();
    if matches!(kind, DesignKind::List | DesignKind::Csv) {
        let levels = factor.levels.as_ref().map(|levels| ("levels", json!(levels)));
        for (name, value) in given.into_iter().chain(levels) {
            let detail = format!("in a {kind} the rows say which values a factor takes");
            faults.push(fault(&format!("{at}/{name}"), value, &detail, "`pointer` or `pointers` alone"));
        }
        return Some(Values::Listed);
    }
    if let Some(levels) = &factor.levels {
        for (name, value) in given {
            faults.push(fault(
                &format!("{at}/{name}"),
                value,
                "the factor has `levels` already",
                "levels, or low and high",
            ));
        }
        check_levels(&format!("{at}/levels"), levels, faults);
        if kind == DesignKind::BoxBehnken && levels.len() != 3 {
            let detail = format!("{} levels of a Box-Behnken design", levels.len());
            faults.push(fault(
                &format!("{at}/levels"),
                json!(levels),
                &detail,
                "three: low, middle and high; or `low` and `high`",
            ));
        }
        return (faults.len() == before).then(|| Values::Levels(levels.clone()));
    }
    let (Some(low), Some(high)) = (factor.low, factor.high) else {
        let (name, detail) = match (factor.low, factor.high) {
            (Some(_), None) => ("high", "`low` stands without `high`"),
            (None, Some(_)) => ("low", "`high` stands without `low`"),
            _ => ("levels", "a factor needs values"),
        };
        faults.push(fault(&format!("{at}/{name}"), Value::Null, detail, "`levels`, or `low` and `high`"));
        return None;
    };
    let between = between(at, factor, low, high, faults)?;
    let by_levels = matches!(kind, DesignKind::Grid | DesignKind::OneAtATime);
    if let Some(count) = factor.count.filter(|_| !by_levels) {
        let detail = format!("{kind} has no use for a number of levels");
        faults.push(fault(
            &format!("{at}/count"),
            json!(count),
            &detail,
            "`count` is for grid and one_at_a_time",
        ));
    }
    if let Some(count) = factor.count.filter(|count| !(2..=MAX_COUNT).contains(count)) {
        faults.push(fault(
            &format!("{at}/count"),
            json!(count),
            "not a number of levels",
            &format!("2 to {MAX_COUNT}"),
        ));
    }
    if faults.len() > before {
        return None;
    }
    let count = match kind {
        DesignKind::Grid | DesignKind::OneAtATime => factor.count.unwrap_or(2),
        DesignKind::BoxBehnken => 3,
        _ => return Some(Values::Between(between)),
    };
    let levels = between.spread(count);
    if levels.windows(2).any(|pair| same(&pair[0], &pair[1])) {
        let detail =
            format!("there are no {count} different whole numbers at equal distances from {low} to {high}");
        faults.push(fault(at, json!(factor), &detail, "a wider range, or `levels`"));
        return None;
    }
    Some(Values::Levels(levels))
}

/// The most levels that a range is cut into.
const MAX_COUNT: u32 = 1000;

fn between(at: &str, factor: &Factor, low: f64, high: f64, faults: &mut Vec<Fault>) -> Option<Between> {
    let before = faults.len();
    let scale = factor.scale.unwrap_or(Scale::Linear);
    if low >= high {
        faults.push(fault(
            &format!("{at}/high"),
            json!(high),
            "not above `low`",
            &format!("more than {low}"),
        ));
    }
    if scale == Scale::Log && low <= 0.0 {
        let detail = "a logarithmic scale has no such number";
        faults.push(fault(&format!("{at}/low"), json!(low), detail, "more than 0, or a linear scale"));
    }
    let fields: Vec<_> = factor.fields().into_iter().filter_map(fields::find).collect();
    for field in &fields {
        for (name, end) in [("low", low), ("high", high)] {
            if !levels::fits(field, &json!(end)) {
                let detail = format!("not a value of {}", field.pointer);
                faults.push(fault(&format!("{at}/{name}"), json!(end), &detail, &field.allowed()));
            }
        }
    }
    let is_integer = |kind| matches!(kind, Kind::Integer(_) | Kind::NullableInteger(_));
    let is_whole =
        fields.iter().any(|field| is_integer(field.kind)) || factor.fields().iter().any(|at| counts(at));
    (faults.len() == before).then_some(Between { low, high, scale, is_whole })
}

/// Whether a pointer leads to one of three whole numbers.
fn counts(pointer: &str) -> bool {
    let parent = pointer.rsplit_once('/').and_then(|(parent, _)| fields::find(parent));
    parent.is_some_and(|field| matches!(field.kind, Kind::Counts(_)))
}

/// Looks for levels that stand there twice, or not at all.
pub(super) fn check_levels(at: &str, levels: &[Value], faults: &mut Vec<Fault>) {
    if levels.is_empty() {
        faults.push(fault(at, json!([]), "a factor needs levels", "at least one value"));
    }
    for (index, value) in levels.iter().enumerate() {
        if rows::place(value, &levels[..index]).is_some() {
            let detail = "the level is listed twice; more runs of a point are what `replicates` is for";
            faults.push(fault(&format!("{at}/{index}"), value.clone(), detail, ""));
        }
    }
}

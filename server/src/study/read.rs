//! Reading a study: its sweep at the corners of the range and at every level, then its question. Every fault of both is listed.

use roost_api::Fault;
use roost_api::design::{Design, DesignKind, Factor, Scale};
use roost_api::study::{SCHEMA, StudySpec};
use roost_api::sweep::SweepSpec;
use roost_design::{Goal, Question};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::field::FieldKind;
use roost_solver::scenario::{self, fields};
use serde::Deserialize;
use serde_json::{Value, json};

use super::{Present, Study, calibration, measures, ranges};
use crate::document::{fault, is_within, read_leniently};
use crate::measurements::Lab;
use crate::sweep::{self, Expansion, Points, Posterior, SweepLimits, is_whole};

/// Number of combinations of ends and levels up to which all of them are checked.
const ALL_CORNERS: usize = 64;
/// The field whose values a study chooses itself.
const SEED: &str = "/seed";

/// Reads a submitted study, and the expansion of its sweep at the corners of the range, or lists every fault.
pub(crate) fn read(
    document: Value,
    meshes: &Meshes,
    limits: SweepLimits,
) -> Result<(Study, Expansion), Vec<Fault>> {
    let (spec, mut faults) = read_leniently::<StudySpec>(document);
    let Some(mut spec) = spec else { return Err(faults) };
    let lab = calibration::lab(&spec, Some((meshes, &limits.scenario)));
    let lab = lab.and_then(|lab| lab.map_err(|found| faults.extend(found)).ok());
    match &lab {
        Some(lab) => {
            calibration::check_members(&spec, lab, &mut faults);
            spec.base = lab.tests.first().map(|test| test.base.clone()).unwrap_or_default();
        }
        None if spec.goal.get("calibrate").is_some() => return Err(faults),
        None if spec.base.is_null() => {
            faults.push(fault("/base", Value::Null, "is missing", "the scenario that the factors vary"));
        }
        None => {}
    }
    check_factors(&spec, &mut faults);
    if let Some(schema) = spec.schema.as_deref().filter(|schema| *schema != SCHEMA) {
        faults.push(fault("/schema", json!(schema), "unknown schema", SCHEMA));
    }
    if u64::from(spec.budget.max_runs) > limits.max_jobs {
        let allowed = format!("at most {} (max_jobs_per_sweep)", limits.max_jobs);
        faults.push(fault(
            "/budget/max_runs",
            json!(spec.budget.max_runs),
            "more runs than a sweep may have",
            &allowed,
        ));
    }
    let question = question(&spec, lab.as_ref(), spec.budget.max_runs, Question::read)
        .map_err(|found| faults.extend(found))
        .ok();
    // Read apart from the question, whose other faults would hide those of its responses and sweeps.
    let goal = Goal::deserialize(&spec.goal).ok();
    check_seeding(&spec, goal.as_ref(), &mut faults);
    if let Some(goal) = &goal {
        check_measures(goal, &spec.base, &mut faults);
    }
    if spec.factors.is_empty() {
        return Err(faults);
    }
    let corners = corners(&spec.factors);
    let mut read_corners = |base: &Value| {
        let sweep = json!(SweepSpec { base: base.clone(), ..sweep_of(&spec, &corners) });
        sweep::read(sweep, meshes, limits).map_err(|found| {
            for found in found.into_iter().map(|fault| at_factor(fault, &corners, &spec.factors)) {
                // An end or a level is in several corners.
                let is_same =
                    |known: &Fault| (&known.pointer, &known.value) == (&found.pointer, &found.value);
                if !faults.iter().any(is_same) {
                    faults.push(found);
                }
            }
        })
    };
    let expansion = read_corners(&spec.base);
    // The parameters must suit the other tests as well.
    let others = lab.iter().flat_map(|lab| lab.tests.iter().skip(1));
    let others: Vec<_> = others.map(|test| read_corners(&test.base)).collect();
    let expansion = expansion.map(|(sweep, mut expansion)| {
        // A run takes the mean time of the tests.
        let all = others.iter().flatten().map(|(_, other)| other.wall_s);
        expansion.wall_s = (expansion.wall_s + all.sum::<f64>()) / (others.len() + 1) as f64;
        (sweep, expansion)
    });
    if let (Some(posterior), Ok((_, expansion))) =
        (spec.posterior.as_ref().and_then(Posterior::of), &expansion)
    {
        // A run draws any of the samples.
        for corner in expansion.points.iter() {
            let all = posterior.check(&corner.scenario, 0..posterior.len(), (meshes, &limits.scenario));
            faults.extend(all.err().into_iter().flatten());
        }
    }
    match (question, expansion) {
        (Some(question), Ok((_, expansion))) if faults.is_empty() => {
            let points = expansion.points.clone();
            let seed = expansion.base.seed;
            let first_ranges = ranges::ranges(&spec.factors);
            let (seeding, past_attempts) = (Vec::new(), 0);
            let impossible = Vec::new();
            let tests = lab.map(|lab| calibration::tests(&lab, &spec.factors)).unwrap_or_default();
            let study = Study {
                spec,
                question,
                points,
                tests,
                seed,
                seeding,
                first_ranges,
                past_attempts,
                impossible,
            };
            Ok((study, expansion))
        }
        _ => Err(faults),
    }
}

impl Study {
    /// A stored study as it is now, or the faults that this server finds in it.
    pub(crate) fn stored(present: Present) -> Result<Self, Vec<Fault>> {
        let spec = present.spec();
        let lab = calibration::lab(&spec, None).transpose()?;
        let question = question(&spec, lab.as_ref(), present.max_runs, Question::read_stored)?;
        let tests = lab.map(|lab| calibration::tests(&lab, &spec.factors)).unwrap_or_default();
        let base = scenario::from_value(&spec.base)?;
        let points = Points::without_rows(&spec.base, &base, &spec.factors);
        Ok(Self {
            spec,
            question,
            points,
            tests,
            seed: base.seed,
            seeding: present.seeding,
            first_ranges: ranges::ranges(&present.submitted.factors),
            past_attempts: present.past_attempts,
            impossible: present.impossible,
        })
    }
}

/// The question of a study, or its faults with pointers into the study.
fn question(
    spec: &StudySpec,
    lab: Option<&Lab>,
    max_runs: u32,
    read: fn(&Value) -> Result<Question, Vec<roost_design::Fault>>,
) -> Result<Question, Vec<Fault>> {
    let factor = |factor: &Factor| {
        if let Some(levels) = &factor.levels {
            return json!({"name": factor.name(), "levels": levels});
        }
        let (scale, is_whole) = (factor.scale.unwrap_or(Scale::Linear), is_whole(factor));
        json!({"name": factor.name(), "low": factor.low, "high": factor.high, "scale": scale, "is_whole": is_whole})
    };
    let mut budget = json!(spec.budget);
    budget["max_runs"] = json!(max_runs);
    let mut factors: Vec<Value> = spec.factors.iter().map(factor).collect();
    factors.extend(lab.and_then(calibration::test_factor));
    let goal = lab.map_or_else(|| spec.goal.clone(), |lab| calibration::goal(&spec.goal, lab));
    let document = json!({"factors": factors, "goal": goal, "budget": budget});
    read(&document).map_err(|faults| faults.into_iter().map(of_question).collect())
}

fn of_question(found: roost_design::Fault) -> Fault {
    // A factor has a pointer here, and a name there.
    let pointer = match found.pointer.strip_suffix("/name") {
        Some(factor) => format!("{factor}/pointer"),
        None => found.pointer,
    };
    fault(&pointer, found.value, &found.detail, &found.allowed)
}

/// Checks that factors are ranges of numbers, or lists of levels.
fn check_factors(spec: &StudySpec, faults: &mut Vec<Fault>) {
    let complete = scenario::from_value(&spec.base).map(|base| json!(base)).unwrap_or_default();
    for (index, factor) in spec.factors.iter().enumerate() {
        let at = format!("/factors/{index}");
        if let Some(count) = factor.count {
            let detail = "a study chooses the values of a range itself";
            faults.push(fault(&format!("{at}/count"), json!(count), detail, "`low` and `high`, or `levels`"));
        }
        let ends = [("low", factor.low.map(|low| json!(low))), ("high", factor.high.map(|high| json!(high)))];
        let scale = ("scale", factor.scale.map(|scale| json!(scale)));
        if factor.levels.is_some() {
            for (name, value) in ends.into_iter().chain([scale]) {
                if let Some(value) = value {
                    let detail = "a factor has either a range or levels";
                    faults.push(fault(&format!("{at}/{name}"), value, detail, "`levels` alone"));
                }
            }
        } else {
            for (name, _) in ends.into_iter().filter(|(_, value)| value.is_none()) {
                let detail = "a factor of a study has both ends of its range, or levels";
                faults.push(fault(&format!("{at}/{name}"), Value::Null, detail, "a number"));
            }
        }
        for pointer in factor.fields() {
            let kind = fields::find(pointer).map(|field| field.kind);
            let is_number = match kind {
                Some(kind) => matches!(
                    kind,
                    FieldKind::Number(_)
                        | FieldKind::Nullable(_)
                        | FieldKind::NumberOrAuto(_)
                        | FieldKind::Integer(_)
                        | FieldKind::NullableInteger(_)
                ),
                // A part of a list, such as the height of a surface. A field that does not exist has a fault of its own.
                None => complete.pointer(pointer).is_none_or(Value::is_number),
            };
            if pointer == SEED {
                let detail = "a study chooses the seed of each run itself";
                faults.push(fault(&format!("{at}/pointer"), json!(pointer), detail, "another field"));
            } else if !is_number && factor.levels.is_none() {
                let detail = "this field is no number and has no range";
                let allowed = "`levels` for words, true and false; a range for a field with a number, such as /equipment/gate_opening_m";
                faults.push(fault(&format!("{at}/pointer"), json!(pointer), detail, allowed));
            }
        }
    }
}

/// Checks the list of sweeps that a study begins with.
fn check_seeding(spec: &StudySpec, goal: Option<&Goal>, faults: &mut Vec<Fault>) {
    if matches!(goal, Some(Goal::Sensitivity(_))) && !spec.seeded_by.is_empty() {
        let detail = "a sensitivity rests on the points of its own design, which no sweep has";
        faults.push(fault("/seeded_by", json!(spec.seeded_by), detail, "no sweeps, or another goal"));
    }
    if spec.posterior.is_some() && !spec.seeded_by.is_empty() {
        let detail = "the runs of a sweep have other parameters than those that this study draws";
        faults.push(fault("/seeded_by", json!(spec.seeded_by), detail, "no sweeps, or no `posterior`"));
    }
    for (index, sweep) in spec.seeded_by.iter().enumerate() {
        if spec.seeded_by[..index].contains(sweep) {
            let at = format!("/seeded_by/{index}");
            faults.push(fault(&at, json!(sweep), "the sweep is listed twice", "each sweep once"));
        }
    }
}

/// Checks the responses of the goal, where the base has no fault.
fn check_measures(goal: &Goal, base: &Value, faults: &mut Vec<Fault>) {
    let Ok(base) = scenario::from_value(base) else { return };
    let mut found = Vec::new();
    measures::check(goal, &base.experiment, &mut found);
    // The question has listed a response without a name.
    let is_listed =
        |new: &Fault| new.value == "" && faults.iter().any(|known| is_within(&new.pointer, &known.pointer));
    found.retain(|new| !is_listed(new));
    faults.append(&mut found);
}

/// The values of a factor at the corners of the range: both ends, or every level.
fn corner_values(factor: &Factor) -> Vec<Value> {
    let number = |value: f64| {
        if is_whole(factor) && value.fract() == 0.0 { json!(value as i64) } else { json!(value) }
    };
    match &factor.levels {
        Some(levels) if !levels.is_empty() => levels.clone(),
        _ => vec![number(factor.low.unwrap_or(0.0)), number(factor.high.unwrap_or(1.0))],
    }
}

/// The corners of the range: rows of ends and levels, the first with the first of each, the last with the last. Of many combinations, one
/// other value at a time.
fn corners(factors: &[Factor]) -> Vec<Vec<Value>> {
    let values: Vec<Vec<Value>> = factors.iter().map(corner_values).collect();
    let count = values.iter().fold(1_usize, |count, values| count.saturating_mul(values.len()));
    let first: Vec<Value> = values.iter().map(|values| values[0].clone()).collect();
    if count > ALL_CORNERS {
        let last = values.iter().map(|values| values[values.len() - 1].clone()).collect();
        let others = values.iter().enumerate().flat_map(|(place, values)| {
            let first = &first;
            values[1..].iter().map(move |value| {
                let mut row = first.clone();
                row[place] = value.clone();
                row
            })
        });
        return [first.clone()].into_iter().chain(others).chain([last]).collect();
    }
    let mut rows = vec![Vec::new()];
    for values in values {
        let longer = |row: &Vec<Value>| -> Vec<Vec<Value>> {
            values.iter().map(|value| [row.as_slice(), std::slice::from_ref(value)].concat()).collect()
        };
        rows = rows.iter().flat_map(longer).collect();
    }
    rows
}

/// The specification of a study's sweep: a list of the two corners of the range.
pub(super) fn sweep_spec(spec: &StudySpec) -> SweepSpec {
    let corners = corners(&spec.factors);
    let ends: Vec<Vec<Value>> = corners.first().into_iter().chain(corners.last()).cloned().collect();
    sweep_of(spec, &ends)
}

fn sweep_of(spec: &StudySpec, rows: &[Vec<Value>]) -> SweepSpec {
    let factors = spec.factors.iter().map(|factor| Factor {
        pointer: factor.pointer.clone(),
        pointers: factor.pointers.clone(),
        ..Factor::default()
    });
    SweepSpec {
        schema: None,
        name: spec.name.clone(),
        base: spec.base.clone(),
        design: Design {
            kind: DesignKind::List,
            points: None,
            seed: None,
            rows: Some(rows.to_vec()),
            table: None,
        },
        factors: factors.collect(),
        replicates: 1,
        posterior: spec.posterior.clone(),
        priority: spec.priority,
        labels: spec.labels.clone(),
        needs: spec.needs.clone(),
        max_wall_s: spec.max_wall_s,
        frame_interval_s: None,
        cache: spec.cache,
        // No two runs have the same seed, and thus the same fill.
        shared_fill: false,
    }
}

/// Moves a fault at a corner to the end of the factor's range, or to its level.
fn at_factor(found: Fault, corners: &[Vec<Value>], factors: &[Factor]) -> Fault {
    let place = found.pointer.strip_prefix("/design/rows/").and_then(|rest| {
        let (row, rest) = rest.split_once('/')?;
        let factor = rest.split('/').next()?.parse::<usize>().ok()?;
        let value = corners.get(row.parse::<usize>().ok()?)?.get(factor)?;
        let place = corner_values(factors.get(factor)?).iter().position(|other| other == value)?;
        Some(match (&factors[factor].levels, place) {
            (Some(_), level) => format!("/factors/{factor}/levels/{level}"),
            (None, 0) => format!("/factors/{factor}/low"),
            (None, _) => format!("/factors/{factor}/high"),
        })
    });
    match place {
        Some(pointer) => Fault { pointer, ..found },
        None => found,
    }
}

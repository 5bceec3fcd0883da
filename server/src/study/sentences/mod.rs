//! Question and answer of a study in sentences; `boundary`, `optimise` and `calibrate` state the findings of these goals, `sources` the
//! runs that come from elsewhere.

mod boundary;
mod calibrate;
mod optimise;
mod sources;

pub(crate) use sources::left_out;

use roost_api::quantity::Quantity;
use roost_api::study::{Driver, StudyEnd, StudyState};
use roost_design::goals::{Constraint, Effects, EstimateAnswer, Objective, SensitivityAnswer, SobolIndices};
use roost_design::intervals::Estimated;
use roost_design::{Answer, ExcludedPoint, Finding, Goal, Measure};
use serde_json::Value;

use super::Study;
use super::measures::measures;
use super::trials::Known;
use super::words::{digits, level, list, measure, range, value};

/// The beginning of the first sentence about evidence.
const EVIDENCE: &str = "The answer rests on";

/// The beginning of the first sentence about assumptions.
const ASSUMPTIONS: &str = "It holds for";

/// Points of an estimate that are stated in words; the table has all of them.
const MAX_STATED: usize = 12;

/// The question in words.
pub(super) fn question(study: &Study) -> String {
    let ranges: Vec<String> = study
        .question
        .factors
        .iter()
        .map(|factor| {
            let quantity = Quantity::of_field(&factor.name);
            if factor.is_categorical() {
                let levels: Vec<String> = factor.levels.iter().map(|value| level(factor, value)).collect();
                return format!("{} of {}", quantity.name, alternatives(&levels));
            }
            format!("{} from {}", quantity.name, range(&quantity, factor.low, factor.high))
        })
        .collect();
    let over = list(&ranges);
    match &study.question.goal {
        Goal::Estimate(goal) => {
            let measures: Vec<String> = goal
                .intervals
                .iter()
                .map(|interval| {
                    format!(
                        "{} to within {}",
                        measure(&interval.of),
                        value(&interval.of, interval.width / 2.0)
                    )
                })
                .collect();
            format!("What is {} at {} points of {over}?", list(&measures), goal.points.len())
        }
        Goal::Boundary(goal) => {
            let (what, level) = (measure(&goal.of), value(&goal.of, goal.level));
            format!("Where is {what} equal to {level}, for {over}?")
        }
        Goal::Optimise(goal) => {
            let objectives: Vec<String> = goal
                .objectives
                .iter()
                .map(|objective| match objective {
                    Objective::Minimise(of) => format!("minimises {}", measure(of)),
                    Objective::Maximise(of) => format!("maximises {}", measure(of)),
                })
                .collect();
            let constraints: Vec<String> = goal.constraints.iter().map(constraint).collect();
            let under = if constraints.is_empty() {
                String::new()
            } else {
                format!(", so that {}", list(&constraints))
            };
            format!("What {} for {over}{under}?", list(&objectives))
        }
        Goal::Sensitivity(goal) => {
            let measures: Vec<String> = goal.of.iter().map(measure).collect();
            format!("Which factors matter for {}, over {over}?", list(&measures))
        }
        Goal::Calibrate(_) => {
            let name = study.spec.goal.pointer("/calibrate/measurements/name").and_then(Value::as_str);
            calibrate::question(&study.question, name.unwrap_or_default())
        }
    }
}

/// Levels in words: `a, b or c`.
fn alternatives(levels: &[String]) -> String {
    match levels {
        [first @ .., last] if !first.is_empty() => format!("{} or {last}", first.join(", ")),
        _ => levels.concat(),
    }
}

fn constraint(constraint: &Constraint) -> String {
    let what = measure(&constraint.of);
    match (constraint.at_most, constraint.at_least) {
        (Some(limit), _) => format!("{what} is at most {}", value(&constraint.of, limit)),
        (None, limit) => format!("{what} is at least {}", value(&constraint.of, limit.unwrap_or_default())),
    }
}

/// The answer in words: finding, evidence, what was left out, and assumptions.
pub(super) fn answer(study: &Study, answer: &Answer, known: &Known) -> Vec<String> {
    let mut sentences = match &answer.finding {
        Finding::Estimate(finding) => estimate(study, finding),
        Finding::Boundary(finding) => boundary::sentences(study, finding),
        Finding::Optimise(finding) => optimise::sentences(study, finding),
        Finding::Sensitivity(finding) => sensitivity(finding),
        Finding::Calibrate(finding) => calibrate::sentences(finding),
    };
    let runs = answer.runs;
    let failed = if runs.failed > 0 { format!("; {} more failed", runs.failed) } else { String::new() };
    sentences.push(format!("{EVIDENCE} {} runs{failed}.", runs.done));
    sentences.extend(unfinished(study, known));
    sentences.extend(sources::sentences(study, known));
    sentences.extend(growth(study));
    sentences.extend(excluded(study, &answer.excluded));
    for of in &answer.unusable {
        let counts = [
            (of.missing, "without a value"),
            (of.not_binary, "with a value that is neither 0 nor 1"),
            (of.outliers, "with a value far from all others"),
        ];
        let counts = counts.iter().filter(|(runs, _)| *runs > 0).map(|(runs, why)| format!("{runs} {why}"));
        let response = of.of.response();
        sentences.push(format!(
            "Of these runs, the response `{response}` leaves out {}.",
            list(&counts.collect::<Vec<_>>())
        ));
    }
    sentences.push(assumptions(study));
    sentences.extend(sources::assumption(study));
    sentences.extend(drawn(study));
    sentences
}

/// Sentences of an answer with the part that each belongs to: `answer`, `evidence` or `assumptions`.
pub(crate) fn parts(sentences: &[String]) -> impl Iterator<Item = (&'static str, &String)> {
    let mut part = "answer";
    sentences.iter().map(move |sentence| {
        part = match part {
            "answer" if sentence.starts_with(EVIDENCE) => "evidence",
            "evidence" if sentence.starts_with(ASSUMPTIONS) => "assumptions",
            _ => part,
        };
        (part, sentence)
    })
}

/// The runs that could still have jammed, if the question is about jams.
fn unfinished(study: &Study, known: &Known) -> Option<String> {
    let is_about_jams = measures(&study.question.goal).iter().any(|(_, of)| of.response() == "jammed");
    (is_about_jams && known.unfinished > 0).then(|| {
        let runs = if known.unfinished == 1 { "run" } else { "runs" };
        format!(
            "{} {runs} without a jam ended with at least 5 % of the filled mass inside: a later jam does not count. A longer `/numerics/duration_s` would count it.",
            known.unfinished
        )
    })
}

/// The parameters that the runs draw from a posterior.
fn drawn(study: &Study) -> Option<String> {
    let parameters = study.spec.posterior.as_ref()?.parameters.as_ref()?;
    let names: Vec<String> = parameters.iter().map(|pointer| Quantity::of_field(pointer).name).collect();
    Some(format!(
        "Every run draws {} from a posterior: probabilities, means and their intervals are over these parameters and chance.",
        list(&names)
    ))
}

/// The points that were left out, and why.
fn excluded(study: &Study, excluded: &[ExcludedPoint]) -> Vec<String> {
    let places = |points: &[&ExcludedPoint]| -> Vec<String> {
        points.iter().take(MAX_STATED).map(|point| place(study, &point.values)).collect()
    };
    let (impossible, failed): (Vec<_>, Vec<_>) =
        excluded.iter().partition(|point| point.impossible.is_some());
    let mut sentences = Vec::new();
    if !failed.is_empty() {
        let places = list(&places(&failed));
        sentences.push(format!("Left out because their runs fail or lack responses: {places}."));
    }
    if let Some(reason) = impossible.first().and_then(|point| point.impossible.as_ref()) {
        let points = if impossible.len() == 1 { "1 point" } else { &format!("{} points", impossible.len()) };
        let shown = if impossible.len() > MAX_STATED { ", among them" } else { ":" };
        let places = list(&places(&impossible));
        sentences
            .push(format!("Left out because no scenario has their values are {points}{shown} {places}."));
        sentences.push(format!("The first of these faults: {reason}."));
        if matches!(study.question.goal, Goal::Sensitivity(_)) {
            sentences.push(
                "Without these points the factors are not independent: their indices and intervals are only a guide."
                    .to_owned(),
            );
        }
    }
    sentences
}

/// Whether a study goes on, or why it does not.
pub(crate) fn state(
    (state, driver): (StudyState, Driver),
    finished: Option<StudyEnd>,
    max_runs: u32,
    reason: Option<&str>,
) -> String {
    match (state, finished) {
        (StudyState::Running, _) => match driver {
            Driver::Server => "The study goes on.".to_owned(),
            Driver::Client => "The study goes on when a client asks it for runs.".to_owned(),
        },
        (StudyState::Paused, _) => match reason {
            Some(reason) => format!("The server has paused the study: {reason}."),
            None => "The study is paused.".to_owned(),
        },
        (StudyState::Cancelled, _) => "A user has cancelled the study.".to_owned(),
        (StudyState::Finished, Some(StudyEnd::ByRule)) => {
            "The study ended because the answer is as certain as asked.".to_owned()
        }
        (StudyState::Finished, Some(StudyEnd::NothingLeft)) => {
            "The study ended because no point can be run any more.".to_owned()
        }
        (StudyState::Finished, _) => {
            format!(
                "The study ended because its budget of {max_runs} runs is spent; a larger budget continues it."
            )
        }
    }
}

/// The ranges that have grown since the study was submitted, as they were.
fn growth(study: &Study) -> Option<String> {
    let factors = study.question.factors.iter().zip(&study.first_ranges);
    let grown = factors.filter(|(factor, (low, high))| factor.low < *low || factor.high > *high);
    let parts: Vec<String> = grown
        .map(|(factor, (low, high))| {
            let quantity = Quantity::of_field(&factor.name);
            let (before, now) = (range(&quantity, *low, *high), range(&quantity, factor.low, factor.high));
            format!("{} was {before} and is {now} now", quantity.name)
        })
        .collect();
    (!parts.is_empty()).then(|| format!("The ranges have grown since the study began: {}.", list(&parts)))
}

/// The assumptions of the answer beside its factors.
fn assumptions(study: &Study) -> String {
    if !study.tests.is_empty() {
        return calibrate::assumptions(&study.question);
    }
    let base = study.points.complete_base();
    let number = |pointer: &str| base.pointer(pointer).and_then(serde_json::Value::as_f64);
    let mut parts = Vec::new();
    if let Some(radius_m) = number("/product/subparticle_radius_m") {
        parts.push(format!("sub-particles of {} mm radius", digits(radius_m * 1000.0)));
    }
    if let Some(condition) = base.pointer("/contact/condition").and_then(serde_json::Value::as_str) {
        parts.push(format!("{condition} surfaces"));
    }
    parts.push("nothing outside the ranges".to_owned());
    format!("{ASSUMPTIONS} the base scenario with {}.", list(&parts))
}

/// A place in the range: `gate opening 0.05 m and belt speed 0.3 m/s`.
fn place(study: &Study, values: &[Value]) -> String {
    let parts: Vec<String> = study
        .question
        .factors
        .iter()
        .zip(values)
        .map(|(factor, value)| format!("{} {}", Quantity::of_field(&factor.name).name, level(factor, value)))
        .collect();
    list(&parts)
}

/// A value with its 95 % interval.
fn interval(of: &Measure, value_of: f64, ends: Option<(f64, f64)>) -> String {
    match ends {
        Some((low, high)) => format!("{} ({} to {})", value(of, value_of), digits(low), digits(high)),
        None => format!("{} (too few runs for an interval)", value(of, value_of)),
    }
}

fn ends(estimated: &Estimated) -> Option<(f64, f64)> {
    estimated.low.zip(estimated.high)
}

fn estimate(study: &Study, finding: &EstimateAnswer) -> Vec<String> {
    let mut sentences = Vec::new();
    for point in finding.points.iter().take(MAX_STATED) {
        let measures: Vec<String> = point
            .measures
            .iter()
            .filter_map(|row| {
                let estimated = row.estimated.as_ref()?;
                let n = estimated.n;
                if row.is_constant {
                    let equal = value(&row.of, estimated.value);
                    return Some(format!(
                        "{} is {equal} in all {n} runs, without an interval",
                        measure(&row.of)
                    ));
                }
                Some(format!(
                    "{} is {}, n = {n}",
                    measure(&row.of),
                    interval(&row.of, estimated.value, ends(estimated))
                ))
            })
            .collect();
        if !measures.is_empty() {
            sentences.push(format!("At {}, {}.", place(study, &point.values), list(&measures)));
        }
    }
    if sentences.is_empty() {
        sentences.push("No run has ended yet.".to_owned());
    }
    sentences
}

fn sensitivity(finding: &SensitivityAnswer) -> Vec<String> {
    let mut sentences = Vec::new();
    for row in &finding.measures {
        let what = measure(&row.of);
        match &row.effects {
            None if row.is_constant => {
                sentences.push(format!("{} does not vary: all runs gave the same value.", capital(&what)))
            }
            None => {
                sentences.push(format!("{} does not vary by more than its noise so far.", capital(&what)))
            }
            Some(Effects::Sobol(indices)) => {
                let mut ordered: Vec<&SobolIndices> = indices.iter().collect();
                ordered.sort_by(|one, other| other.total.value.total_cmp(&one.total.value));
                let parts: Vec<String> = ordered
                    .iter()
                    .map(|of| {
                        let name = Quantity::of_field(&of.factor).name;
                        let range = ends(&of.total).map_or(String::new(), |(low, high)| {
                            format!(" ({} to {})", digits(low), digits(high))
                        });
                        format!("{name} {}{range}", digits(of.total.value))
                    })
                    .collect();
                sentences.push(format!("Shares of the variance of {what} that the factors take part in (total Sobol' indices): {}.", list(&parts)));
            }
            Some(Effects::Morris(effects)) => {
                let mut ordered: Vec<_> = effects.iter().collect();
                ordered.sort_by(|one, other| other.mu_star.value.total_cmp(&one.mu_star.value));
                let parts: Vec<String> = ordered
                    .iter()
                    .map(|of| {
                        format!(
                            "{} {}",
                            Quantity::of_field(&of.factor).name,
                            value(&row.of, of.mu_star.value)
                        )
                    })
                    .collect();
                sentences.push(format!(
                    "Mean absolute effects on {what} over the whole range of each factor: {}.",
                    list(&parts)
                ));
            }
        }
    }
    sentences
}

fn capital(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

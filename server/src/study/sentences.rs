//! Question and answer of a study in sentences.

use roost_api::quantity::Quantity;
use roost_api::study::{StudyEnd, StudyState};
use roost_design::goals::{
    BoundaryAnswer, Confirmation, ConfirmationState, Constraint, Crossing, Effects, EstimateAnswer,
    Objective, Obstacle, OptimiseAnswer, Place, Recommendation, SensitivityAnswer, SobolIndices,
};
use roost_design::intervals::Estimated;
use roost_design::{Answer, Finding, Goal, Measure};

use super::Study;
use super::words::{digits, list, measure, number, range, value};

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
pub(super) fn answer(study: &Study, answer: &Answer) -> Vec<String> {
    let mut sentences = match &answer.finding {
        Finding::Estimate(finding) => estimate(study, finding),
        Finding::Boundary(finding) => boundary(study, finding),
        Finding::Optimise(finding) => optimise(study, finding),
        Finding::Sensitivity(finding) => sensitivity(finding),
    };
    let runs = answer.runs;
    let failed = if runs.failed > 0 { format!("; {} more failed", runs.failed) } else { String::new() };
    sentences.push(format!("The answer rests on {} runs{failed}.", runs.done));
    if !answer.excluded.is_empty() {
        let points: Vec<String> =
            answer.excluded.iter().take(MAX_STATED).map(|point| place(study, &point.values)).collect();
        sentences.push(format!("Left out because their runs fail or lack responses: {}.", list(&points)));
    }
    for of in &answer.unusable {
        let counts = [
            (of.missing, "without it"),
            (of.not_binary, "neither 0 nor 1"),
            (of.outliers, "far from all others"),
        ];
        let counts = counts.iter().filter(|(runs, _)| *runs > 0).map(|(runs, why)| format!("{runs} {why}"));
        let response = of.of.response();
        sentences
            .push(format!("Not used of the response `{response}`: {}.", list(&counts.collect::<Vec<_>>())));
    }
    sentences.push(assumptions(study));
    sentences
}

/// Whether a study goes on, or why it does not.
pub(crate) fn state(
    state: StudyState,
    finished: Option<StudyEnd>,
    max_runs: u32,
    reason: Option<&str>,
) -> String {
    match (state, finished) {
        (StudyState::Running, _) => "The study goes on.".to_owned(),
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

/// What the answer assumes beside its factors.
fn assumptions(study: &Study) -> String {
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
    format!("It holds for the base scenario with {}.", list(&parts))
}

/// A place in the range: `gate opening 0.05 m and belt speed 0.3 m/s`.
fn place(study: &Study, values: &[f64]) -> String {
    let parts: Vec<String> = study
        .question
        .factors
        .iter()
        .zip(values)
        .map(|(factor, value)| {
            let quantity = Quantity::of_field(&factor.name);
            format!("{} {}", quantity.name, number(&quantity, *value))
        })
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

fn boundary(study: &Study, finding: &BoundaryAnswer) -> Vec<String> {
    let Goal::Boundary(goal) = &study.question.goal else { return Vec::new() };
    let what = measure(&goal.of);
    let level = value(&goal.of, goal.level);
    let mut sentences = Vec::new();
    match finding.place {
        Place::NowhereAllBelow => {
            sentences.push(format!(
                "Nowhere in the range: {what} is below {level} everywhere, with 95 % confidence."
            ));
        }
        Place::NowhereAllAbove => {
            sentences.push(format!(
                "Nowhere in the range: {what} is above {level} everywhere, with 95 % confidence."
            ));
        }
        Place::Inside => match study.question.factors.as_slice() {
            [factor] => {
                let quantity = Quantity::of_field(&factor.name);
                sentences.extend(finding.crossings.iter().map(|at| crossing(at, &quantity, &what, &level)));
                sentences.extend(safe_side(finding, &quantity, &what, &level));
            }
            factors => {
                let names: Vec<String> =
                    factors.iter().map(|factor| Quantity::of_field(&factor.name).name).collect();
                sentences.push(format!(
                    "The boundary lies inside the range: {what} is below {level} in {} % of it and above in {} %, with 95 % confidence.",
                    share(finding, true), share(finding, false)
                ));
                sentences.push(format!("The map over {} shows where.", list(&names)));
            }
        },
        Place::Unknown => sentences.push(format!("It is not known yet where {what} is {level}.")),
    }
    if let Some(misclassified) = finding.misclassified {
        sentences.push(format!(
            "An expected {} % of the range is on the wrong side of the estimated boundary; {} % was asked.",
            digits(100.0 * misclassified),
            digits(100.0 * finding.asked)
        ));
    }
    sentences
}

/// A stretch of a single factor in which the level is, or may be, crossed.
fn crossing(crossing: &Crossing, quantity: &Quantity, what: &str, level: &str) -> String {
    let (name, range) = (&quantity.name, range(quantity, crossing.low, crossing.high));
    if !crossing.is_certain {
        return format!("{} may be {level} at a {name} of {range} too: more runs would tell.", capital(what));
    }
    match crossing.estimates.as_slice() {
        [only] => {
            let middle = number(quantity, *only);
            format!("{} is {level} at a {name} of {middle} ({range} with 95 % confidence).", capital(what))
        }
        _ => format!("{} is {level} at a {name} of {range}, with 95 % confidence.", capital(what)),
    }
}

/// The stretch of a single factor that is below the level with 95 % confidence, as a decision needs it.
fn safe_side(finding: &BoundaryAnswer, quantity: &Quantity, what: &str, level: &str) -> Option<String> {
    use roost_design::goals::Side;
    let below: Vec<f64> =
        finding.map.iter().filter(|point| point.side == Side::Below).map(|point| point.values[0]).collect();
    let (first, last) = (below.first()?, below.last()?);
    let is_one_stretch = {
        let sides: Vec<bool> = finding.map.iter().map(|point| point.side == Side::Below).collect();
        sides.windows(2).filter(|pair| !pair[0] && pair[1]).count() + usize::from(sides[0]) == 1
    };
    is_one_stretch.then(|| {
        format!(
            "{} is below {level} for {} from {}, with 95 % confidence.",
            capital(what),
            quantity.name,
            range(quantity, *first, *last)
        )
    })
}

/// Percent of the map on one side.
fn share(finding: &BoundaryAnswer, is_below: bool) -> String {
    use roost_design::goals::Side;
    let side = if is_below { Side::Below } else { Side::Above };
    let count = finding.map.iter().filter(|point| point.side == side).count();
    digits((100.0 * count as f64 / finding.map.len().max(1) as f64).round())
}

fn optimise(study: &Study, finding: &OptimiseAnswer) -> Vec<String> {
    let Goal::Optimise(goal) = &study.question.goal else { return Vec::new() };
    let mut sentences: Vec<String> = finding
        .recommended
        .iter()
        .map(|point| {
            let objectives =
                goal.objectives.iter().map(Objective::measure).zip(&point.objectives).enumerate();
            let objectives: Vec<String> = objectives
                .map(|(index, (of, forecast))| {
                    let confirmed =
                        point.confirmation.as_ref().and_then(|found| found.objectives.get(index)?.as_ref());
                    match confirmed {
                        Some(estimated) => {
                            format!("{} is {}", measure(of), interval(of, estimated.value, ends(estimated)))
                        }
                        None => format!(
                            "{} is forecast as {}",
                            measure(of),
                            interval(of, forecast.value, Some((forecast.low, forecast.high)))
                        ),
                    }
                })
                .collect();
            format!(
                "At {}, {}; {}.",
                place(study, &point.values),
                list(&objectives),
                confirmation(goal.constraints.as_slice(), point)
            )
        })
        .collect();
    if sentences.is_empty() {
        sentences.push("No point is recommended yet.".to_owned());
    }
    if let Some(obstacle) = finding.obstacle {
        let why = match obstacle {
            Obstacle::MissingResponses => "too few points have all responses",
            Obstacle::NoCandidate => {
                "every point that could be confirmed has failed, or lies beside one that has"
            }
            Obstacle::ConfirmationRuns => "`confirmation_runs` are too few for a further attempt",
        };
        sentences.push(format!("The search ended because {why}."));
    }
    if !finding.rejected.is_empty() {
        let points: Vec<String> =
            finding.rejected.iter().take(MAX_STATED).map(|point| place(study, &point.values)).collect();
        sentences.push(format!("Not confirmed by fresh seeds: {}.", list(&points)));
    }
    sentences
}

/// The state of the confirmation of a point, with the bounds of its constraints.
fn confirmation(constraints: &[Constraint], point: &Recommendation) -> String {
    let Some(Confirmation { state, constraints: bounds, .. }) = &point.confirmation else {
        return "fresh seeds have not confirmed it yet".to_owned();
    };
    let bounds: Vec<String> = constraints
        .iter()
        .zip(bounds)
        .filter_map(|(constraint, bounds)| {
            let (bounds, of) = (bounds.as_ref()?, &constraint.of);
            let (word, bound) =
                if constraint.at_most.is_some() { ("below", bounds.high) } else { ("above", bounds.low) };
            Some(format!(
                "{} is {word} {} with 95 % confidence (n = {})",
                measure(of),
                value(of, bound),
                bounds.n
            ))
        })
        .collect();
    let verdict = match state {
        ConfirmationState::Open => "its confirmation with fresh seeds goes on",
        ConfirmationState::Confirmed => "fresh seeds confirm it",
        ConfirmationState::Refuted => "fresh seeds refute it",
        ConfirmationState::Undecided => "its runs with fresh seeds cannot decide",
    };
    if bounds.is_empty() { verdict.to_owned() } else { format!("{verdict}: {}", list(&bounds)) }
}

fn sensitivity(finding: &SensitivityAnswer) -> Vec<String> {
    let mut sentences = Vec::new();
    for row in &finding.measures {
        let what = measure(&row.of);
        match &row.effects {
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

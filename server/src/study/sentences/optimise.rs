//! The best points of a study, in sentences.

use roost_design::Goal;
use roost_design::goals::{
    Confirmation, ConfirmationState, Constraint, Objective, Obstacle, OptimiseAnswer, Recommendation,
};

use super::{MAX_STATED, ends, interval, place};
use crate::study::Study;
use crate::study::words::{list, measure, value};

/// The recommended points with their confirmation, and what was rejected.
pub(super) fn sentences(study: &Study, finding: &OptimiseAnswer) -> Vec<String> {
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

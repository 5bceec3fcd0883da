//! The best points of a study, in sentences.

use roost_design::Goal;
use roost_design::goals::{
    Confirmation, ConfirmationState, Constraint, Forecast, Obstacle, Optimise, OptimiseAnswer, Recommendation,
};

use super::{MAX_STATED, ends, interval, place};
use crate::study::Study;
use crate::study::words::{list, measure, value};

/// The recommended points with their confirmation, and what was rejected.
pub(super) fn sentences(study: &Study, finding: &OptimiseAnswer) -> Vec<String> {
    let Goal::Optimise(goal) = &study.question.goal else { return Vec::new() };
    let recommended = finding.recommended.iter().map(|point| {
        let confirmation = confirmation(goal.constraints.as_slice(), point);
        format!("At {}, {}; {confirmation}.", place(study, &point.values), list(&objectives(goal, point)))
    });
    let mut sentences: Vec<String> = recommended.collect();
    if sentences.is_empty() {
        let yet = if finding.obstacle.is_none() { " yet" } else { "" };
        sentences.push(format!("No point is recommended{yet}."));
    }
    if let Some(obstacle) = finding.obstacle {
        let why = match obstacle {
            Obstacle::MissingResponses => "too few points have all responses",
            Obstacle::NoCandidate => {
                "every point that could be confirmed has failed, or lies beside one that has"
            }
            Obstacle::Nowhere => {
                "its runs are spent and, by the models, no point would probably pass a confirmation"
            }
            Obstacle::ConfirmationRuns => "`confirmation_runs` are too few for a further attempt",
        };
        sentences.push(format!("The search ended because {why}."));
    }
    if let Some(point) = finding.nearest.as_ref().filter(|point| !point.constraints.is_empty()) {
        let forecasts: Vec<String> = point.constraints.iter().map(forecast).collect();
        sentences.push(format!(
            "The constraints come nearest to holding at {}: {}.",
            place(study, &point.values),
            list(&forecasts)
        ));
    }
    if finding.attempts > 1 {
        // The points of a front are claims of their own.
        let wrong = if finding.recommended.len() > 1 {
            "each recommended point is wrong"
        } else {
            "the recommended point is wrong"
        };
        sentences.push(format!(
            "After {} attempts at a confirmation, {wrong} with a probability of at most 5 %.",
            finding.attempts
        ));
    }
    if !finding.rejected.is_empty() {
        let points: Vec<String> =
            finding.rejected.iter().take(MAX_STATED).map(|point| place(study, &point.values)).collect();
        sentences.push(format!("Not confirmed by fresh seeds: {}.", list(&points)));
    }
    sentences
}

/// The objectives at a point: by its confirmation, or else as forecast.
fn objectives(goal: &Optimise, point: &Recommendation) -> Vec<String> {
    let confirmed =
        |index: usize| point.confirmation.as_ref().and_then(|found| found.objectives.get(index)?.as_ref());
    let objective = |(index, forecast_of): (usize, &Forecast)| match confirmed(index) {
        Some(estimated) => {
            let of = &forecast_of.of;
            format!("{} is {}", measure(of), interval(of, estimated.value, ends(estimated)))
        }
        None => forecast(forecast_of),
    };
    point.objectives.iter().take(goal.objectives.len()).enumerate().map(objective).collect()
}

fn forecast(Forecast { of, value, low, high }: &Forecast) -> String {
    format!("{} is forecast as {}", measure(of), interval(of, *value, Some((*low, *high))))
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

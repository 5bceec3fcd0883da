//! The measures of a goal, and whether the experiment has their responses.

use roost_api::Fault;
use roost_design::{Goal, Measure, goals};
use roost_solver::experiments::{ResponseType, outputs};
use roost_solver::scenario::Experiment;
use serde_json::json;

use crate::document::fault;

/// Every measure of a goal with its pointer in the study.
pub(super) fn measures(goal: &Goal) -> Vec<(String, &Measure)> {
    match goal {
        Goal::Estimate(estimate) => {
            let each = estimate.intervals.iter().enumerate();
            each.map(|(index, interval)| (format!("/goal/estimate/intervals/{index}/of"), &interval.of))
                .collect()
        }
        Goal::Boundary(boundary) => vec![("/goal/boundary/of".to_owned(), &boundary.of)],
        Goal::Optimise(optimise) => {
            let objectives = optimise.objectives.iter().enumerate().map(|(index, objective)| {
                let word = match objective {
                    goals::Objective::Minimise(_) => "minimise",
                    goals::Objective::Maximise(_) => "maximise",
                };
                (format!("/goal/optimise/objectives/{index}/{word}"), objective.measure())
            });
            let constraints = optimise.constraints.iter().enumerate();
            let constraints = constraints.map(|(index, constraint)| {
                (format!("/goal/optimise/constraints/{index}/of"), &constraint.of)
            });
            objectives.chain(constraints).collect()
        }
        Goal::Sensitivity(sensitivity) => {
            let each = sensitivity.of.iter().enumerate();
            each.map(|(index, measure)| (format!("/goal/sensitivity/of/{index}"), measure)).collect()
        }
        // Checked with the measurements.
        Goal::Calibrate(_) => Vec::new(),
    }
}

/// Checks that the experiment has the responses, and that they are of the right type.
pub(super) fn check(goal: &Goal, experiment: &Experiment, faults: &mut Vec<Fault>) {
    let responses = outputs(experiment).responses;
    for (at, measure) in measures(goal) {
        let kind = responses.iter().find(|row| row.name == measure.response()).map(|row| row.kind);
        let (word, allowed_kinds): (_, &[ResponseType]) = match measure {
            Measure::Probability(_) => ("probability", &[ResponseType::Indicator, ResponseType::Boolean]),
            Measure::Mean(_) => ("mean", &[ResponseType::Number, ResponseType::Indicator]),
        };
        if kind.is_some_and(|kind| allowed_kinds.contains(&kind)) {
            continue;
        }
        let mut names: Vec<_> =
            responses.iter().filter(|row| allowed_kinds.contains(&row.kind)).map(|row| row.name).collect();
        names.sort_unstable();
        let allowed = match names.as_slice() {
            [] => format!("no response of this experiment has a {word}"),
            names => names.join(", "),
        };
        let detail = match kind {
            Some(kind) => format!("this response is a {}, which has no {word}", kind.as_str()),
            None => "the experiment has no such response".to_owned(),
        };
        faults.push(fault(&format!("{at}/{word}"), json!(measure.response()), &detail, &allowed));
    }
}

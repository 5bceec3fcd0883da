//! Goal `boundary`: where a probability or mean has a given level, over one to four factors.
//!
//! The study begins with points of a Sobol' sequence. A model of the results then chooses each further run: it is the one that
//! most reduces the expected share of the range that is put on the wrong side of the boundary (`acquisition`). The study ends when
//! that share is as small as asked. Its answer is the boundary with a band that holds all of it with 95 % confidence (`band`).

mod acquisition;
mod answer;
mod band;

use serde::{Deserialize, Serialize};

use super::{Course, Study};
use crate::decision::{Finding, Proposal};
use crate::evidence::Point;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::model::Model;
use crate::question::{Measure, Question};
use crate::space::{SEQUENCE_LENGTH, sobol};
pub use answer::{BoundaryAnswer, Crossing, MapPoint, ObservedPoint, Place};
pub use band::Side;

/// Maximum number of factors: beyond, a boundary is neither found with few runs nor shown.
const MAX_FACTORS: usize = 4;
/// Runs at each point of the first design: two show the noise of means.
const FIRST_REPLICATES: usize = 2;

/// The fields of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Boundary {
    /// The measure.
    pub of: Measure,
    /// Its level at the boundary, in the unit of the response.
    pub level: f64,
    /// The study ends when the expected share of the range on the wrong side is below this one.
    #[serde(default = "default_misclassified")]
    pub misclassified: f64,
}

fn default_misclassified() -> f64 {
    0.02
}

impl Boundary {
    pub(crate) fn faults(&self, at: &str, factors: &[Factor], faults: &mut Vec<Fault>) {
        self.of.faults(&format!("{at}/of"), faults);
        if factors.len() > MAX_FACTORS {
            let detail = format!("{} factors", factors.len());
            faults.push(fault(
                "/factors",
                factors.len(),
                &detail,
                &format!("1 to {MAX_FACTORS} for a boundary"),
            ));
        }
        let is_inside = self.level > 0.0 && self.level < 1.0;
        if matches!(self.of, Measure::Probability(_)) && !is_inside {
            let detail = "not a level of a probability";
            faults.push(fault(&format!("{at}/level"), self.level, detail, "more than 0 and less than 1"));
        }
        if !(self.misclassified > 0.0 && self.misclassified < 0.5) {
            let at = format!("{at}/misclassified");
            faults.push(fault(
                &at,
                self.misclassified,
                "not a share to end at",
                "more than 0 and less than 0.5",
            ));
        }
    }
}

/// Number of points of the first design.
pub(crate) fn first_points(question: &Question) -> usize {
    let points = 4 << question.factors.len();
    points.min(question.budget.max_runs / (2 * FIRST_REPLICATES)).max(1)
}

pub(super) fn decide(goal: &Boundary, study: &Study<'_>) -> Course {
    let with_values = study.usable_points().filter(|point| !point.values(&goal.of).is_empty()).count();
    let first = first_proposals(study);
    let model = Model::fit_near(&goal.of, study.usable_points(), goal.level);
    let answer = BoundaryAnswer::of(goal, study, model.as_ref());
    // Points of earlier sweeps serve as well as the first design.
    let is_begun = with_values >= first_points(study.question);
    let is_met = is_begun && answer.misclassified.is_some_and(|share| share <= goal.misclassified);
    let proposals = match &model {
        _ if study.room == 0 || is_met => Vec::new(),
        Some(model) if is_begun || (first.is_empty() && 2 * with_values >= first_points(study.question)) => {
            acquisition::proposals(goal, study, model)
        }
        _ if !first.is_empty() => first,
        // Nothing is known yet, but workers wait.
        _ => further_proposals(study),
    };
    Course { proposals, is_met, is_spent: false, finding: Finding::Boundary(answer) }
}

/// A point of the first design or of the sequence that goes on.
fn sequence_point(study: &Study<'_>, index: usize) -> Point {
    let factors = &study.question.factors;
    Point::new(&sobol(index, factors.len(), study.seed)).rounded(factors)
}

/// Runs of the first design that do not exist yet: first one of each point, then replicates.
fn first_proposals(study: &Study<'_>) -> Vec<Proposal> {
    let budget = &study.question.budget;
    let points: Vec<Point> =
        (0..first_points(study.question)).map(|index| sequence_point(study, index)).collect();
    let mut proposals = Vec::new();
    for replicate in 0..FIRST_REPLICATES.min(budget.max_replicates) {
        for point in &points {
            let known = study.evidence.at(point);
            let is_excluded = known.is_some_and(|known| study.question.excludes(known));
            let (count, next) = known.map_or((0, 0), |known| (known.count(), known.next_replicate()));
            if !is_excluded && replicate >= count {
                let replicate = next + (replicate - count) as u32;
                proposals.push(Proposal { point: point.clone(), replicate });
            }
        }
    }
    proposals
}

/// Further points of the sequence, one run each.
fn further_proposals(study: &Study<'_>) -> Vec<Proposal> {
    let points = (first_points(study.question)..SEQUENCE_LENGTH).map(|index| sequence_point(study, index));
    let new = points
        .take(study.room + study.evidence.points().len())
        .filter(|point| study.evidence.at(point).is_none());
    new.take(study.room).map(|point| Proposal { point, replicate: 0 }).collect()
}

//! Goal `boundary`: where a probability or mean has a given level, over one to four factors.
//!
//! The study begins with points of a Sobol' sequence. A model of the results then chooses each further run: it is the one that
//! most reduces the expected share of the range that is put on the wrong side of the boundary (`acquisition`). The study ends when
//! that share is as small as asked. Its answer is the boundary with a band that holds all of it with 95 % confidence (`band`).

mod acquisition;
mod answer;
mod band;

use serde::{Deserialize, Serialize};

use super::{Course, Finding, Study};
use crate::budget::Budget;
use crate::evidence::Point;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::measure::Measure;
use crate::model::Model;
use crate::proposal::Proposal;
use crate::space::{SEQUENCE_LENGTH, distinct};
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
        for (index, factor) in factors.iter().enumerate().filter(|(_, factor)| factor.is_categorical()) {
            let detail = format!("{} has levels without an order, and a boundary needs a scale", factor.name);
            let allowed = "`low` and `high`; else a study for each level, with the level in the base";
            faults.push(fault(&format!("/factors/{index}/levels"), &factor.levels, &detail, allowed));
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

/// Indices of the sequence for each point of the first design: whole numbers repeat themselves.
const INDICES_PER_POINT: usize = 64;

/// Number of points of the first design.
pub(crate) fn first_points(factors: &[Factor], budget: &Budget) -> usize {
    let points = 4 << factors.len();
    // The product of the factors' numbers of values; none for a range of numbers that are not whole.
    let values =
        factors.iter().try_fold(1_usize, |values, factor| Some(values.saturating_mul(factor.count()?)));
    let points = points.min(values.unwrap_or(usize::MAX));
    points.min(budget.max_runs / (2 * FIRST_REPLICATES)).max(1)
}

/// The points of the first design; of few whole numbers all points.
fn first_design(study: &Study<'_>) -> Vec<Point> {
    let points = first_points(study.factors, study.budget);
    distinct(study.factors, 0..INDICES_PER_POINT * points, study.seed).take(points).collect()
}

pub(super) fn decide(goal: &Boundary, study: &Study<'_>) -> Course {
    let with_values = study.usable_points().filter(|point| !point.values(&goal.of).is_empty()).count();
    let design = first_design(study);
    let first = first_proposals(study, &design);
    let model = Model::fit_near(study.factors, &goal.of, study.usable_points(), goal.level);
    let answer = BoundaryAnswer::of(goal, study, model.as_ref());
    // Points of earlier sweeps serve as well as the first design, and nothing waits for excluded points.
    let is_excluded = |point: &Point| study.evidence.at(point).is_some_and(|known| study.excludes(known));
    let needed = design.iter().filter(|point| !is_excluded(point)).count().max(1);
    let is_begun = with_values >= needed;
    let is_met = is_begun && answer.misclassified.is_some_and(|share| share <= goal.misclassified);
    let proposals = match &model {
        _ if study.room == 0 || is_met => Vec::new(),
        Some(model) if is_begun || (first.is_empty() && 2 * with_values >= needed) => {
            acquisition::proposals(goal, study, model)
        }
        _ if !first.is_empty() => first,
        // Nothing is known yet, but workers wait.
        _ => further_proposals(study, design.len()),
    };
    Course { proposals, is_met, is_spent: false, finding: Finding::Boundary(answer) }
}

/// Runs of the first design that do not exist yet: first one of each point, then replicates.
fn first_proposals(study: &Study<'_>, points: &[Point]) -> Vec<Proposal> {
    let budget = study.budget;
    let mut proposals = Vec::new();
    for replicate in 0..FIRST_REPLICATES.min(budget.max_replicates) {
        for point in points {
            let known = study.evidence.at(point);
            let is_excluded = known.is_some_and(|known| study.excludes(known));
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
fn further_proposals(study: &Study<'_>, first: usize) -> Vec<Proposal> {
    let factors = study.factors;
    let indices = INDICES_PER_POINT * (first + study.room + study.evidence.points().len());
    let points = distinct(factors, first..indices.min(SEQUENCE_LENGTH), study.seed);
    let new = points.filter(|point| study.evidence.at(point).is_none());
    new.take(study.room).map(|point| Proposal { point, replicate: 0 }).collect()
}

//! Goal `estimate`: replicate each point until the interval of each named response is as narrow as asked.
//!
//! Equal values of a mean have no interval. After [`MAX_EQUAL`] of them the measure counts as constant at its point, and needs no more.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Course, Finding, Study};
use crate::evidence::{Point, PointRuns};
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::intervals::{Estimated, MIN_MEAN_RUNS, are_equal, values_needed};
use crate::measure::Measure;
use crate::proposal::Proposal;

/// Number of equal values of a mean after which it counts as constant. A response that differs in 14 % of the runs or more would have
/// shown it with a probability of 95 %.
pub const MAX_EQUAL: usize = 20;

/// The fields of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Estimate {
    /// The points: a value per factor, which is a number in its unit or a level.
    pub points: Vec<Vec<Value>>,
    /// The measures, and how narrow their intervals must be.
    pub intervals: Vec<MeasureWidth>,
}

/// A measure and the width of its interval at which replicates end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasureWidth {
    /// The measure.
    pub of: Measure,
    /// Maximum width of its 95 % interval, from end to end, in the unit of the response.
    pub width: f64,
}

/// The finding of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct EstimateAnswer {
    /// The points, in the order of the question.
    pub points: Vec<PointEstimate>,
}

/// The estimates at a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct PointEstimate {
    /// Values of the factors, as in the question.
    pub values: Vec<Value>,
    /// A row per measure, in the order of the question.
    pub measures: Vec<MeasureEstimate>,
    /// Whether the point is left out because its runs fail, or have no response that a measure can use.
    pub is_excluded: bool,
}

/// The estimate of a measure at a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureEstimate {
    /// The measure.
    pub of: Measure,
    /// The estimate with its interval; none without values.
    pub estimated: Option<Estimated>,
    /// Whether the interval is as narrow as asked.
    pub is_narrow: bool,
    /// Whether all values of a mean are equal, 20 or more of them. They have no interval, and the point needs no more runs for this measure.
    #[serde(default)]
    pub is_constant: bool,
}

impl Estimate {
    pub(crate) fn faults(&self, at: &str, factors: &[Factor], faults: &mut Vec<Fault>) {
        if self.points.is_empty() {
            faults.push(fault(
                &format!("{at}/points"),
                &self.points,
                "nothing to estimate",
                "at least one point",
            ));
        }
        for (index, values) in self.points.iter().enumerate() {
            let at = format!("{at}/points/{index}");
            if values.len() != factors.len() {
                let detail = format!("{} values for {} factors", values.len(), factors.len());
                faults.push(fault(&at, values, &detail, "a value per factor"));
            }
            for (position, (value, factor)) in values.iter().zip(factors).enumerate() {
                if factor.number(value).and_then(|number| factor.coordinate(number)).is_none() {
                    let is_number = !factor.is_categorical() && value.is_number();
                    let what = if is_number { "outside the range" } else { "not a value" };
                    let detail = format!("{what} of {}", factor.name);
                    faults.push(fault(&format!("{at}/{position}"), value, &detail, &factor.allowed()));
                }
            }
        }
        if self.intervals.is_empty() {
            let at = format!("{at}/intervals");
            faults.push(fault(&at, &self.intervals, "nothing to estimate", "at least one measure"));
        }
        for (index, interval) in self.intervals.iter().enumerate() {
            let at = format!("{at}/intervals/{index}");
            interval.of.faults(&format!("{at}/of"), faults);
            if interval.width <= 0.0 {
                faults.push(fault(&format!("{at}/width"), interval.width, "no width", "more than 0"));
            }
        }
    }
}

/// The estimates at a point with its runs.
fn estimates(goal: &Estimate, runs: Option<&PointRuns>) -> Vec<MeasureEstimate> {
    let of_measure = |interval: &MeasureWidth| {
        let values = runs.map_or(Vec::new(), |runs| runs.values(&interval.of));
        let estimated = Estimated::of(&interval.of, &values);
        let is_narrow =
            estimated.and_then(|found| found.width()).is_some_and(|width| width <= interval.width);
        let is_constant = is_constant(&interval.of, &values);
        MeasureEstimate { of: interval.of.clone(), estimated, is_narrow, is_constant }
    };
    goal.intervals.iter().map(of_measure).collect()
}

/// Whether enough values of a mean are equal to call it constant.
fn is_constant(measure: &Measure, values: &[f64]) -> bool {
    let is_mean = matches!(measure, Measure::Mean(_));
    is_mean && values.len() >= MAX_EQUAL && are_equal(values)
}

/// Number of runs that the point should have next to those it has, by a forecast from its values.
fn missing(goal: &Estimate, runs: Option<&PointRuns>, most: usize) -> usize {
    let Some(runs) = runs else { return MIN_MEAN_RUNS.min(most) };
    let of_measure = |interval: &MeasureWidth| {
        let values = runs.values(&interval.of);
        let narrow = Estimated::of(&interval.of, &values).and_then(|found| found.width());
        if narrow.is_some_and(|width| width <= interval.width) || is_constant(&interval.of, &values) {
            return 0;
        }
        // At least one run more: the forecast may have been met without success.
        let needed = values_needed(&interval.of, &values, interval.width, most).max(values.len() + 1);
        let is_equal = matches!(interval.of, Measure::Mean(_)) && are_equal(&values);
        let needed = if is_equal && !values.is_empty() { needed.min(MAX_EQUAL) } else { needed };
        needed - values.len()
    };
    let more = goal.intervals.iter().map(of_measure).max().unwrap_or(0);
    more.saturating_sub(runs.pending()).min(most.saturating_sub(runs.count()))
}

pub(super) fn decide(goal: &Estimate, study: &Study<'_>) -> Course {
    let budget = study.budget;
    let mut points = Vec::new();
    // Position in the queue of a point's replicates, then the point: all points advance together.
    let mut queue = Vec::new();
    let (mut is_met, mut usable) = (true, 0);
    for values in &goal.points {
        let Some(point) = Point::of_levels(study.factors, values) else { continue };
        // The values of a run are rounded: only a rounded point finds its runs again.
        let point = point.rounded(study.factors);
        let runs = study.evidence.at(&point);
        let is_excluded = runs.is_some_and(|runs| study.excludes(runs));
        let measures = estimates(goal, runs);
        if !is_excluded {
            usable += 1;
            is_met &= measures.iter().all(|measure| measure.is_narrow || measure.is_constant);
            let (known, next) = runs.map_or((0, 0), |runs| (runs.count(), runs.next_replicate()));
            let more = missing(goal, runs, budget.max_replicates).min(study.room);
            queue.extend((0..more).map(|index| (known + index, point.clone(), next + index as u32)));
        }
        points.push(PointEstimate { values: values.clone(), measures, is_excluded });
    }
    queue.sort();
    queue.dedup();
    let proposals = queue.into_iter().map(|(_, point, replicate)| Proposal { point, replicate });
    Course {
        proposals: proposals.take(study.room).collect(),
        is_met: is_met && usable > 0,
        is_spent: false,
        finding: Finding::Estimate(EstimateAnswer { points }),
    }
}

//! Recommendations: the best points that should pass a confirmation, and the forecasts for them. A point without runs may be
//! recommended: its confirmation runs it.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use statrs::distribution::{ContinuousCDF, Normal};

use super::bounds::Bounds;
use super::chances::NextConfirmation;
use super::confirmation::{ASSURANCE, ConfirmationState, Confirming, Plan};
use super::models::Models;
use super::{Constraint, Optimise, OptimiseAnswer, candidates, front, has_values};
use crate::evidence::{Point, PointRuns};
use crate::goals::Study;
use crate::intervals::Estimated;
use crate::measure::Measure;
use crate::model::kernel::columns;

/// A confirmation that passes with less than this probability is not begun.
const HOPELESS: f64 = 0.05;
/// The assurance that the last affordable confirmation needs.
const LAST_ASSURANCE: f64 = 0.8;
/// Points nearer than this to a rejected one, in every factor and in widths of its range, are not recommended.
const NEIGHBOURHOOD: f64 = 0.02;
/// Number of quantiles that stand for a posterior.
const QUANTILES: usize = 12;

/// A point with forecasts and its confirmation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recommendation {
    /// Values of the factors: numbers in their units, or levels.
    pub values: Vec<Value>,
    /// Number of runs of the search at this point.
    pub runs: usize,
    /// Forecasts of the objectives by the models.
    pub objectives: Vec<Forecast>,
    /// Forecasts of the constrained measures by the models.
    pub constraints: Vec<Forecast>,
    /// Forecast probability that a confirmation certifies the constraints.
    pub assurance: f64,
    /// The confirmation; none if it has not begun.
    pub confirmation: Option<Confirmation>,
}

/// The forecast of a measure at a point, in the unit of the response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Forecast {
    /// The measure.
    pub of: Measure,
    /// The value at the posterior mean.
    pub value: f64,
    /// Lower end of the 95 % interval.
    pub low: f64,
    /// Upper end of the 95 % interval.
    pub high: f64,
}

/// The confirmation of a point: runs with fresh seeds alone.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Confirmation {
    /// The attempt, from 1 on: the later, the more runs it needs. Points of a front share one.
    pub attempt: u32,
    /// Its state.
    pub state: ConfirmationState,
    /// The objectives, with 95 % intervals.
    pub objectives: Vec<Option<Estimated>>,
    /// The constrained measures, with the bounds that decide.
    pub constraints: Vec<Option<Bounds>>,
}

/// A point with the forecasts.
struct Considered<'a> {
    point: Point,
    runs: Option<&'a PointRuns>,
    /// The state of its confirmation; none if it has not begun.
    state: Option<ConfirmationState>,
    /// Latent values of the objectives; smaller is better.
    latents: Vec<f64>,
    objectives: Vec<Forecast>,
    constraints: Vec<Forecast>,
    assurance: f64,
}

/// The points that may be recommended.
pub(super) struct Outlook<'a> {
    goal: &'a Optimise,
    least_assurance: f64,
    considered: Vec<Considered<'a>>,
}

impl<'a> Outlook<'a> {
    /// Usable points with values, and around the best of them and over the range others without. None without models.
    pub(super) fn of(
        goal: &'a Optimise,
        next: &NextConfirmation<'_>,
        study: &Study<'a>,
        models: Option<&Models<'_>>,
        begun: &BTreeMap<&Point, (Confirming<'_>, ConfirmationState)>,
    ) -> Self {
        let least_assurance = least_assurance(&next.plan, study);
        let considered = models.map_or(Vec::new(), |models| consider(goal, next, study, models, begun));
        Self { goal, least_assurance, considered }
    }

    /// The answer so far.
    pub(super) fn answer(
        &self,
        study: &Study<'_>,
        begun: &BTreeMap<&Point, (Confirming<'_>, ConfirmationState)>,
    ) -> OptimiseAnswer {
        let goal = self.goal;
        let recommendation = |point: &Considered<'_>| {
            let confirmation = begun.get(&point.point).map(|(runs, state)| {
                let estimated = |measure: &Measure| Estimated::of(measure, &runs.values(measure));
                let bounds = |constraint: &Constraint| runs.bounds(&constraint.of);
                let objectives = goal.objectives.iter().map(|objective| estimated(objective.measure()));
                Confirmation {
                    attempt: runs.attempt,
                    state: *state,
                    objectives: objectives.collect(),
                    constraints: goal.constraints.iter().map(bounds).collect(),
                }
            });
            Recommendation {
                values: point.point.levels(study.factors),
                runs: point.runs.map_or(0, |runs| super::search_runs(runs).count()),
                objectives: point.objectives.clone(),
                constraints: point.constraints.clone(),
                assurance: point.assurance,
                confirmation,
            }
        };
        let mut recommended: Vec<_> = self.considered.iter().filter(|point| point.is_good()).collect();
        // After a failed confirmation only confirmed points are worth the name.
        if recommended.is_empty() && !self.considered.iter().any(Considered::is_rejected) {
            recommended = self.next(goal.targets());
        }
        recommended.sort_by(|one, other| one.latents[0].total_cmp(&other.latents[0]));
        OptimiseAnswer {
            recommended: recommended.into_iter().map(recommendation).collect(),
            rejected: self
                .considered
                .iter()
                .filter(|point| point.is_rejected())
                .map(recommendation)
                .collect(),
            nearest: self.nearest().filter(|_| self.is_hopeless()).map(recommendation),
            attempts: begun.values().map(|(runs, _)| runs.attempt).max().unwrap_or(0),
            expected_improvement: None,
            obstacle: None,
        }
    }

    /// Whether no point is worth a confirmation.
    pub(super) fn is_hopeless(&self) -> bool {
        !self.considered.iter().any(Considered::is_good)
            && self.nearest().is_some_and(|point| point.assurance < HOPELESS)
    }

    /// The point without a confirmation that would most probably pass one.
    fn nearest(&self) -> Option<&Considered<'a>> {
        let fresh = self.fresh();
        fresh.into_iter().reduce(|best, other| if other.assurance > best.assurance { other } else { best })
    }

    /// Points without a confirmation, and not beside a rejected one.
    fn fresh(&self) -> Vec<&Considered<'a>> {
        let rejected: Vec<_> = self.considered.iter().filter(|point| point.is_rejected()).collect();
        let is_fresh = |point: &&Considered<'_>| {
            point.state.is_none() && !rejected.iter().any(|other| point.is_near(other))
        };
        self.considered.iter().filter(is_fresh).collect()
    }

    /// Up to `count` points for the next confirmations.
    pub(super) fn next_points(&self, count: usize) -> Vec<Point> {
        self.next(count).into_iter().map(|point| point.point.clone()).collect()
    }

    /// The best of the points that should pass, or those that most probably pass. Of a front, those that add most to the points in
    /// confirmation.
    fn next(&self, count: usize) -> Vec<&Considered<'a>> {
        let good: Vec<_> = self.considered.iter().filter(|point| point.is_good()).collect();
        let fresh = self.fresh();
        let best = fresh.iter().map(|point| point.assurance).fold(0.0, f64::max);
        if best < HOPELESS {
            return Vec::new();
        }
        let least = self.least_assurance.min(best);
        let mut likely: Vec<&Considered<'a>> =
            fresh.into_iter().filter(|point| point.assurance >= least).collect();
        if self.goal.objectives.len() == 1 {
            likely.sort_by(|one, other| one.latents[0].total_cmp(&other.latents[0]));
            likely.truncate(count);
            return likely;
        }
        let is_new = |point: &&Considered<'a>| !good.iter().any(|other| other.beats(point));
        likely.retain(is_new);
        let values: Vec<[f64; 2]> = likely.iter().map(|point| point.both()).collect();
        let mut chosen: Vec<[f64; 2]> = good.iter().map(|point| point.both()).collect();
        let reference = front::reference(&[values.as_slice(), &chosen].concat());
        let mut front = front::front(&values);
        let mut points = Vec::new();
        while points.len() < count && !front.is_empty() {
            let area =
                |index: &usize| front::area(&[chosen.as_slice(), &[values[*index]]].concat(), reference);
            let areas: Vec<f64> = front.iter().map(area).collect();
            let next =
                (0..front.len()).fold(0, |best, other| if areas[other] > areas[best] { other } else { best });
            let next = front.remove(next);
            chosen.push(values[next]);
            points.push(likely[next]);
        }
        points
    }
}

impl Considered<'_> {
    fn is_good(&self) -> bool {
        matches!(self.state, Some(ConfirmationState::Open | ConfirmationState::Confirmed))
    }

    fn is_rejected(&self) -> bool {
        matches!(self.state, Some(ConfirmationState::Refuted | ConfirmationState::Undecided))
    }

    fn is_near(&self, other: &Self) -> bool {
        let (mine, other) = (self.point.coordinates(), other.point.coordinates());
        mine.iter().zip(&other).all(|(mine, other)| (mine - other).abs() < NEIGHBOURHOOD)
    }

    fn beats(&self, other: &Self) -> bool {
        self.latents.iter().zip(&other.latents).all(|(mine, other)| mine <= other)
    }

    /// Both objectives of a front.
    fn both(&self) -> [f64; 2] {
        [self.latents[0], self.latents[1]]
    }
}

/// The assurance that a point needs: less when the budget has room for another confirmation, should the first one fail. Points
/// near the limits have better objectives, and runs of a confirmation say more about one point than those of a search.
fn least_assurance(plan: &Plan, study: &Study<'_>) -> f64 {
    let left = study.budget.max_runs.saturating_sub(study.evidence.spent());
    if left >= 2 * plan.most { ASSURANCE } else { LAST_ASSURANCE }
}

fn consider<'a>(
    goal: &Optimise,
    next: &NextConfirmation<'_>,
    study: &Study<'a>,
    models: &Models<'_>,
    begun: &BTreeMap<&Point, (Confirming<'_>, ConfirmationState)>,
) -> Vec<Considered<'a>> {
    let factors = study.factors;
    let budget = study.budget;
    // A point whose confirmation fails for its failed runs is excluded, but named as rejected.
    let is_considered = |point: &&PointRuns| {
        begun.contains_key(&point.point) || (!budget.excludes(point) && has_values(goal, point))
    };
    let known = study.evidence.points().iter().filter(is_considered);
    let known: Vec<_> = known.map(|runs| (runs.point.clone(), Some(runs))).collect();
    let mut considered = forecast(goal, next, study, models, known);
    for point in &mut considered {
        point.state = begun.get(&point.point).map(|(_, state)| *state);
    }
    // With two objectives the points of the search cover the front.
    if goal.objectives.len() == 1 {
        let mut best: Vec<_> = considered.iter().filter(|point| point.assurance >= ASSURANCE).collect();
        best.sort_by(|one, other| one.latents[0].total_cmp(&other.latents[0]));
        best.truncate(4);
        let centres: Vec<Vec<f64>> = best.iter().map(|point| point.point.coordinates()).collect();
        let new = [
            candidates::spread(200, factors.len(), study.seed),
            candidates::clouds(factors, &centres, 12, study.seed),
        ];
        let rounded = new.concat().into_iter().map(|point| Point::new(&point).rounded(factors));
        let new: BTreeSet<Point> = rounded.filter(|point| study.evidence.at(point).is_none()).collect();
        let new = new.into_iter().map(|point| (point, None)).collect();
        considered.extend(forecast(goal, next, study, models, new));
    }
    considered
}

/// Points with their forecasts.
fn forecast<'a>(
    goal: &Optimise,
    next: &NextConfirmation<'_>,
    study: &Study<'_>,
    models: &Models<'_>,
    points: Vec<(Point, Option<&'a PointRuns>)>,
) -> Vec<Considered<'a>> {
    let coordinates: Vec<_> = points.iter().map(|(point, _)| point.coordinates()).collect();
    let matrix = columns(study.factors.len(), &coordinates);
    let success: Vec<f64> = match &models.success {
        None => vec![1.0; points.len()],
        Some(model) => {
            model.posterior.predict(&matrix).means.iter().map(|latent| model.value(*latent)).collect()
        }
    };
    let considered = |(index, (point, runs))| Considered {
        point,
        runs,
        state: None,
        latents: Vec::new(),
        objectives: Vec::new(),
        constraints: Vec::new(),
        assurance: success[index],
    };
    let mut considered: Vec<_> = points.into_iter().enumerate().map(considered).collect();
    for objective in &goal.objectives {
        let forecasts = forecasts(objective.measure(), models, &matrix);
        for (point, (forecast, latent, _, _)) in considered.iter_mut().zip(forecasts) {
            point.latents.push(objective.sign() * latent);
            point.objectives.push(forecast);
        }
    }
    for (constraint, chances) in goal.constraints.iter().zip(&next.chances) {
        let forecasts = forecasts(&constraint.of, models, &matrix).into_iter().zip(&success);
        for (point, ((forecast, _, quantiles, noise), success)) in considered.iter_mut().zip(forecasts) {
            point.assurance *= chances.assurance(&quantiles, noise, *success);
            point.constraints.push(forecast);
        }
    }
    considered
}

/// Forecast, latent mean, quantiles, and standard deviation of one run, at each point.
fn forecasts(
    measure: &Measure,
    models: &Models<'_>,
    matrix: &nalgebra::DMatrix<f64>,
) -> Vec<(Forecast, f64, Vec<f64>, f64)> {
    let model = models.of(measure);
    let prediction = model.posterior.predict(matrix);
    let noise = model.noise(matrix, &prediction);
    let normal = Normal::standard();
    let unit = model.value(1.0) - model.value(0.0);
    let of_point = |index: usize| {
        let (mean, deviation) = (prediction.means[index], prediction.variances[index].sqrt());
        let at = |z: f64| model.value(mean + z * deviation);
        let quantile = |step: usize| at(normal.inverse_cdf((step as f64 + 0.5) / QUANTILES as f64));
        let forecast = Forecast { of: measure.clone(), value: at(0.0), low: at(-1.96), high: at(1.96) };
        (forecast, mean, (0..QUANTILES).map(quantile).collect(), noise[index].sqrt() * unit)
    };
    (0..matrix.ncols()).map(of_point).collect()
}

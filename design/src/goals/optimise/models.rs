//! A fitted model per measure of the question, and one of the runs that are lost.

use std::collections::BTreeMap;

use super::Optimise;
use crate::evidence::{Outcome, PointRuns};
use crate::goals::Study;
use crate::goals::optimise::search_runs;
use crate::measure::Measure;
use crate::model::Model;

/// The models.
#[derive(Debug)]
pub(super) struct Models<'a> {
    /// Measures and their models, objectives first.
    measures: Vec<(&'a Measure, Model)>,
    /// Probability that a run succeeds; none without lost runs.
    pub(super) success: Option<Model>,
}

impl<'a> Models<'a> {
    /// Fits the models; none while a measure has no values.
    pub(super) fn fit(goal: &'a Optimise, study: &Study<'_>) -> Option<Self> {
        let of_measure = |measure: &'a Measure| {
            Some((measure, Model::fit(study.factors, measure, study.usable_points())?))
        };
        let measures = goal.measures().into_iter().map(of_measure).collect::<Option<_>>()?;
        Some(Self { measures, success: success(goal, study) })
    }

    pub(super) fn of(&self, measure: &Measure) -> &Model {
        let found = self.measures.iter().find(|(other, _)| *other == measure);
        &found.expect("every measure of the question has a model").1
    }
}

/// The model of success, from the runs of the search at all points: a run without one of the responses is lost too.
fn success(goal: &Optimise, study: &Study<'_>) -> Option<Model> {
    const NAME: &str = "succeeded";
    let measures = goal.measures();
    let has_all = |values: &BTreeMap<String, f64>| {
        measures
            .iter()
            .all(|measure| values.get(measure.response()).is_some_and(|value| measure.accepts(*value)))
    };
    let success = |outcome: &Outcome| match outcome {
        Outcome::Pending | Outcome::Cancelled => None,
        Outcome::Failed => Some(false),
        Outcome::Responses(values) => Some(has_all(values)),
    };
    let points = study.evidence.points();
    let mut all = points.iter().flat_map(search_runs);
    let is_lost = all.any(|(_, outcome)| success(outcome) == Some(false));
    (is_lost || points.iter().any(|point| point.impossible.is_some())).then_some(())?;
    let result = |success: bool| Outcome::Responses([(NAME.to_owned(), f64::from(u8::from(success)))].into());
    let of_point = |point: &PointRuns| {
        let runs = search_runs(point)
            .filter_map(|(replicate, outcome)| Some((*replicate, result(success(outcome)?))));
        let mut runs: BTreeMap<u32, Outcome> = runs.collect();
        if point.impossible.is_some() {
            runs.insert(0, result(false));
        }
        PointRuns { point: point.point.clone(), runs, impossible: None }
    };
    let points: Vec<PointRuns> = points.iter().map(of_point).collect();
    Model::fit(study.factors, &Measure::Probability(NAME.to_owned()), &points)
}

//! A fitted model per measure of the question, and one of the runs that fail.

use super::Optimise;
use crate::evidence::{Outcome, PointRuns};
use crate::goals::Study;
use crate::goals::optimise::search_runs;
use crate::model::Model;
use crate::question::Measure;

/// The models.
#[derive(Debug)]
pub(super) struct Models<'a> {
    /// Measures and their models, objectives first.
    measures: Vec<(&'a Measure, Model)>,
    /// Probability that a run succeeds; none without failed runs.
    pub(super) success: Option<Model>,
}

impl<'a> Models<'a> {
    /// Fits the models; none while a measure has no values.
    pub(super) fn fit(goal: &'a Optimise, study: &Study<'_>) -> Option<Self> {
        let of_measure = |measure: &'a Measure| Some((measure, Model::fit(measure, study.usable_points())?));
        let measures = goal.measures().into_iter().map(of_measure).collect::<Option<_>>()?;
        Some(Self { measures, success: success(study) })
    }

    pub(super) fn of(&self, measure: &Measure) -> &Model {
        let found = self.measures.iter().find(|(other, _)| *other == measure);
        &found.expect("every measure of the question has a model").1
    }
}

/// The model of success, from the runs of the search at all points.
fn success(study: &Study<'_>) -> Option<Model> {
    const NAME: &str = "succeeded";
    let points = study.evidence.points();
    points.iter().any(|point| point.failed() > 0).then_some(())?;
    let of_point = |point: &PointRuns| {
        let outcome = |outcome: &Outcome| {
            let value = match outcome {
                Outcome::Pending | Outcome::Cancelled => return None,
                Outcome::Failed => 0.0,
                Outcome::Responses(_) => 1.0,
            };
            Some(Outcome::Responses([(NAME.to_owned(), value)].into()))
        };
        let runs = search_runs(point).filter_map(|(replicate, run)| Some((*replicate, outcome(run)?)));
        PointRuns { point: point.point.clone(), runs: runs.collect() }
    };
    let points: Vec<PointRuns> = points.iter().map(of_point).collect();
    Model::fit(&Measure::Probability(NAME.to_owned()), &points)
}

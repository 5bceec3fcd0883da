//! The best that any choice of runs could do, if the model of a truth is known from many runs.

use super::oracle::{FILLING, Gauge, TARGETS, add, model};
use super::truths::Truth;
use crate::model::Model;
use crate::model::fantasy::Fantasies;
use crate::model::kernel::columns;
use crate::space::sobol;
use crate::tests::truth::Random;
use crate::{Evidence, Question, Run};

/// Times that each run of the best design is exchanged for a better one.
const EXCHANGES: usize = 3;
/// Parts of a run, for the bound of all designs.
const PARTS: usize = 8;

/// The known boundary of a truth, and a model of many runs.
pub(super) struct Known {
    gauge: Gauge,
    model: Model,
    /// The best design found: a point per run.
    best: Vec<Vec<f64>>,
    /// The expected share below which no design of as many runs at the same candidates is.
    pub(super) least: f64,
    /// A unit of the latent function, in the unit of the truth's.
    unit: f64,
}

impl Known {
    pub(super) fn of(truth: &Truth, question: &Question) -> Self {
        let (mut runs, mut random) = (Vec::new(), Random(7));
        for index in 0..200 {
            add(&mut runs, truth, &sobol(index, 2, 7), 20, &mut random);
        }
        let (gauge, model) = (Gauge::of(truth), model(question, &runs));
        let unit = if truth.noise.is_some() { 1.0 / (model.latent(1.0) - model.latent(0.0)) } else { 1.0 };
        let mut known = Self { gauge, model, best: Vec::new(), least: 0.0, unit };
        let candidates = known.gauge.candidates((0..FILLING).map(|index| sobol(index, 2, 7)));
        let mut fantasies = known.before(&candidates);
        let mut chosen = Vec::new();
        for _ in 0..question.budget.max_runs {
            let best = known.gauge.best(&fantasies);
            fantasies.observe(best);
            chosen.push(best);
        }
        known.exchange(&mut fantasies, &mut chosen);
        known.best = chosen.iter().map(|index| candidates[*index].clone()).collect();
        // The bound also holds for parts of runs. With whole runs alone it is loose: the first run at a point says more than its last part.
        let mut fantasies = known.before(&candidates);
        fantasies.noise.iter_mut().for_each(|noise| *noise *= PARTS as f64);
        let mut chosen: Vec<usize> = chosen.iter().flat_map(|place| [*place; PARTS]).collect();
        chosen.iter().for_each(|place| fantasies.observe(*place));
        known.exchange(&mut fantasies, &mut chosen);
        known.least = unit * known.gauge.least(&fantasies, &chosen);
        known
    }

    /// Exchanges each run for the best one.
    fn exchange(&self, fantasies: &mut Fantasies, chosen: &mut [usize]) {
        for _ in 0..EXCHANGES {
            for run in chosen.iter_mut() {
                let column = fantasies.covariances.column(*run).into_owned();
                let rest: f64 = fantasies.noise[*run] - column[*run];
                fantasies.covariances.ger(1.0 / rest, &column, &column, 1.0);
                *run = self.gauge.best(fantasies);
                fantasies.observe(*run);
            }
        }
    }

    /// The runs of the best design.
    pub(super) fn runs(&self, truth: &Truth, random: &mut Random) -> Vec<Run> {
        let mut runs = Vec::new();
        self.best.iter().for_each(|at| add(&mut runs, truth, at, 1, random));
        runs
    }

    /// The latent function at candidates before any run.
    fn before(&self, candidates: &[Vec<f64>]) -> Fantasies {
        let points = columns(2, candidates);
        let prediction = self.model.posterior.predict(&points);
        Fantasies {
            covariances: self.model.posterior.kernel().symmetric(&points),
            noise: self.model.noise(&points, &prediction),
        }
    }

    /// The expected share of some runs, if the model is right.
    pub(super) fn expected(&self, runs: &[Run]) -> f64 {
        let evidence = Evidence::new(runs.iter().cloned());
        let points = evidence.points().iter().map(|runs| runs.point.coordinates());
        let mut fantasies = self.before(&self.gauge.candidates(points));
        for (index, runs) in evidence.points().iter().enumerate() {
            fantasies.noise[TARGETS + index] /= runs.count() as f64;
            fantasies.observe(TARGETS + index);
        }
        self.unit * self.gauge.expected(&fantasies)
    }
}

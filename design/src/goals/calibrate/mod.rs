//! Goal `calibrate`: the parameters with which simulations agree with measurements, and how certain they are.
//!
//! The factors are the parameters, and a last one, `test`, whose levels are the tests: a run simulates one test with one set of parameters.
//!
//! | file | content |
//! |---|---|
//! | `target` | measured numbers, and curves as groups of them |
//! | `prior` | what is known of the parameters before |
//! | `faults` | faults of the fields of the goal |
//! | `emulator` | a model of each measured number over the parameters |
//! | `density` | the posterior density of parameters, by measurements and emulators |
//! | `sampler` | samples of that density |
//! | `acquisition` | the runs that make the emulators certain where the posterior is |
//! | `answer` | intervals, the best set, agreement with each measurement |
//! | `identifiability` | parameters that the tests cannot tell, or not tell apart, and responses that would |
//!
//! Kennedy and O'Hagan 2001 ("Bayesian calibration of computer models") combine emulator, measurement and discrepancy in this way.

mod acquisition;
mod answer;
mod density;
mod emulator;
mod faults;
mod identifiability;
mod prior;
mod sampler;
mod target;
#[cfg(test)]
mod tests_emcee;

use std::collections::BTreeSet;

use serde::{Deserialize, Serialize};

use super::{Course, Finding, Study};
use crate::budget::Budget;
use crate::evidence::{Point, PointRuns};
use crate::factor::Factor;
use crate::proposal::Proposal;
use crate::space::{SEQUENCE_LENGTH, distinct};
pub use answer::{CalibrateAnswer, Interval, ParameterEstimate, TargetAgreement};
pub use identifiability::{Narrowing, PairOfParameters};
pub use prior::{LogNormalPrior, NormalPrior, ParameterPrior};
pub use target::{CurvePlace, Target};

/// Name of the factor whose levels are the tests.
pub const TEST: &str = "test";

/// Number of sets of the first design that are run twice.
const TWICE: usize = 2;

/// The fields of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Calibrate {
    /// The measured numbers.
    pub targets: Vec<Target>,
    /// Priors of parameters; of those without one, uniform along the scale of the factor.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub priors: Vec<ParameterPrior>,
    /// Scale of the model's discrepancy, as a share of each measured mean: its prior is the half of a normal distribution with this
    /// standard deviation. Without it, the model is taken as exact.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub discrepancy: Option<f64>,
    /// The study ends when the emulators contribute less than this share of the variance with which each measured number is compared.
    #[serde(default = "default_emulator_share")]
    pub emulator_share: f64,
}

fn default_emulator_share() -> f64 {
    0.1
}

/// The parameters and tests of a question.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Setup<'a> {
    factors: &'a [Factor],
}

impl<'a> Setup<'a> {
    pub(crate) fn of(factors: &'a [Factor]) -> Self {
        Self { factors }
    }

    /// The factor of tests; none with a single test.
    fn test_factor(&self) -> Option<&'a Factor> {
        self.factors.last().filter(|factor| factor.name == TEST)
    }

    /// The parameters.
    pub(crate) fn parameters(&self) -> &'a [Factor] {
        &self.factors[..self.factors.len() - usize::from(self.test_factor().is_some())]
    }

    /// Number of tests.
    pub(crate) fn tests(&self) -> usize {
        self.test_factor().map_or(1, |factor| factor.levels.len())
    }

    /// The index of a test by name. A single test may have any name.
    fn test(&self, name: &str) -> Option<usize> {
        match self.test_factor() {
            None => Some(0),
            Some(factor) => factor.levels.iter().position(|level| level.as_str() == Some(name)),
        }
    }

    /// The point of a run: a set of parameters, in coordinates from 0 to 1, and a test.
    fn point(&self, parameters: &[f64], test: usize) -> Point {
        let test = self.test_factor().and_then(|factor| factor.coordinate(test as f64));
        let coordinates: Vec<f64> = parameters.iter().copied().chain(test).collect();
        Point::new(&coordinates).rounded(self.factors)
    }

    /// The coordinates of the parameters, and the index of the test.
    fn split(&self, point: &Point) -> (Vec<f64>, usize) {
        let mut coordinates = point.coordinates();
        let test = self.test_factor().and_then(|factor| Some(factor.value(coordinates.pop()?) as usize));
        (coordinates, test.unwrap_or(0))
    }

    /// The runs of each test, at points of the parameters alone.
    fn runs_by_test<'b>(&self, points: impl Iterator<Item = &'b PointRuns>) -> Vec<Vec<PointRuns>> {
        let mut by_test = vec![Vec::new(); self.tests()];
        for runs in points {
            let (parameters, test) = self.split(&runs.point);
            by_test[test].push(PointRuns { point: Point::new(&parameters), ..runs.clone() });
        }
        by_test
    }
}

/// Number of sets of parameters with which a question begins: six a parameter, and at most half of the budget.
pub(crate) fn first_sets(factors: &[Factor], budget: &Budget) -> usize {
    let setup = Setup::of(factors);
    let parameters = setup.parameters().len();
    let affordable = (budget.max_runs / (2 * setup.tests())).max(1);
    (6 * parameters + 2).min(affordable)
}

/// Number of runs in the best case: the first design.
pub(crate) fn least_runs(factors: &[Factor], budget: &Budget) -> usize {
    (first_sets(factors, budget) + TWICE) * Setup::of(factors).tests()
}

pub(super) fn decide(goal: &Calibrate, study: &Study<'_>) -> Course {
    let setup = Setup::of(study.factors);
    let first = first_proposals(study, &setup);
    let by_test = setup.runs_by_test(study.evidence.points().iter());
    let density = density::Density::of(goal, &setup, &by_test);
    let sample = |steps| density.as_ref().and_then(|density| sampler::sample(density, study.seed, steps));
    let samples = sample(sampler::QUICK);
    let (Some(density), Some(mut samples)) = (&density, samples) else {
        let finding = Finding::Calibrate(CalibrateAnswer::unknown(goal));
        let proposals = if first.is_empty() { further_proposals(study, &setup) } else { first };
        return Course { proposals, is_met: false, is_spent: false, finding };
    };
    let mut answer = CalibrateAnswer::of(goal, &setup, density, &samples, &by_test, false);
    let is_begun = first.is_empty() && !has_pending(study, &setup);
    let is_certain = is_begun && answer.emulator_share.is_some_and(|share| share <= goal.emulator_share);
    let unknown = if is_certain {
        acquisition::of_unknown(study, &setup, density, &samples, &unknown_tests(&setup, &answer))
    } else {
        Vec::new()
    };
    let is_met = is_certain && unknown.is_empty();
    let is_last =
        study.evidence.pending() == 0 && (is_met || study.evidence.spent() >= study.budget.max_runs);
    let proposals = match () {
        () if study.room == 0 || is_met => Vec::new(),
        () if is_certain => unknown,
        // Workers that are free before the first design has ended take runs that it suggests already.
        () if first.is_empty() => acquisition::proposals(study, &setup, density, &samples),
        () => first,
    };
    if is_last && let Some(thorough) = sample(sampler::THOROUGH) {
        samples = thorough;
        answer = CalibrateAnswer::of(goal, &setup, density, &samples, &by_test, true);
    }
    Course { proposals, is_met, is_spent: false, finding: Finding::Calibrate(answer) }
}

/// The tests with a measured number that too few runs have.
fn unknown_tests(setup: &Setup<'_>, answer: &CalibrateAnswer) -> Vec<usize> {
    let unknown = answer.targets.iter().filter(|of| of.simulated.is_none());
    let tests: BTreeSet<usize> = unknown.filter_map(|of| setup.test(&of.target.test)).collect();
    tests.into_iter().collect()
}

/// The sets of parameters of the first design.
fn first_design(study: &Study<'_>, setup: &Setup<'_>) -> Vec<Vec<f64>> {
    let sets = first_sets(study.factors, study.budget);
    distinct(setup.parameters(), 0..sets, study.seed).map(|point| point.coordinates()).collect()
}

/// Runs of the first design that do not exist yet: every set of parameters in every test. The first two sets are run twice, which tells
/// whether a test depends on its seed. A test that has as many sets already, of narrower ranges for instance, needs no others.
fn first_proposals(study: &Study<'_>, setup: &Setup<'_>) -> Vec<Proposal> {
    let mut proposals = Vec::new();
    let design = first_design(study, setup);
    let is_of_design =
        |point: &Point| design.iter().any(|set| setup.point(set, setup.split(point).1) == *point);
    let mut others = vec![0; setup.tests()];
    for runs in study.evidence.points().iter().filter(|runs| !is_of_design(&runs.point)) {
        others[setup.split(&runs.point).1] += 1;
    }
    for (index, set) in design.iter().enumerate() {
        let wanted = if index < TWICE { 2.min(study.budget.max_replicates) } else { 1 };
        for test in (0..setup.tests()).filter(|test| others[*test] < design.len()) {
            let point = setup.point(set, test);
            let known = study.evidence.at(&point);
            if known.is_some_and(|known| study.excludes(known)) {
                continue;
            }
            let (count, next) = known.map_or((0, 0), |known| (known.count(), known.next_replicate()));
            let missing = (count..wanted).zip(next..).map(|(_, replicate)| replicate);
            proposals.extend(missing.map(|replicate| Proposal { point: point.clone(), replicate }));
        }
    }
    proposals
}

/// Whether a run of the first design is in flight.
fn has_pending(study: &Study<'_>, setup: &Setup<'_>) -> bool {
    let design = first_design(study, setup);
    let points = design.iter().flat_map(|set| (0..setup.tests()).map(|test| setup.point(set, test)));
    points.filter_map(|point| study.evidence.at(&point)).any(|runs| runs.pending() > 0)
}

/// Further sets of the sequence, one run of each test: nothing is known yet, or nothing agrees.
fn further_proposals(study: &Study<'_>, setup: &Setup<'_>) -> Vec<Proposal> {
    let known: BTreeSet<&Point> = study.evidence.points().iter().map(|runs| &runs.point).collect();
    let sets =
        distinct(setup.parameters(), first_sets(study.factors, study.budget)..SEQUENCE_LENGTH, study.seed);
    let points = sets
        .flat_map(|set| (0..setup.tests()).map(move |test| (set.coordinates(), test)).collect::<Vec<_>>());
    let points = points.map(|(set, test)| setup.point(&set, test));
    let new = points.filter(|point| !known.contains(point));
    new.take(study.room).map(|point| Proposal { point, replicate: 0 }).collect()
}

//! Studies, without IO: from the document to a question, from trials to evidence, from decisions to trials, and answers in words.
//!
//! - `read` checks a submitted study and lists every fault; `measures` checks the responses that its goal names.
//! - `asks` hands runs out to clients, and adds runs at points of theirs; `tells` checks the outcomes that they tell.
//! - `calibration` turns measurements into targets and scenarios of tests.
//! - `impossible` are points of the ranges whose scenarios have faults.
//! - `observations` are runs that are no jobs of the study; `seeding` copies them from earlier sweeps.
//! - `ranges` checks wider ranges.
//! - `trials` turns trials of the sweep and observations into evidence, and proposals into trials.
//! - `sentences` states question and answer; `words` names factors and measures.
//!
//! The decision itself is [`roost_design::decide`].

mod asks;
mod calibration;
mod impossible;
mod measures;
mod observations;
mod ranges;
mod read;
mod seeding;
pub(crate) mod sentences;
mod tells;
#[cfg(test)]
mod tests;
mod trials;
mod words;

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::study::{SeedingSweep, StudyEnd, StudySpec};
use roost_api::sweep::SweepSpec;
use roost_api::table::TrialRow;
use roost_design::goals::calibrate::TEST;
use roost_design::{Answer, Finished, Point, Proposal, Question, decide};
use roost_solver::observable::Observable;
use roost_solver::scenario::Scenario;
use serde_json::Value;

use crate::sweep::{Point as DesignPoint, Points, Posterior, Trial};
pub(crate) use asks::HandOut;
use calibration::CalibrationTest;
use impossible::ImpossiblePoint;
pub(crate) use impossible::impossible_points;
pub(crate) use observations::{Observation, Source};
pub(crate) use ranges::{Ranges, widen, with_ranges};
pub(crate) use read::read;
pub(crate) use roost_api::study::SCHEMA;
pub(crate) use seeding::{Copied, MAX_SEEDING_RUNS, SweepRun};
pub(crate) use tells::{ToldOutcome, ToldRun};
use trials::{Known, MAX_SEED};

/// Number of decisions in a row that may propose points whose scenarios have faults.
const MAX_ROUNDS: usize = 20;

/// A study that can be decided about.
#[derive(Clone, Debug)]
pub(crate) struct Study {
    /// As submitted.
    pub(crate) spec: StudySpec,
    /// Its question, with the present budget.
    pub(crate) question: Question,
    /// Makes the scenarios of its runs; in a calibration those of the first test.
    points: Points,
    /// The tests of a calibration.
    tests: Vec<CalibrationTest>,
    /// Seed of the base, from which all others follow.
    seed: u64,
    /// The sweeps that it began with.
    pub(crate) seeding: Vec<SeedingSweep>,
    /// The ranges as submitted.
    first_ranges: Ranges,
    /// Number of attempts at a confirmation before the ranges grew. Their runs belong to the search now.
    past_attempts: u32,
    /// Points at which nothing can be run, as earlier decisions found.
    impossible: Vec<ImpossiblePoint>,
}

/// A stored study as it is now.
#[derive(Clone, Debug)]
pub(crate) struct Present {
    /// As submitted.
    pub(crate) submitted: StudySpec,
    /// The budget.
    pub(crate) max_runs: u32,
    /// The ranges; none as submitted.
    pub(crate) ranges: Option<Ranges>,
    /// Number of attempts at a confirmation before the ranges grew.
    pub(crate) past_attempts: u32,
    /// The sweeps that it began with.
    pub(crate) seeding: Vec<SeedingSweep>,
    /// Points at which nothing can be run, as earlier decisions found.
    pub(crate) impossible: Vec<ImpossiblePoint>,
}

impl Present {
    /// The document with its present ranges.
    pub(crate) fn spec(&self) -> StudySpec {
        with_ranges(self.submitted.clone(), self.ranges.as_deref().unwrap_or_default())
    }
}

/// A decision: runs that come next, and the answer so far.
#[derive(Debug)]
pub(crate) struct Decided {
    /// Runs that come next.
    pub(crate) trials: Vec<Trial>,
    /// Number of points of the sweep with them.
    pub(crate) points: u32,
    /// Maximum number of runs at a point with them.
    pub(crate) replicates: u32,
    /// Whether the study needs no further runs, and only waits for those that have begun.
    pub(crate) is_met: bool,
    /// Why the study is finished; none while it goes on.
    pub(crate) finished: Option<StudyEnd>,
    /// The answer as numbers.
    pub(crate) answer: Answer,
    /// The answer in words.
    pub(crate) sentences: Vec<String>,
}

impl Study {
    /// Decides about up to `wanted` further runs after some trials and observations.
    ///
    /// The corners of the ranges were checked when the study was submitted, but a scenario inside them may have faults. Its point is then left
    /// out, and the decision made again.
    ///
    /// # Errors
    ///
    /// The faults of a point, when [`MAX_ROUNDS`] decisions have found no point without faults.
    pub(crate) fn decide(
        &self,
        trials: &[TrialRow],
        observations: &[Observation],
        wanted: usize,
    ) -> Result<Decided, Vec<Fault>> {
        let mut known = self.known(trials, observations);
        let mut rounds = 1;
        let decision = loop {
            let mut decision = decide(&self.question, &known.evidence, wanted, self.seed);
            let mut refused = self.refused(decision.proposals.iter().map(|proposal| &proposal.point));
            if refused.is_empty() {
                break decision;
            }
            if rounds == MAX_ROUNDS {
                decision.proposals.retain(|proposal| !refused.contains_key(&proposal.point));
                if decision.proposals.is_empty() {
                    return Err(refused.into_values().next().unwrap_or_default());
                }
                break decision;
            }
            // The points of an estimate are known beforehand.
            refused.extend(self.refused(&self.estimated_points()));
            rounds += 1;
            let reason = |faults: Vec<Fault>| faults.first().map(ToString::to_string).unwrap_or_default();
            let impossible = refused.into_iter().map(|(point, faults)| (point, reason(faults)));
            known.evidence = known.evidence.with_impossible(impossible.collect());
        };
        let sentences = sentences::answer(self, &decision.answer, &known);
        let finished = decision.finished.map(|finished| match finished {
            Finished::ByRule => StudyEnd::ByRule,
            Finished::ByBudget => StudyEnd::ByBudget,
            Finished::NothingLeft => StudyEnd::NothingLeft,
        });
        let (is_met, answer, none) = (decision.is_met, decision.answer, Vec::new());
        let decided = Decided { trials: none, points: 0, replicates: 0, is_met, finished, answer, sentences };
        self.with_trials(decided, trials, &decision.proposals, known)
    }

    /// A decision with the trials of some proposals.
    fn with_trials(
        &self,
        decided: Decided,
        trials: &[TrialRow],
        proposals: &[Proposal],
        known: Known,
    ) -> Result<Decided, Vec<Fault>> {
        let (new, points) = self.trials(proposals, known)?;
        let replicates = trials::most_at_a_point(trials, &new);
        Ok(Decided { trials: new, points, replicates, ..decided })
    }

    /// The design point of a point of the question, or the faults of its scenario.
    fn made(&self, point: &Point) -> Result<DesignPoint, Vec<Fault>> {
        let levels = point.levels(&self.question.factors);
        if self.tests.is_empty() {
            return self.points.at_values(levels);
        }
        let (test, parameters) = calibration::split(&self.question, &levels);
        let mut made = self.tests[test].points.at_values(parameters.to_vec())?;
        if self.tests.len() > 1 {
            made.levels.insert(TEST.to_owned(), Value::String(self.tests[test].name.clone()));
        }
        Ok(made)
    }

    /// A scenario with the parameters that its seed draws from a posterior, if the study has one.
    fn drawn(&self, scenario: Scenario) -> Result<Scenario, Vec<Fault>> {
        match self.spec.posterior.as_ref().and_then(Posterior::of) {
            Some(posterior) => posterior.applied(&scenario, posterior.index_of_seed(scenario.seed)),
            None => Ok(scenario),
        }
    }

    /// Numbers of a trial's run that its goal needs and that are no responses, by name.
    pub(crate) fn curve_points(&self, trial: &TrialRow) -> Option<&BTreeMap<String, Observable>> {
        let name = trial.factors.get(TEST).and_then(Value::as_str);
        let test = match name {
            Some(name) => self.tests.iter().find(|test| test.name == name),
            None => self.tests.first(),
        };
        test.map(|test| &test.curve_points).filter(|points| !points.is_empty())
    }

    /// The question in words.
    pub(crate) fn question_sentence(&self) -> String {
        sentences::question(self)
    }

    /// Number of runs in the best case: with fewer its rule cannot end it.
    pub(crate) fn least_runs(&self) -> u64 {
        roost_design::forecast::least_runs(&self.question) as u64
    }

    /// Names of its factors.
    pub(crate) fn factor_names(&self) -> Vec<String> {
        self.question.factors.iter().map(|factor| factor.name.clone()).collect()
    }

    /// The specification of its sweep: a list of the two corners of the range.
    pub(crate) fn sweep_spec(&self) -> SweepSpec {
        // Its runs choose their samples by their seeds.
        SweepSpec { posterior: None, ..read::sweep_spec(&self.spec) }
    }
}

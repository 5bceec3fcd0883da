//! Trials and observations as evidence, and proposals as trials.

use std::collections::{BTreeMap, BTreeSet, HashSet};

use roost_api::Fault;
use roost_api::ids::SweepId;
use roost_api::job::JobState;
use roost_api::table::TrialRow;
use roost_design::goals::FIRST_CONFIRMATION;
use roost_design::{Evidence, Outcome, Point, Proposal, Run};
use serde_json::Value;

use super::Study;
use super::observations::{Observation, Source, numbers};
use crate::sweep::Trial;

/// Largest seed.
pub(super) const MAX_SEED: u64 = (1 << 53) - 1;

/// All runs of a study.
#[derive(Clone, Debug, Default)]
pub(super) struct Known {
    pub(super) evidence: Evidence,
    /// Runs of sweeps, by sweep.
    pub(super) copies: BTreeMap<SweepId, Copies>,
    /// Runs at points of clients.
    pub(super) told: u64,
    /// Runs without a jam whose simulated time ended while product was left.
    pub(super) unfinished: u64,
    pub(super) replicates: ReplicateNumbers,
    /// The index of each point with jobs.
    indices: BTreeMap<Point, u32>,
    /// Number of points of the sweep.
    count: u32,
    seeds: HashSet<u64>,
}

/// Number of runs that were copied from a sweep.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Copies {
    /// Runs that are evidence.
    pub(super) used: u64,
    /// Runs outside the ranges.
    pub(super) outside: u64,
}

/// Gives each run at a point a replicate of its own.
#[derive(Clone, Debug, Default)]
pub(super) struct ReplicateNumbers(BTreeMap<Point, BTreeSet<u32>>);

impl ReplicateNumbers {
    /// The first free replicate at a point, from one on.
    pub(super) fn take(&mut self, point: &Point, from: u32) -> u32 {
        let taken = self.0.entry(point.clone()).or_default();
        let free = (from..).find(|replicate| taken.insert(*replicate));
        free.unwrap_or(u32::MAX)
    }
}

impl Study {
    /// The evidence of trials and observations. A run with the same point and seed as another counts once.
    ///
    /// Two points can become one when the ranges grow, since values are rounded. Their runs then get different replicates here.
    pub(super) fn known(&self, trials: &[TrialRow], observations: &[Observation]) -> Known {
        let mut known = Known::default();
        let mut seen: HashSet<(Point, u64)> = HashSet::new();
        let mut runs = Vec::with_capacity(trials.len() + observations.len());
        let mut trials: Vec<&TrialRow> = trials.iter().collect();
        trials.sort_by_key(|trial| (trial.point, trial.replicate));
        for trial in trials {
            known.count = known.count.max(trial.point + 1);
            known.seeds.insert(trial.seed);
            // No trial is outside the ranges: they only grow.
            let Some(point) = self.point(&|name| trial.factors.get(name)) else { continue };
            known.indices.entry(point.clone()).or_insert(trial.point);
            let outcome = outcome(trial);
            known.unfinished += u64::from(is_unfinished(&outcome));
            if outcome != Outcome::Cancelled {
                seen.insert((point.clone(), trial.seed));
            }
            let replicate = known.replicates.take(&point, self.replicate(trial.replicate));
            runs.push(Run { point, replicate, outcome });
        }
        let mut observations: Vec<&Observation> = observations.iter().collect();
        observations.sort_by_key(|observation| observation.order());
        let mut free = 0;
        for observation in observations {
            known.seeds.insert(observation.seed);
            let point = self.point(&|name| observation.levels.get(name));
            let is_new = point.as_ref().is_none_or(|point| seen.insert((point.clone(), observation.seed)));
            if !is_new {
                continue;
            }
            match observation.source {
                Source::Sweep(sweep) => {
                    let copies = known.copies.entry(sweep).or_default();
                    *(if point.is_some() { &mut copies.used } else { &mut copies.outside }) += 1;
                }
                Source::Client => known.told += 1,
                Source::Asked => {}
            }
            // Only a sweep has runs outside the ranges.
            let Some(point) = point else { continue };
            free += usize::from(observation.is_free());
            known.unfinished += u64::from(is_unfinished(&observation.outcome));
            let replicate = known.replicates.take(&point, self.replicate(observation.replicate));
            runs.push(Run { point, replicate, outcome: observation.outcome.clone() });
        }
        known.evidence = Evidence::new(runs).with_free(free).with_impossible(self.impossible());
        known
    }

    /// The point of some values; none outside the ranges.
    fn point<'a>(&self, level: &dyn Fn(&str) -> Option<&'a Value>) -> Option<Point> {
        let factors = &self.question.factors;
        let levels = factors.iter().map(|factor| level(&factor.name).cloned());
        Point::of_run(factors, &levels.collect::<Option<Vec<Value>>>()?)
    }

    /// The replicate of a stored run in the evidence. A confirmation before the ranges grew was one of another question: its runs count as
    /// runs of the search, and the attempts begin at 1 again.
    fn replicate(&self, stored: u32) -> u32 {
        let past = self.past_attempts.saturating_mul(FIRST_CONFIRMATION);
        match stored {
            0..FIRST_CONFIRMATION => stored,
            _ if stored - FIRST_CONFIRMATION < past => 0,
            _ => stored - past,
        }
    }

    /// The replicate that a proposed run gets in the store.
    fn stored_replicate(&self, proposed: u32) -> u32 {
        let past = self.past_attempts.saturating_mul(FIRST_CONFIRMATION);
        if proposed < FIRST_CONFIRMATION { proposed } else { proposed.saturating_add(past) }
    }

    /// The trials of proposals, the first of each new point with its levels, and the number of points with them; or the faults of a scenario.
    pub(super) fn trials(
        &self,
        proposals: &[Proposal],
        mut known: Known,
    ) -> Result<(Vec<Trial>, u32), Vec<Fault>> {
        let mut trials = Vec::with_capacity(proposals.len());
        for Proposal { point, replicate } in proposals {
            let made = self.made(point)?;
            let replicate = self.stored_replicate(*replicate);
            let is_new = !known.indices.contains_key(point);
            let index = *known.indices.entry(point.clone()).or_insert(known.count);
            known.count = known.count.max(index + 1);
            let mut scenario = made.scenario;
            scenario.seed = self.new_seed(&point.values(&self.question.factors), replicate, &mut known.seeds);
            scenario = self.drawn(scenario)?;
            let levels = is_new.then_some(made.levels);
            trials.push(Trial { point: index, replicate, scenario, levels });
        }
        Ok((trials, known.count))
    }

    /// The seed of a run, which depends on the base's seed, the values of the factors (of levels their indices) and the replicate, and is none
    /// of `known`.
    ///
    /// Runs at different points have different seeds: the models take their deviations for independent. Another study of the same base
    /// has the same seeds at the same points: if this one began with its runs, they are known.
    fn new_seed(&self, values: &[f64], replicate: u32, known: &mut HashSet<u64>) -> u64 {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.seed.to_le_bytes()).update(&replicate.to_le_bytes());
        for value in values {
            hasher.update(&value.to_bits().to_le_bytes());
        }
        let mut stream = hasher.finalize_xof();
        loop {
            let mut bytes = [0; 8];
            stream.fill(&mut bytes);
            let seed = u64::from_le_bytes(bytes) & MAX_SEED;
            if known.insert(seed) {
                return seed;
            }
        }
    }
}

/// The outcome of a trial.
fn outcome(trial: &TrialRow) -> Outcome {
    match trial.state {
        JobState::Queued | JobState::Running => Outcome::Pending,
        JobState::Failed => Outcome::Failed,
        JobState::Cancelled => Outcome::Cancelled,
        JobState::Succeeded => Outcome::Responses(numbers(&trial.responses)),
    }
}

/// Whether a hopper did not jam but still could: at least 5 % of the filled mass was inside at the end, as in the definition of a jam.
fn is_unfinished(outcome: &Outcome) -> bool {
    let Outcome::Responses(responses) = outcome else { return false };
    let [jammed, inside_kg, filled_kg] =
        ["jammed", "inside_kg", "filled_kg"].map(|name| responses.get(name).copied().unwrap_or(f64::NAN));
    jammed == 0.0 && inside_kg >= 0.05 * filled_kg
}

/// Maximum number of jobs at a point, with new ones.
pub(super) fn most_at_a_point(trials: &[TrialRow], new: &[Trial]) -> u32 {
    let mut jobs: BTreeMap<u32, u32> = BTreeMap::new();
    for point in trials.iter().map(|trial| trial.point).chain(new.iter().map(|trial| trial.point)) {
        *jobs.entry(point).or_default() += 1;
    }
    jobs.into_values().max().unwrap_or(1)
}

//! Trials of a study's sweep as evidence, and proposals as trials.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::job::JobState;
use roost_api::table::TrialRow;
use roost_design::{Evidence, Outcome, Point, Proposal, Run};
use serde_json::{Map, Value, json};

use super::Study;
use crate::sweep::Trial;

/// Largest seed.
const MAX_SEED: u64 = (1 << 53) - 1;

/// The points of a study's sweep, with their indices.
#[derive(Clone, Debug, Default)]
pub(super) struct KnownPoints {
    indices: BTreeMap<Point, u32>,
    /// Number of points of the sweep.
    count: u32,
}

impl Study {
    /// The evidence of trials, and their points.
    pub(super) fn evidence(&self, trials: &[TrialRow]) -> (Evidence, KnownPoints) {
        let mut known = KnownPoints::default();
        let mut runs = Vec::with_capacity(trials.len());
        for trial in trials {
            known.count = known.count.max(trial.point + 1);
            // A trial outside the range cannot be: the range of a study does not change.
            let Some(point) = self.point(&trial.factors) else { continue };
            known.indices.insert(point.clone(), trial.point);
            runs.push(Run { point, replicate: trial.replicate, outcome: outcome(trial) });
        }
        (Evidence::new(runs), known)
    }

    fn point(&self, levels: &Map<String, Value>) -> Option<Point> {
        let factors = &self.question.factors;
        let value = |factor: &roost_design::Factor| levels.get(&factor.name).and_then(Value::as_f64);
        Point::of_values(factors, &factors.iter().map(value).collect::<Option<Vec<f64>>>()?)
    }

    /// The trials of proposals, the first of each new point with its levels, and the number of points with them; or the faults of a scenario.
    pub(super) fn trials(
        &self,
        proposals: &[Proposal],
        mut known: KnownPoints,
    ) -> Result<(Vec<Trial>, u32), Vec<Fault>> {
        let mut trials = Vec::with_capacity(proposals.len());
        for Proposal { point, replicate } in proposals {
            let values = point.values(&self.question.factors);
            let made = self.points.at_values(values.iter().map(|value| json!(value)).collect())?;
            let is_new = !known.indices.contains_key(point);
            let index = *known.indices.entry(point.clone()).or_insert(known.count);
            known.count = known.count.max(index + 1);
            let mut scenario = made.scenario;
            scenario.seed = self.seed_of(&values, *replicate);
            let levels = is_new.then_some(made.levels);
            trials.push(Trial { point: index, replicate: *replicate, scenario, levels });
        }
        Ok((trials, known.count))
    }

    /// The seed of a run, which depends on the base's seed, the values of the factors and the replicate alone.
    ///
    /// Runs at different points have different seeds: the models take their deviations for independent.
    fn seed_of(&self, values: &[f64], replicate: u32) -> u64 {
        let mut hasher = blake3::Hasher::new();
        hasher.update(&self.seed.to_le_bytes()).update(&replicate.to_le_bytes());
        for value in values {
            hasher.update(&value.to_bits().to_le_bytes());
        }
        let mut bytes = [0; 8];
        hasher.finalize_xof().fill(&mut bytes);
        u64::from_le_bytes(bytes) & MAX_SEED
    }
}

/// The outcome of a trial.
fn outcome(trial: &TrialRow) -> Outcome {
    match trial.state {
        JobState::Queued | JobState::Running => Outcome::Pending,
        JobState::Failed => Outcome::Failed,
        JobState::Cancelled => Outcome::Cancelled,
        JobState::Succeeded => {
            let number = |value: &Value| {
                value.as_f64().or(value.as_bool().map(|is_true| f64::from(u8::from(is_true))))
            };
            let responses = trial.responses.iter();
            Outcome::Responses(
                responses.filter_map(|(name, value)| Some((name.clone(), number(value)?))).collect(),
            )
        }
    }
}

/// Maximum number of runs at a point, with those that are proposed.
pub(super) fn most_at_a_point(evidence: &Evidence, proposals: &[Proposal]) -> u32 {
    let mut runs: BTreeMap<&Point, usize> =
        evidence.points().iter().map(|known| (&known.point, known.runs.len())).collect();
    for proposal in proposals {
        *runs.entry(&proposal.point).or_default() += 1;
    }
    runs.into_values().max().map_or(1, |most| u32::try_from(most).unwrap_or(u32::MAX))
}

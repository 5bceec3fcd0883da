//! Seeding: finished runs of earlier sweeps become observations of a new study.
//!
//! A run is copied if its scenario is that of the base with other values of the factors and another seed, and its result comes from the
//! present revision of the solver. Values outside a range are copied too, since ranges grow. Levels that a factor lacks are not: lists of
//! levels never grow. A copy survives the deletion of its sweep.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};

use roost_api::ids::SweepId;
use roost_api::study::SeedingSweep;
use roost_design::{Factor, Outcome};
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::{self, Scenario, escape};
use serde_json::{Map, Value, json};

use super::Study;
use super::observations::{Observation, Source, numbers};

/// Maximum number of runs that a study begins with.
pub(crate) const MAX_SEEDING_RUNS: u64 = 10_000;

/// A finished run of a sweep.
#[derive(Clone, Debug)]
pub(crate) struct SweepRun {
    /// Its complete scenario.
    pub(crate) scenario: Value,
    /// The revision of the solver that made its result.
    pub(crate) solver_revision: u32,
    /// Its responses.
    pub(crate) responses: Map<String, Value>,
}

/// Runs that were copied before, from all sweeps of a study: for each seed the points, as the texts of their values, and the sweep of each.
#[derive(Debug, Default)]
pub(crate) struct Copied(BTreeMap<u64, BTreeMap<Vec<String>, SweepId>>);

impl Copied {
    /// Notes a run. Returns whether it is new.
    fn insert(&mut self, seed: u64, texts: Vec<String>, sweep: SweepId) -> bool {
        let Entry::Vacant(place) = self.0.entry(seed).or_default().entry(texts) else { return false };
        place.insert(sweep);
        true
    }

    /// The sweeps with a run whose seed occurs at another point, of the same sweep or of another one.
    fn sharing_seeds(&self) -> BTreeSet<SweepId> {
        let shared = self.0.values().filter(|points| points.len() > 1);
        shared.flat_map(|points| points.values().copied()).collect()
    }
}

impl Study {
    /// Copies the finished runs of a sweep, which has `without_result` others. Sweeps that came before are marked too, when this one has
    /// their seeds at other points.
    pub(crate) fn copy(
        &mut self,
        (sweep, name, without_result): (SweepId, String, u64),
        runs: &[SweepRun],
        copied: &mut Copied,
    ) -> (SeedingSweep, Vec<Observation>) {
        let mut counts = SeedingSweep {
            sweep,
            name,
            copied: 0,
            other_scenarios: 0,
            first_difference: None,
            other_levels: 0,
            first_other_level: None,
            other_revisions: 0,
            without_result,
            repeated: 0,
            shares_seeds: false,
        };
        let mut observations = Vec::new();
        for run in runs {
            let (levels, seed) = match self.levels_of(&run.scenario) {
                Ok(found) => found,
                Err(pointer) => {
                    counts.other_scenarios += 1;
                    counts.first_difference.get_or_insert(pointer);
                    continue;
                }
            };
            if let Some(level) = self.other_level(&levels) {
                counts.other_levels += 1;
                counts.first_other_level.get_or_insert(level);
                continue;
            }
            if run.solver_revision != SOLVER_REVISION {
                counts.other_revisions += 1;
                continue;
            }
            if !copied.insert(seed, levels.values().map(Value::to_string).collect(), sweep) {
                counts.repeated += 1;
                continue;
            }
            counts.copied += 1;
            observations.push(Observation {
                source: Source::Sweep(sweep),
                levels,
                replicate: 0,
                seed,
                outcome: Outcome::Responses(numbers(&run.responses)),
            });
        }
        let sharing = copied.sharing_seeds();
        for seeding in self.seeding.iter_mut().chain([&mut counts]) {
            seeding.shares_seeds |= sharing.contains(&seeding.sweep);
        }
        (counts, observations)
    }

    /// The first factor that can never have its value, with the value: `/equipment/side_walls = "rough"`.
    fn other_level(&self, levels: &BTreeMap<String, Value>) -> Option<String> {
        let unknown =
            |factor: &&Factor| levels.get(&factor.name).and_then(|value| factor.number(value)).is_none();
        let factor = self.question.factors.iter().find(unknown)?;
        Some(format!("{} = {}", factor.name, json!(levels.get(&factor.name))))
    }

    /// The values of the factors in a scenario that differs from the base in nothing else but the seed, and its seed; or the first field
    /// in which it differs.
    fn levels_of(&self, document: &Value) -> Result<(BTreeMap<String, Value>, u64), String> {
        let scenario: Scenario = scenario::from_value(document)
            .map_err(|faults| faults.into_iter().next().map(|fault| fault.pointer).unwrap_or_default())?;
        let complete = json!(scenario);
        let mut levels = BTreeMap::new();
        let mut values = Vec::new();
        for name in self.factor_names() {
            let value = complete.pointer(&name).cloned().unwrap_or_default();
            if value.is_null() {
                return Err(name);
            }
            values.push(value.clone());
            levels.insert(name, value);
        }
        let made = self.points.at_values(values);
        let made =
            made.map_err(|faults| faults.into_iter().next().map(|fault| fault.pointer).unwrap_or_default())?;
        let expected = Scenario { seed: scenario.seed, ..made.scenario };
        if expected == scenario {
            return Ok((levels, scenario.seed));
        }
        Err(difference(String::new(), &json!(expected), &complete).unwrap_or_default())
    }
}

/// The pointer of the first difference of two documents; none if they are equal.
fn difference(at: String, one: &Value, other: &Value) -> Option<String> {
    match (one, other) {
        (Value::Object(one), Value::Object(other)) => {
            let names: BTreeSet<&String> = one.keys().chain(other.keys()).collect();
            names.into_iter().find_map(|name| {
                let value = |of: &Map<String, Value>| of.get(name).cloned().unwrap_or_default();
                difference(format!("{at}/{}", escape(name)), &value(one), &value(other))
            })
        }
        (one, other) => (one != other).then_some(at),
    }
}

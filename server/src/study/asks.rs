//! Runs for clients: the next proposals, handed out in place of jobs, and jobs at points that a client chooses.

use std::collections::BTreeMap;

use roost_api::Fault;
use roost_api::ask::AskedPoint;
use roost_api::table::TrialRow;
use roost_design::{Goal, Point, Proposal};
use roost_solver::scenario::{Scenario, escape};
use serde_json::{Value, json};

use super::{Decided, Observation, Study};
use crate::document::{fault, prefixed};

/// A run for a client.
#[derive(Clone, Debug)]
pub(crate) struct HandOut {
    /// Value by factor.
    pub(crate) levels: BTreeMap<String, Value>,
    /// Its replicate.
    pub(crate) replicate: u32,
    /// Its seed.
    pub(crate) seed: u64,
}

impl Study {
    /// Decides about up to `count` further runs, which are handed out and become no jobs.
    pub(crate) fn hand_out(
        &self,
        trials: &[TrialRow],
        observations: &[Observation],
        count: usize,
    ) -> Result<(Decided, Vec<HandOut>), Vec<Fault>> {
        let mut decided = self.decide(trials, observations, count)?;
        let runs = std::mem::take(&mut decided.trials).into_iter().map(|trial| {
            let complete = json!(trial.scenario);
            let value = |name: &String| complete.pointer(name).cloned().unwrap_or_default();
            let levels = self.factor_names().into_iter().map(|name| (name.clone(), value(&name)));
            HandOut { levels: levels.collect(), replicate: trial.replicate, seed: trial.scenario.seed }
        });
        let runs = runs.collect();
        Ok((decided, runs))
    }

    /// The complete scenario of a run that was handed out.
    pub(crate) fn scenario_of(
        &self,
        levels: &BTreeMap<String, Value>,
        seed: u64,
    ) -> Result<Scenario, Vec<Fault>> {
        let values = self.factor_names().iter().map(|name| json!(levels.get(name))).collect();
        self.drawn(Scenario { seed, ..self.points.at_values(values)?.scenario })
    }

    /// Decides about no run of its own, and adds runs at the points of a client; or every fault of the points. No more than `most` runs
    /// are added.
    pub(crate) fn add_points(
        &self,
        trials: &[TrialRow],
        observations: &[Observation],
        (given, most): (&[AskedPoint], usize),
    ) -> Result<Decided, Vec<Fault>> {
        let mut known = self.known(trials, observations);
        let mut faults = Vec::new();
        self.refuse_points("/points", &mut faults);
        let mut points = Vec::new();
        for (index, asked) in given.iter().enumerate() {
            let at = format!("/points/{index}/values");
            let values = self.check_values(&at, &asked.values, &mut faults);
            let point = values.and_then(|values| Point::of_run(&self.question.factors, &values));
            points.extend(point.map(|point| (point, asked.replicates)));
        }
        let wanted: u64 = given.iter().map(|asked| u64::from(asked.replicates)).sum();
        let left = self.question.budget.max_runs.saturating_sub(known.evidence.spent());
        let allowed = left.min(most);
        if wanted == 0 || wanted > allowed as u64 {
            let detail = format!("{wanted} runs in all");
            let allowed = format!("1 to {most} runs, and {left} are left of the budget");
            faults.push(fault("/points", json!(wanted), &detail, &allowed));
        }
        if !faults.is_empty() {
            return Err(faults);
        }
        let proposals: Vec<Proposal> = points
            .into_iter()
            .flat_map(|(point, replicates)| (0..replicates).map(move |_| point.clone()))
            .map(|point| Proposal { replicate: known.replicates.take(&point, 0), point })
            .collect();
        let decided = self.decide(trials, observations, 0)?;
        let made = self.with_trials(decided, trials, &proposals, known);
        made.map_err(|faults| prefixed("/points", faults))
    }

    /// Refuses points of a client when the goal cannot use them.
    pub(super) fn refuse_points(&self, at: &str, faults: &mut Vec<Fault>) {
        if matches!(self.question.goal, Goal::Sensitivity(_)) {
            let detail = "a sensitivity rests on the points of its own design";
            faults.push(fault(at, Value::Null, detail, "runs of the study's own design"));
        }
    }

    /// The values of a point in the order of the factors; none, with every fault, if it is no point of the ranges.
    pub(super) fn check_values(
        &self,
        at: &str,
        values: &BTreeMap<String, Value>,
        faults: &mut Vec<Fault>,
    ) -> Option<Vec<Value>> {
        let (before, mut levels) = (faults.len(), Vec::new());
        let names = self.factor_names();
        for (name, value) in values.iter().filter(|(name, _)| !names.contains(name)) {
            let at = format!("{at}/{}", escape(name));
            faults.push(fault(&at, json!(value), "no factor of the study", &names.join(", ")));
        }
        for factor in &self.question.factors {
            let at = format!("{at}/{}", escape(&factor.name));
            let Some(value) = values.get(&factor.name) else {
                faults.push(fault(&at, Value::Null, "the factor has no value", &factor.allowed()));
                continue;
            };
            match factor.number(value).filter(|number| factor.coordinate(*number).is_some()) {
                Some(number) => levels.push(factor.level(number)),
                None => faults.push(fault(&at, value.clone(), "no value of the factor", &factor.allowed())),
            }
        }
        (faults.len() == before).then_some(levels)
    }
}

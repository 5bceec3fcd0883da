//! Outcomes that a client tells: which run each belongs to, and every fault of them.

use std::collections::{BTreeMap, BTreeSet};

use roost_api::Fault;
use roost_api::ask::{RunOutcome, Tell};
use roost_design::Measure;
use roost_solver::scenario::escape;
use serde_json::{Value, json};

use super::measures::measures;
use super::{MAX_SEED, Study};
use crate::document::fault;

/// Maximum number of outcomes of one request.
const MAX_OUTCOMES: usize = 1000;

/// The run that an outcome belongs to.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum ToldRun {
    /// One that was handed out, by its number.
    HandedOut(u64),
    /// One at a point of the client: its values by factor as JSON, and its seed.
    Own {
        /// Values by factor, as JSON text.
        levels: String,
        /// Its seed.
        seed: u64,
    },
}

/// An outcome as a client tells it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum ToldOutcome {
    /// Responses by name.
    Done(BTreeMap<String, f64>),
    /// It failed.
    Failed,
    /// The client will not run it.
    GivenBack,
}

impl Study {
    /// The outcomes of a request by run, or every fault. `handed_out` has the numbers of all runs that were ever handed out.
    pub(crate) fn read_outcomes(
        &self,
        tell: &Tell,
        handed_out: &BTreeSet<u64>,
    ) -> Result<Vec<(ToldRun, ToldOutcome)>, Vec<Fault>> {
        let (mut told, mut faults, mut seen) = (Vec::new(), Vec::new(), BTreeSet::new());
        if tell.outcomes.len() > MAX_OUTCOMES {
            let allowed = format!("at most {MAX_OUTCOMES}");
            faults.push(fault("/outcomes", json!(tell.outcomes.len()), "too many outcomes", &allowed));
        }
        for (index, outcome) in tell.outcomes.iter().take(MAX_OUTCOMES).enumerate() {
            let at = format!("/outcomes/{index}");
            let run = self.told_run(&at, outcome, handed_out, &mut faults);
            let outcome = self.told_outcome(&at, outcome, &mut faults);
            let Some(run) = run else { continue };
            if !seen.insert(run.clone()) {
                faults.push(fault(&at, json!(index), "the run is listed twice", "each run once"));
            }
            told.extend(outcome.map(|outcome| (run, outcome)));
        }
        if faults.is_empty() { Ok(told) } else { Err(faults) }
    }

    fn told_run(
        &self,
        at: &str,
        outcome: &RunOutcome,
        handed_out: &BTreeSet<u64>,
        faults: &mut Vec<Fault>,
    ) -> Option<ToldRun> {
        match (outcome.run, &outcome.values) {
            (Some(run), None) => {
                if let Some(seed) = outcome.seed {
                    let detail = "the run was handed out with its seed";
                    faults.push(fault(&format!("{at}/seed"), json!(seed), detail, "left out"));
                }
                if !handed_out.contains(&run) {
                    let detail = "no such run was handed out";
                    faults.push(fault(
                        &format!("{at}/run"),
                        json!(run),
                        detail,
                        "a run of an answer to `ask`",
                    ));
                    return None;
                }
                Some(ToldRun::HandedOut(run))
            }
            (None, Some(values)) => {
                self.refuse_points(&format!("{at}/values"), faults);
                let checked = self.check_values(&format!("{at}/values"), values, faults);
                let Some(seed) = outcome.seed else {
                    let allowed =
                        format!("a whole number from 0 to {MAX_SEED}, another one for each run at the point");
                    faults.push(fault(&format!("{at}/seed"), Value::Null, "the run has no seed", &allowed));
                    return None;
                };
                // The same numbers have the same text.
                let levels = |levels: Vec<Value>| {
                    self.factor_names().into_iter().zip(levels).collect::<BTreeMap<_, _>>()
                };
                checked.map(|checked| ToldRun::Own { levels: json!(levels(checked)).to_string(), seed })
            }
            (run, _) => {
                let detail = "the outcome names no run, or two";
                faults.push(fault(at, json!(run), detail, "either `run`, or `values` and `seed`"));
                None
            }
        }
    }

    fn told_outcome(&self, at: &str, outcome: &RunOutcome, faults: &mut Vec<Fault>) -> Option<ToldOutcome> {
        match (&outcome.responses, outcome.failed, outcome.given_back) {
            (Some(responses), false, false) => {
                self.told_responses(at, responses, faults).map(ToldOutcome::Done)
            }
            (None, true, false) => Some(ToldOutcome::Failed),
            (None, false, true) if outcome.run.is_some() => Some(ToldOutcome::GivenBack),
            _ => {
                let allowed = "one of `responses`, `failed` (true), and `given_back` (true) for a run that was handed out";
                faults.push(fault(at, Value::Null, "the run has no outcome, or several", allowed));
                None
            }
        }
    }

    fn told_responses(
        &self,
        at: &str,
        responses: &BTreeMap<String, Value>,
        faults: &mut Vec<Fault>,
    ) -> Option<BTreeMap<String, f64>> {
        let before = faults.len();
        let measures: Vec<&Measure> = measures(&self.question.goal).into_iter().map(|(_, of)| of).collect();
        let names: BTreeSet<&str> = measures.iter().map(|measure| measure.response()).collect();
        let names = names.into_iter().collect::<Vec<_>>().join(", ");
        if responses.is_empty() {
            let detail = "no response: a run without any has null for each";
            faults.push(fault(&format!("{at}/responses"), json!(responses), detail, &names));
        }
        let mut numbers = BTreeMap::new();
        for (name, value) in responses {
            let at = format!("{at}/responses/{}", escape(name));
            let mut of = measures.iter().filter(|measure| measure.response() == name).peekable();
            if of.peek().is_none() {
                faults.push(fault(&at, value.clone(), "no measure of the goal has this response", &names));
                continue;
            }
            let number = value.as_f64().or(value.as_bool().map(|is_true| f64::from(u8::from(is_true))));
            match number {
                Some(number) if of.any(|measure| measure.accepts(number)) => {
                    numbers.insert(name.clone(), number);
                }
                None if value.is_null() => {}
                _ => {
                    let of_probability = measures
                        .iter()
                        .any(|of| of.response() == name && matches!(of, Measure::Probability(_)));
                    let allowed =
                        if of_probability { "0, 1, true, false or null" } else { "a number or null" };
                    faults.push(fault(
                        &at,
                        value.clone(),
                        "no measure of the goal accepts this value",
                        allowed,
                    ));
                }
            }
        }
        (faults.len() == before).then_some(numbers)
    }
}

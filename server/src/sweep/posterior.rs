//! Parameters that replicates draw from the posterior of a calibration.
//!
//! Replicates in a row share a sample, and their seeds differ: the results tell what comes from the parameters, and what from chance. All
//! design points have the same samples, so that their differences do not contain those of samples.

use roost_api::Fault;
use roost_api::sweep::PosteriorDraws;
use roost_solver::scenario::{self, Scenario, fields};
use serde_json::{Value, json};

use super::pointer;
use crate::document::{fault, prefixed};

/// Replicates in a row with the same sample, unless given.
const RUNS_PER_SAMPLE: u32 = 2;
/// Maximum number of samples.
const MAX_SAMPLES: usize = 2000;
/// Maximum number of parameters.
const MAX_PARAMETERS: usize = 32;
/// Faulty samples that are listed.
const MAX_LISTED: usize = 5;

/// Samples of parameters.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Posterior {
    parameters: Vec<String>,
    samples: Vec<Vec<f64>>,
    runs_per_sample: u32,
}

impl Posterior {
    /// The samples of a document; none while they are not filled in.
    pub(crate) fn of(draws: &PosteriorDraws) -> Option<Self> {
        let (parameters, samples) = (draws.parameters.clone()?, draws.samples.clone()?);
        let runs_per_sample = draws.runs_per_sample.unwrap_or(RUNS_PER_SAMPLE).max(1);
        Some(Self { parameters, samples, runs_per_sample })
    }

    /// Replicates in a row with the same sample.
    pub(crate) fn runs_per_sample(&self) -> u32 {
        self.runs_per_sample
    }

    /// The index of a replicate's sample.
    pub(crate) fn index(&self, replicate: u32) -> usize {
        (replicate / self.runs_per_sample) as usize % self.samples.len()
    }

    /// The index of the sample of a run that has no replicates beside it, by its seed.
    pub(crate) fn index_of_seed(&self, seed: u64) -> usize {
        (seed % self.samples.len() as u64) as usize
    }

    /// Number of different samples among the first replicates.
    pub(super) fn used(&self, replicates: u32) -> usize {
        (replicates.div_ceil(self.runs_per_sample) as usize).min(self.samples.len())
    }

    /// A scenario with the parameters of a sample, or its faults.
    pub(crate) fn applied(&self, scenario: &Scenario, index: usize) -> Result<Scenario, Vec<Fault>> {
        let complete = json!(scenario);
        let mut document = complete.clone();
        for (parameter, value) in self.parameters.iter().zip(&self.samples[index]) {
            pointer::set(&mut document, &complete, parameter, &json!(value));
        }
        scenario::from_value(&document)
    }

    /// Checks the first samples with a scenario.
    pub(super) fn check(&self, scenario: &Scenario, replicates: u32) -> Result<(), Vec<Fault>> {
        for index in 0..self.used(replicates) {
            self.applied(scenario, index)
                .map_err(|faults| prefixed(&format!("/posterior/samples/{index}"), faults))?;
        }
        Ok(())
    }
}

/// Lists the faults of samples. `varied` are the fields of the factors.
pub(super) fn faults(draws: &PosteriorDraws, complete: Option<&Value>, varied: &[&str]) -> Vec<Fault> {
    let mut faults = Vec::new();
    let at = "/posterior";
    if draws.runs_per_sample == Some(0) {
        let at = format!("{at}/runs_per_sample");
        faults.push(fault(&at, json!(0), "a sample has at least one run", "1 or more"));
    }
    let (Some(parameters), Some(samples)) = (&draws.parameters, &draws.samples) else {
        let detail = "the samples are missing";
        let allowed = "`study`, the identifier of a calibration on this server; or `parameters` and `samples`";
        faults.push(fault(at, json!(draws), detail, allowed));
        return faults;
    };
    if !(1..=MAX_PARAMETERS).contains(&parameters.len()) {
        let (at, allowed) = (format!("{at}/parameters"), format!("1 to {MAX_PARAMETERS} pointers"));
        faults.push(fault(&at, json!(parameters.len()), "unsuitable number of parameters", &allowed));
    }
    if !(1..=MAX_SAMPLES).contains(&samples.len()) {
        let (at, allowed) = (format!("{at}/samples"), format!("1 to {MAX_SAMPLES} samples"));
        faults.push(fault(&at, json!(samples.len()), "unsuitable number of samples", &allowed));
    }
    for (index, parameter) in parameters.iter().enumerate() {
        let at = format!("{at}/parameters/{index}");
        let is_number = |complete: &Value| {
            fields::find(parameter).is_some() && complete.pointer(parameter).is_some_and(Value::is_number)
        };
        if complete.is_some_and(|complete| !is_number(complete)) {
            let allowed = "the pointer of a number of the scenario, such as /material/youngs_modulus_pa";
            faults.push(fault(&at, json!(parameter), "no number of the scenario", allowed));
        }
        if varied.iter().any(|field| pointer::overlap(field, parameter)) {
            let allowed = "a parameter that no factor varies";
            faults.push(fault(&at, json!(parameter), "a factor varies this field", allowed));
        }
        if parameters[..index].contains(parameter) {
            faults.push(fault(&at, json!(parameter), "the parameter is listed twice", "each once"));
        }
    }
    let unequal = samples.iter().enumerate().filter(|(_, sample)| sample.len() != parameters.len());
    for (index, sample) in unequal.take(MAX_LISTED) {
        let at = format!("{at}/samples/{index}");
        let allowed = format!("{} numbers, one for each parameter", parameters.len());
        faults.push(fault(&at, json!(sample), "another number of values", &allowed));
    }
    faults
}

//! Parameters that replicates draw from the posterior of a calibration.
//!
//! Replicates in a row share a sample, and their seeds differ: the results tell what comes from the parameters, and what from chance. All
//! design points have the same samples, so that their differences do not contain those of samples.

use roost_api::Fault;
use roost_api::sweep::{PosteriorDraws, SweepSpec};
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario, fields};
use serde_json::{Map, Value, json};

use super::pointer;
use crate::document::fault;
use crate::mesh;

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

    /// The index of a replicate's sample.
    pub(crate) fn index(&self, replicate: u32) -> usize {
        (replicate / self.runs_per_sample) as usize % self.samples.len()
    }

    /// The pointers of the parameters.
    pub(crate) fn parameters(&self) -> &[String] {
        &self.parameters
    }

    /// The parameters of a replicate, by pointer.
    pub(crate) fn drawn(&self, replicate: u32) -> Map<String, Value> {
        let sample = &self.samples[self.index(replicate)];
        self.parameters.iter().cloned().zip(sample.iter().map(|value| json!(value))).collect()
    }

    /// The index of the sample of a run that has no replicates beside it, by its seed.
    pub(crate) fn index_of_seed(&self, seed: u64) -> usize {
        (seed % self.samples.len() as u64) as usize
    }

    /// Number of different samples among the first replicates.
    pub(crate) fn used(&self, replicates: u32) -> usize {
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

    /// Checks some samples with a scenario, as meshes and limits allow it.
    pub(crate) fn check(
        &self,
        scenario: &Scenario,
        samples: std::ops::Range<usize>,
        (meshes, limits): (&Meshes, &Limits),
    ) -> Result<(), Vec<Fault>> {
        for index in samples.start..samples.end.min(self.samples.len()) {
            let drawn = self.applied(scenario, index);
            let checked = drawn.and_then(|drawn| mesh::check(&drawn, meshes, limits).map(drop));
            checked.map_err(|faults| vec![self.fault_of_sample(index, faults)])?;
        }
        Ok(())
    }

    /// The first fault of a scenario as one of the sample that it has.
    fn fault_of_sample(&self, index: usize, faults: Vec<Fault>) -> Fault {
        let found = faults.into_iter().next();
        let (reason, allowed) = found
            .map(|fault| (format!("{}: {}", fault.pointer, fault.detail), fault.allowed.unwrap_or_default()))
            .unwrap_or_default();
        fault(&format!("/posterior/samples/{index}"), json!(self.samples[index]), &reason, &allowed)
    }

    /// Number of samples.
    pub(crate) fn len(&self) -> usize {
        self.samples.len()
    }

    /// Number of replicates that have samples of their own.
    pub(super) fn max_replicates(&self) -> u32 {
        u32::try_from(self.samples.len()).unwrap_or(u32::MAX).saturating_mul(self.runs_per_sample)
    }
}

/// Replicates in a row that have the same parameters, if the sweep draws these from a posterior.
pub(crate) fn runs_per_sample(spec: &SweepSpec) -> Option<u32> {
    Some(Posterior::of(spec.posterior.as_ref()?)?.runs_per_sample)
}

/// The fault of more replicates than there are samples for.
pub(super) fn too_many(at: &str, asked: u32, posterior: &Posterior, replicates: u32) -> Option<Fault> {
    let most = posterior.max_replicates();
    (replicates > most).then(|| {
        let detail = "further replicates would repeat the samples of the posterior";
        fault(at, json!(asked), detail, &format!("at most {most} replicates, or more samples"))
    })
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
        let detail = match draws.study {
            Some(_) => "the samples of a study are at its server: only the server can fill them in",
            None => "the samples are missing",
        };
        let allowed =
            "`study`, the identifier of a calibration on this server; or `parameters` and `samples`";
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
        // A field, or a number of a list that is a field.
        let list = parameter.rsplit_once('/').and_then(|(list, _)| fields::find(list));
        let is_known = fields::find(parameter).or(list).is_some();
        let is_number =
            |complete: &Value| is_known && complete.pointer(parameter).is_some_and(Value::is_number);
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

/// The members `parameters` and `samples` of a document, from the fields of each parameter and the samples of an answer. Linked fields have
/// the same values.
pub fn posterior_columns(factors: &[Vec<&str>], samples: &[Value]) -> Map<String, Value> {
    let fields: Vec<&str> = factors.concat();
    let row = |sample: &Value| -> Vec<Value> {
        let each = factors.iter().enumerate();
        each.flat_map(|(index, fields)| fields.iter().map(move |_| sample[index].clone())).collect()
    };
    let rows: Vec<Vec<Value>> = samples.iter().map(row).collect();
    Map::from_iter([("parameters".to_owned(), json!(fields)), ("samples".to_owned(), json!(rows))])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linked_fields_share_their_column() {
        let filled =
            posterior_columns(&[vec!["/a/x", "/b/x"], vec!["/c"]], &[json!([1.0, 2.0]), json!([3.0, 4.0])]);
        assert_eq!(filled["parameters"], json!(["/a/x", "/b/x", "/c"]));
        assert_eq!(filled["samples"], json!([[1.0, 1.0, 2.0], [3.0, 3.0, 4.0]]));
    }
}

//! Measurements, without IO: from the document of a laboratory to numbers that runs are compared with, or every fault.
//!
//! - `replicates` checks mean, deviation and number of replicates.
//! - `curves` reads points and CSV texts, and finds the line of the experiment that a curve belongs to.
//! - `units` converts to the units of responses and curves.

mod curves;
mod replicates;
#[cfg(test)]
mod tests;
mod units;

use std::collections::{BTreeMap, BTreeSet};

use roost_api::Fault;
use roost_api::measurements::{LabTest, MeasuredResponse, Measurements, SCHEMA};
use roost_solver::Limits;
use roost_solver::experiments::{Outputs, ResponseType, outputs};
use roost_solver::mesh::Meshes;
use roost_solver::observable::Observable;
use roost_solver::scenario::{self, Scenario, most_similar};
use serde_json::{Value, json};

use crate::document::{
    MAX_FAULTS, fault, label_faults_at, name_fault, prefixed, read_leniently, with_content_faults,
};
use crate::mesh;
use replicates::ReplicateStatistics;
use units::Conversion;

/// Maximum number of tests of a document.
const MAX_TESTS: usize = 100;
/// The allowed value for a number that overflows.
const SMALLER: &str = "a smaller number";

/// Measurements that runs can be compared with.
#[derive(Clone, Debug, PartialEq)]
pub struct Lab {
    /// Its name.
    pub name: String,
    /// The person or laboratory that measured, or a citation.
    pub source: Option<String>,
    /// Its tests.
    pub tests: Vec<TestTargets>,
}

/// A test with the scenario that simulates it.
#[derive(Clone, Debug, PartialEq)]
pub struct TestTargets {
    /// Its name.
    pub name: String,
    /// The scenario as written: defaults are not filled in, so that it can be the base of a sweep.
    pub base: Value,
    /// The complete scenario.
    pub scenario: Scenario,
    /// Its conditions.
    pub conditions: BTreeMap<String, String>,
    /// Its measured numbers, each observable once.
    pub targets: Vec<Target>,
}

/// A measured number, in the unit of its observable.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// The number of a run that it is compared with.
    pub observable: Observable,
    /// Mean of the replicates.
    pub mean: f64,
    /// Standard deviation of the replicates; 0 is possible.
    pub deviation: f64,
    /// Number of replicates.
    pub n: u64,
}

/// Reads measurements.
///
/// # Errors
/// Every fault, with pointers into the document.
pub fn read(document: Value, meshes: &Meshes, limits: &Limits) -> Result<Lab, Vec<Fault>> {
    read_with(document, Some((meshes, limits)))
}

/// Reads measurements; their scenarios are checked with meshes and limits, if these are given.
pub(crate) fn read_with(document: Value, check: Option<(&Meshes, &Limits)>) -> Result<Lab, Vec<Fault>> {
    let (measurements, listed) = read_leniently::<Measurements>(document);
    let Some(measurements) = measurements else { return Err(listed) };
    let mut faults = Vec::new();
    if let Some(schema) = measurements.schema.as_deref().filter(|schema| *schema != SCHEMA) {
        faults.push(fault("/schema", json!(schema), "unknown schema", SCHEMA));
    }
    faults.extend(name_fault("/name", &measurements.name));
    let count = measurements.tests.len();
    if count == 0 || count > MAX_TESTS {
        let allowed = format!("1 to {MAX_TESTS}");
        faults.push(fault("/tests", json!(count), "unsuitable number of tests", &allowed));
    }
    let mut tests = Vec::new();
    let mut names = BTreeSet::new();
    for (index, test) in measurements.tests.into_iter().take(MAX_TESTS).enumerate() {
        let at = format!("/tests/{index}");
        if !names.insert(test.name.clone()) {
            let detail = "another test has this name";
            faults.push(fault(
                &format!("{at}/name"),
                json!(test.name),
                detail,
                "a name of its own for each test",
            ));
        }
        tests.extend(read_test(&at, test, check, &mut faults));
    }
    let faults = with_content_faults(listed, faults);
    let Measurements { name, source, .. } = measurements;
    if faults.is_empty() { Ok(Lab { name, source, tests }) } else { Err(faults) }
}

fn read_test(
    at: &str,
    test: LabTest,
    check: Option<(&Meshes, &Limits)>,
    faults: &mut Vec<Fault>,
) -> Option<TestTargets> {
    faults.extend(name_fault(&format!("{at}/name"), &test.name));
    faults.extend(label_faults_at(&format!("{at}/conditions"), "conditions", &test.conditions));
    let read = scenario::from_value(&test.scenario).and_then(|scenario| match check {
        Some((meshes, limits)) => mesh::check(&scenario, meshes, limits).map(|_| scenario),
        None => Ok(scenario),
    });
    let scenario = match read {
        Ok(scenario) => scenario,
        Err(found) => {
            faults.extend(prefixed(&format!("{at}/scenario"), found));
            return None;
        }
    };
    let outputs = outputs(&scenario.experiment);
    let measured = format!("{at}/measured");
    if test.measured.responses.is_empty() && test.measured.curves.is_empty() {
        let allowed = "at least one item of `responses` or `curves`";
        faults.push(fault(&measured, json!({}), "nothing was measured", allowed));
    }
    // Targets with their places in the document.
    let mut targets = Vec::new();
    for (index, response) in test.measured.responses.iter().enumerate() {
        let at = format!("{measured}/responses/{index}");
        let target = read_response(&at, response, outputs, faults);
        targets.extend(target.map(|target| (at, target)));
    }
    for (index, curve) in test.measured.curves.iter().enumerate() {
        let at = format!("{measured}/curves/{index}");
        let points = curves::read(&at, curve, &scenario, outputs, faults);
        targets.extend(points.into_iter().map(|target| (at.clone(), target)));
    }
    let mut known = BTreeSet::new();
    for (at, target) in &targets {
        let name = target.observable.to_string();
        if !known.insert(name.clone()) {
            let detail = format!("`{name}` is measured twice in this test");
            faults.push(fault(at, json!(name), &detail, "each number once: put all replicates together"));
        }
    }
    Some(TestTargets {
        name: test.name,
        base: test.scenario,
        scenario,
        conditions: test.conditions,
        targets: targets.into_iter().map(|(_, target)| target).collect(),
    })
}

fn read_response(
    at: &str,
    measured: &MeasuredResponse,
    outputs: &'static Outputs,
    faults: &mut Vec<Fault>,
) -> Option<Target> {
    let replicates = ReplicateStatistics::of_response(at, measured, faults);
    let Some(observable) = Observable::response(outputs, &measured.response) else {
        let rows = outputs.responses.iter().filter(|row| row.kind != ResponseType::Word);
        let names: Vec<&str> = rows.map(|row| row.name).collect();
        let detail = match most_similar(&measured.response, names.iter().copied()) {
            Some(similar) => format!("the experiment has no such number: did you mean {similar}?"),
            None => "the experiment has no such number".to_owned(),
        };
        let pointer = format!("{at}/response");
        faults.push(fault(&pointer, json!(measured.response), &detail, &names.join(", ")));
        return None;
    };
    let own = observable.unit();
    let conversion = unit_conversion(&format!("{at}/unit"), measured.unit.as_deref(), own, faults)?;
    let replicates = replicates?.converted(conversion);
    let before = faults.len();
    match &observable {
        Observable::Response(response)
            if matches!(response.kind, ResponseType::Indicator | ResponseType::Boolean) =>
        {
            faults.extend(share_faults(at, measured, conversion));
        }
        _ => {}
    }
    if faults.len() == before
        && let Some(name) = replicates.overflow()
    {
        faults.push(overflow_fault(at, measured, name, own));
    }
    let ReplicateStatistics { mean, deviation, n } = replicates;
    (faults.len() == before).then_some(Target { observable, mean, deviation, n })
}

/// The faults of a yes or no: each value is 0 or 1, and a mean is the share of yes.
fn share_faults(at: &str, measured: &MeasuredResponse, conversion: Conversion) -> Vec<Fault> {
    let Some(values) = &measured.values else {
        let odd = measured.mean.filter(|mean| !(0.0..=1.0).contains(&conversion.of(*mean)));
        let detail = "the mean of a yes or no is the share of yes";
        let allowed = "0 to 1, or 0 to 100 %";
        return odd
            .map(|mean| fault(&format!("{at}/mean"), json!(mean), detail, allowed))
            .into_iter()
            .collect();
    };
    let is_odd = |value: f64| ![0.0, 1.0].contains(&conversion.of(value));
    let odd = values.iter().enumerate().filter(|(_, value)| is_odd(**value)).take(MAX_FAULTS);
    let fault = |(index, value): (usize, &f64)| {
        let pointer = format!("{at}/values/{index}");
        fault(&pointer, json!(value), "each value of a yes or no is no or yes", "0 or 1, or 0 or 100 %")
    };
    odd.map(fault).collect()
}

/// The fault of a response whose mean or deviation overflows: of the number as stated, or of the largest value.
fn overflow_fault(at: &str, measured: &MeasuredResponse, name: &str, own: &str) -> Fault {
    let values = measured.values.iter().flatten().enumerate();
    let largest = values.max_by(|(_, one), (_, other)| one.abs().total_cmp(&other.abs()));
    let (place, value) = match largest {
        Some((index, value)) if name == "mean" || measured.deviation.is_none() => {
            (format!("values/{index}"), Some(*value))
        }
        _ if name == "mean" => (name.to_owned(), measured.mean),
        _ => (name.to_owned(), measured.deviation),
    };
    fault(&format!("{at}/{place}"), json!(value), &too_large(own), SMALLER)
}

/// Why a number that overflows is refused.
fn too_large(own: &str) -> String {
    let unit = if own.is_empty() { String::new() } else { format!(" in {own}") };
    format!("is too large to compute with{unit}")
}

/// The conversion from a written unit to that of the table of results.
fn unit_conversion(
    at: &str,
    written: Option<&str>,
    own: &str,
    faults: &mut Vec<Fault>,
) -> Option<Conversion> {
    let conversion = units::conversion(written.unwrap_or(""), own);
    if conversion.is_none() {
        let detail = match written {
            Some(_) => "this quantity is not measured in that unit",
            None => "the unit is missing",
        };
        faults.push(fault(at, json!(written), detail, &units::allowed(own)));
    }
    conversion
}

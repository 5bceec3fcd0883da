//! Reading documents: one walk over a document lists every fault, then serde builds the type. Pure.
//!
//! `shape` holds the walk; scenarios have their own, over the field table of the solver.
//! `serde_fault` translates the errors of serde, and `objects` finds lists in place of objects.

mod limits;
mod objects;
mod place;
mod serde_fault;
mod shape;
#[cfg(test)]
mod tests;

use std::sync::LazyLock;

use roost_api::Fault;
use roost_api::ask::{Ask, Tell};
use roost_api::design::Extension;
use roost_api::job::JobEnvelope;
use roost_api::lease::{ClaimRequest, FailureReport, HeartbeatRequest, ResultDelivery, ResultsDelivery};
use roost_api::measurements::Measurements;
use roost_api::study::{BudgetChange, RangeChange, StudySpec};
use roost_api::sweep::SweepSpec;
use roost_api::worker::WorkerRegistration;
use roost_solver::Limits;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use crate::mesh;
pub(crate) use limits::{label_faults, label_faults_at, name_fault};
use place::Place;
use serde_fault::serde_fault;
pub(crate) use shape::MAX_FAULTS;
use shape::Shape;

/// A type of document that the API reads.
pub(crate) trait DocumentType: DeserializeOwned + Send + 'static {
    /// Its shape, compiled once.
    fn shape() -> &'static Shape;
}

macro_rules! document_types {
    ($($type:ty),* $(,)?) => {$(
        impl DocumentType for $type {
            fn shape() -> &'static Shape {
                static SHAPE: LazyLock<Shape> = LazyLock::new(Shape::of::<$type>);
                &SHAPE
            }
        }
    )*};
}

document_types!(
    Ask,
    BudgetChange,
    ClaimRequest,
    Extension,
    FailureReport,
    HeartbeatRequest,
    JobEnvelope,
    Measurements,
    RangeChange,
    ResultDelivery,
    ResultsDelivery,
    StudySpec,
    SweepSpec,
    Tell,
    WorkerRegistration,
);

/// Reads a document, or lists its faults.
pub(crate) fn read_document<T: DocumentType>(value: Value) -> Result<T, Vec<Fault>> {
    match read_leniently(value) {
        (Some(document), faults) if faults.is_empty() => Ok(document),
        (_, faults) => Err(faults),
    }
}

/// Lists the faults of a document and reads it with placeholders in their places, so that its content can be
/// checked as well.
pub(crate) fn read_leniently<T: DocumentType>(value: Value) -> (Option<T>, Vec<Fault>) {
    let mut faults = Vec::new();
    let settled = T::shape().settle(value, &Place::Root, &mut faults);
    let Some(settled) = settled else { return (None, faults) };
    match serde_path_to_error::deserialize(&settled) {
        Ok(document) => (Some(document), faults),
        // Parts that the schema leaves open, such as the scenario of a result, have one fault at a time.
        Err(error) => {
            let found = serde_fault(&settled, &error);
            if !faults.iter().any(|listed| is_within(&found.pointer, &listed.pointer)) {
                faults.push(found);
            }
            (None, faults)
        }
    }
}

/// Adds the faults of the content of a leniently read document to those of its shape, where the shape has none.
pub(crate) fn with_content_faults(mut listed: Vec<Fault>, found: Vec<Fault>) -> Vec<Fault> {
    let is_listed = |fault: &Fault| {
        let touches = |other: &Fault| {
            is_within(&fault.pointer, &other.pointer) || is_within(&other.pointer, &fault.pointer)
        };
        listed.iter().any(touches)
    };
    let found: Vec<Fault> = found.into_iter().filter(|fault| !is_listed(fault)).collect();
    listed.extend(found);
    listed
}

/// Reads a valid document without building it as JSON first, or nothing: `read_document` lists its faults.
pub(crate) fn read_valid<T: DocumentType>(text: &[u8]) -> Option<T> {
    objects::has_its_objects(T::shape(), text).then(|| serde_json::from_slice(text).ok()).flatten()
}

/// Whether `pointer` names `place` or a part of it.
pub(crate) fn is_within(pointer: &str, place: &str) -> bool {
    pointer.strip_prefix(place).is_some_and(|rest| rest.is_empty() || rest.starts_with('/'))
}

/// Reads an envelope with its scenario, or lists the faults of both.
pub(crate) fn read_envelope(
    meshes: &Meshes,
    limits: &Limits,
    document: Value,
) -> Result<(JobEnvelope, Scenario), Vec<Fault>> {
    let scenario = document.get("scenario").map(|submitted| {
        scenario::from_value(submitted)
            .and_then(|scenario| mesh::check(&scenario, meshes, limits).map(|_| scenario))
            .map_err(|faults| prefixed("/scenario", faults))
    });
    let (envelope, mut faults) = read_leniently::<JobEnvelope>(document);
    if let Some(envelope) = &envelope {
        faults.extend(running_faults(envelope.max_wall_s, envelope.frame_interval_s));
        faults.extend(label_faults(&envelope.labels));
        faults.extend(envelope.needs.backend.iter().filter_map(|name| name_fault("/needs/backend", name)));
    }
    match (envelope, scenario) {
        (Some(envelope), Some(Ok(scenario))) if faults.is_empty() => Ok((envelope, scenario)),
        (_, scenario) => {
            faults.extend(scenario.and_then(Result::err).unwrap_or_default());
            Err(faults)
        }
    }
}

/// Puts a prefix before the pointer of each fault.
pub(crate) fn prefixed(prefix: &str, faults: Vec<Fault>) -> Vec<Fault> {
    let within = |fault: Fault| Fault { pointer: format!("{prefix}{}", fault.pointer), ..fault };
    faults.into_iter().map(within).collect()
}

/// A fault; a long value is cut short.
pub(crate) fn fault(pointer: &str, value: Value, detail: &str, allowed: &str) -> Fault {
    let allowed = Some(allowed.to_owned()).filter(|allowed| !allowed.is_empty());
    Fault::new(pointer, &value, detail.to_owned(), allowed)
}

/// Maximum of a time that a document states, in seconds: 31 years.
const LONGEST_S: f64 = 1e9;

/// Faults of the fields that jobs and sweeps share.
pub(crate) fn running_faults(max_wall_s: Option<f64>, frame_interval_s: Option<f64>) -> Vec<Fault> {
    // Longer times would not fit the column of the deadline, in milliseconds.
    let is_wrong = |seconds: &f64| !(*seconds > 0.0 && *seconds <= LONGEST_S);
    let times = [("/max_wall_s", max_wall_s), ("/frame_interval_s", frame_interval_s)];
    let wrong = |(at, seconds): (&str, Option<f64>)| {
        let seconds = seconds.filter(is_wrong)?;
        let detail = if seconds > LONGEST_S { "must be at most 1e9 s" } else { "must be more than 0 s" };
        Some(fault(at, json!(seconds), detail, "more than 0 s, up to 1e9 s, or null"))
    };
    times.into_iter().filter_map(wrong).collect()
}

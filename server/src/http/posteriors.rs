//! Posteriors of calibrations: a submitted document names a study, and gets the samples of its answer as they are at that moment.

use roost_api::ids::SweepId;
use roost_api::sweep::SweepSpec;
use serde_json::{Value, json};

use super::problem::ApiError;
use crate::document::fault;
use crate::queue::Refusal;
use crate::state::App;
use crate::sweep::{Posterior, posterior_columns};

/// Fills in the samples of the study that `posterior` names. Other documents, and other forms of it, stay as they are.
///
/// # Errors
/// A fault, if there is no such study, or if its answer has no samples.
pub(super) async fn fill_in(app: &App, document: &mut Value) -> Result<(), ApiError> {
    let Some(draws) = document.get_mut("posterior").and_then(Value::as_object_mut) else { return Ok(()) };
    draws.entry("runs_per_sample").or_insert(json!(2));
    if draws.contains_key("samples") {
        return Ok(());
    }
    let named = draws.get("study").and_then(Value::as_str).and_then(|id| id.parse::<SweepId>().ok());
    let Some(id) = named else { return Ok(()) };
    let refuse = |detail: &str| {
        let allowed = "a study with the goal calibrate whose answer has samples";
        Err(ApiError::faults(vec![fault("/posterior/study", json!(id), detail, allowed)]))
    };
    let Some(study) = app.store.study(id).await? else { return refuse("there is no such study") };
    let finding = study.answer.as_ref().and_then(|answer| answer.pointer("/finding/calibrate"));
    let Some(finding) = finding else { return refuse("this study is no calibration") };
    let samples = finding["samples"].as_array().cloned().unwrap_or_default();
    if samples.is_empty() {
        return refuse("the answer of this study has no samples yet");
    }
    let spec = study.present()?.spec();
    let factors: Vec<Vec<&str>> = spec.factors.iter().map(|factor| factor.fields()).collect();
    draws.extend(posterior_columns(&factors, &samples));
    Ok(())
}

/// The samples that the trials of a sweep draw; none if it has no posterior.
pub(super) async fn of_sweep(app: &App, id: SweepId) -> Result<Option<Posterior>, ApiError> {
    let text = app.store.sweep_spec(id).await?.ok_or(Refusal::NoSweep)?;
    // The stored document is read without checks: it was checked when it was submitted.
    let spec: Option<SweepSpec> = serde_json::from_str(&text).ok();
    Ok(spec.and_then(|spec| Posterior::of(&spec.posterior?)))
}

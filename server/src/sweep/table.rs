//! The result table of a sweep as CSV: one row a trial, factors and responses as columns.

use std::collections::BTreeSet;

use roost_api::sweep::SweepResults;
use serde_json::Value;

/// Writes the table. Columns: trial, factors in the order of the sweep, outcome, responses by name.
pub(crate) fn csv(results: &SweepResults) -> Result<String, csv::Error> {
    let names: BTreeSet<&str> =
        results.trials.iter().flat_map(|trial| trial.responses.keys()).map(String::as_str).collect();
    let factors = &results.sweep.factors;
    let mut writer = csv::Writer::from_writer(Vec::new());

    let head = ["job_id", "point", "replicate", "seed"].into_iter();
    let outcome = ["state", "failure_class", "backend", "solver_revision"];
    writer.write_record(
        head.chain(factors.iter().map(String::as_str)).chain(outcome).chain(names.iter().copied()),
    )?;
    for trial in &results.trials {
        let mut row = vec![
            trial.job_id.to_string(),
            trial.point.to_string(),
            trial.replicate.to_string(),
            trial.seed.to_string(),
        ];
        row.extend(factors.iter().map(|factor| cell(trial.factors.get(factor))));
        row.push(trial.state.to_string());
        row.push(trial.failure_class.map(|class| class.to_string()).unwrap_or_default());
        row.push(trial.backend.clone().unwrap_or_default());
        row.push(trial.solver_revision.map(|revision| revision.to_string()).unwrap_or_default());
        row.extend(names.iter().map(|name| cell(trial.responses.get(*name))));
        writer.write_record(row)?;
    }
    let bytes = writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))?;
    Ok(String::from_utf8_lossy(&bytes).into_owned())
}

/// Text as it is, null and absence as nothing, the rest as JSON.
fn cell(value: Option<&Value>) -> String {
    match value {
        None | Some(Value::Null) => String::new(),
        Some(Value::String(text)) => text.clone(),
        Some(value) => value.to_string(),
    }
}

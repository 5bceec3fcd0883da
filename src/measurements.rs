//! Measurements of a laboratory: curves come from CSV files beside the document, and a sound document is summarized.

use std::path::Path;

use anyhow::Result;
use roost_api::Fault;
use roost_api::measurements::SCHEMA;
use roost_server::{Lab, Limits, TestTargets, read_measurements};
use roost_terminal::{format, input, print_json, print_line};
use serde_json::{Value, json};

use crate::meshes;
use crate::named_files::{CurveFile, insert_tables};

/// Maximum number of measured numbers that are listed for each test.
const MAX_LISTED: usize = 6;

/// Reads measurements with the CSV and mesh files that they name.
pub(crate) fn read(path: &Path, mut document: Value) -> Result<Lab, Vec<Fault>> {
    let folder = path.parent().unwrap_or(Path::new(""));
    let files = insert_tables(folder, "", &mut document);
    let resolved = meshes::resolve(path, document).without_server();
    let read = read_measurements(resolved.document.clone(), &resolved.meshes, &Limits::default());
    let found = resolved.with_faults(read.as_ref().err().cloned().unwrap_or_default());
    let mut faults: Vec<Fault> = files.iter().filter_map(|file| file.fault.clone()).collect();
    for mut fault in found {
        let of_fault = |file: &&CurveFile| fault.pointer == format!("{}/table", file.curve);
        match files.iter().find(of_fault) {
            // The table is only a placeholder.
            Some(CurveFile { fault: Some(_), .. }) => {}
            Some(CurveFile { curve, fault: None }) => {
                fault.pointer = format!("{curve}/file");
                faults.push(fault);
            }
            None => faults.push(fault),
        }
    }
    match read {
        Ok(lab) if faults.is_empty() => Ok(lab),
        _ => Err(faults),
    }
}

/// Prints the tests and their numbers, in the units of the results that they are compared with.
pub(crate) fn print(path: &Path, lab: &Lab, as_json: bool) -> Result<()> {
    if as_json {
        let tests: Vec<Value> = lab.tests.iter().map(test_document).collect();
        let (name, source) = (&lab.name, &lab.source);
        let document = json!({"valid": true, "document": "measurements", "schema": SCHEMA, "name": name,
                              "source": source, "tests": tests});
        print_json(&document)?;
        return Ok(());
    }
    let numbers = lab.tests.iter().map(|test| test.targets.len()).sum();
    print_line(format_args!("{}: valid measurements", input::display_name(path)))?;
    let (tests, numbers) = (counted(lab.tests.len(), "test"), counted(numbers, "number"));
    print_line(format_args!("  {tests} with {numbers} in all"))?;
    for test in &lab.tests {
        let numbers = counted(test.targets.len(), "number");
        print_line(format_args!("  {} ({}): {numbers}", test.name, experiment(test)))?;
        for target in test.targets.iter().take(MAX_LISTED) {
            let [mean, deviation] = [target.mean, target.deviation].map(format::significant);
            let spaced = if target.observable.unit().is_empty() { "" } else { " " };
            let unit = target.observable.unit();
            print_line(format_args!(
                "    {}: mean {mean}{spaced}{unit}, standard deviation {deviation}{spaced}{unit}, n = {}",
                target.observable, target.n
            ))?;
        }
        if test.targets.len() > MAX_LISTED {
            print_line(format_args!("    and {} more", test.targets.len() - MAX_LISTED))?;
        }
    }
    Ok(())
}

fn test_document(test: &TestTargets) -> Value {
    let targets: Vec<Value> = test
        .targets
        .iter()
        .map(|target| {
            json!({"observable": target.observable.to_string(), "unit": target.observable.unit(),
                   "mean": target.mean, "deviation": target.deviation, "n": target.n})
        })
        .collect();
    json!({"name": test.name, "experiment": experiment(test), "conditions": test.conditions, "targets": targets})
}

fn experiment(test: &TestTargets) -> &str {
    test.base["experiment"].as_str().unwrap_or_default()
}

fn counted(number: usize, noun: &str) -> String {
    if number == 1 { format!("1 {noun}") } else { format!("{number} {noun}s") }
}

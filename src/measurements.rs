//! Measurements of a laboratory: curves come from CSV files beside the document, and a sound document is summarized.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use anyhow::Result;
use roost_api::Fault;
use roost_api::design::Factor;
use roost_api::measurements::SCHEMA;
use roost_server::{Lab, Limits, TestTargets, read_measurements};
use roost_terminal::{format, input, print_json, print_line};
use serde_json::{Map, Value, json};

use crate::meshes;

/// Maximum size of a CSV file, in bytes.
const MAX_BYTES: usize = 1 << 20;
/// Maximum number of measured numbers that are listed for each test.
const MAX_LISTED: usize = 6;
const ALLOWED: &str = "the path of a CSV file, relative to the folder of this document";

/// A curve that names a file.
struct CurveFile {
    /// JSON pointer of the curve.
    curve: String,
    /// Why the file cannot be used.
    fault: Option<Fault>,
}

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

/// Puts the measurements of a calibration into the document of its study: those of a file, if it names one, and the texts of the CSV
/// files of curves. Returns the faults of these files.
pub(crate) fn insert_into_study(folder: &Path, study: &mut Value) -> Vec<Fault> {
    const PLACE: &str = "/goal/calibrate/measurements";
    let Some(measurements) = study.pointer_mut(PLACE) else { return Vec::new() };
    let mut folder = folder.to_owned();
    if let Value::String(name) = &*measurements {
        let path = folder.join(name);
        match input::read_document(&path) {
            Ok(read) => *measurements = read,
            Err(error) => {
                let allowed = "measurements, or the path of a JSON file with them, relative to the folder of this document";
                return vec![Fault::new(PLACE, &*measurements, error.to_string(), Some(allowed.to_owned()))];
            }
        }
        folder = path.parent().unwrap_or(Path::new("")).to_owned();
    }
    insert_tables(&folder, PLACE, measurements).into_iter().filter_map(|file| file.fault).collect()
}

/// Puts the samples of the answer of a calibration into a document whose `posterior` names its file. Returns the fault of the file.
pub(crate) fn insert_posterior(folder: &Path, document: &mut Value) -> Option<Fault> {
    let draws = document.get_mut("posterior")?.as_object_mut()?;
    let file = draws.remove("file")?;
    let name = file.as_str().unwrap_or_default();
    let read = input::read_document(&folder.join(name)).map_err(|error| error.to_string());
    let found = read.and_then(|answer| {
        let finding = answer.pointer("/answer/finding/calibrate");
        let finding = finding.ok_or_else(|| format!("{name} is no answer of a calibration"))?;
        let factors: Vec<Factor> =
            serde_json::from_value(answer["factors"].clone()).map_err(|error| error.to_string())?;
        let fields: Vec<Vec<&str>> = factors.iter().map(|factor| factor.fields()).collect();
        let samples = finding["samples"].as_array().cloned().unwrap_or_default();
        Ok(roost_server::posterior_columns(&fields, &samples))
    });
    match found {
        Ok(columns) => {
            draws.extend(columns);
            None
        }
        Err(detail) => {
            let allowed =
                "the path of the answer.json of a calibration, relative to the folder of this document";
            Some(Fault::new("/posterior/file", &file, detail, Some(allowed.to_owned())))
        }
    }
}

/// Puts the text of each named file into its curve. An unusable file leaves an empty table. `at` is the place of the document.
fn insert_tables(folder: &Path, at: &str, document: &mut Value) -> Vec<CurveFile> {
    let mut files = Vec::new();
    let tests = document.get_mut("tests").and_then(Value::as_array_mut);
    for (test, value) in tests.into_iter().flatten().enumerate() {
        let curves = value.pointer_mut("/measured/curves").and_then(Value::as_array_mut);
        for (index, curve) in curves.into_iter().flatten().enumerate() {
            let at = format!("{at}/tests/{test}/measured/curves/{index}");
            files.extend(curve.as_object_mut().and_then(|curve| insert_table(folder, at, curve)));
        }
    }
    files
}

fn insert_table(folder: &Path, at: String, curve: &mut Map<String, Value>) -> Option<CurveFile> {
    let file = curve.remove("file")?;
    let other = ["points", "table"].into_iter().find(|name| curve.contains_key(*name));
    let text = match (&file, other) {
        (_, Some(other)) => Err(format!("excludes `{other}`")),
        (Value::String(name), None) => read_text(&folder.join(name)),
        _ => Err("must be a text".to_owned()),
    };
    let fault = text
        .as_ref()
        .err()
        .map(|detail| Fault::new(&format!("{at}/file"), &file, detail.clone(), Some(ALLOWED.to_owned())));
    if other.is_none() {
        curve.insert("table".to_owned(), json!(text.unwrap_or_default()));
    }
    Some(CurveFile { curve: at, fault })
}

/// Reads a text within the maximum size.
fn read_text(path: &Path) -> Result<String, String> {
    let mut text = String::new();
    let read = File::open(path).and_then(|file| file.take(MAX_BYTES as u64 + 1).read_to_string(&mut text));
    read.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    if text.len() > MAX_BYTES {
        let maximum = format::bytes(MAX_BYTES as u64);
        return Err(format!("{} is larger than the maximum of {maximum}", path.display()));
    }
    Ok(text)
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

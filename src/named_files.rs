//! Files that a document names beside its meshes: measurements of a calibration, CSV tables of curves, and samples of a posterior.

use std::fs::File;
use std::io::Read;
use std::path::Path;

use roost_api::Fault;
use roost_api::design::Factor;
use roost_terminal::{format, input};
use serde_json::{Map, Value, json};

/// Maximum size of a CSV file, in bytes.
const MAX_BYTES: usize = 1 << 20;
const ALLOWED: &str = "the path of a CSV file, relative to the folder of this document";

/// A curve that names a file.
pub(crate) struct CurveFile {
    /// JSON pointer of the curve.
    pub(crate) curve: String,
    /// Why the file cannot be used.
    pub(crate) fault: Option<Fault>,
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
pub(crate) fn insert_tables(folder: &Path, at: &str, document: &mut Value) -> Vec<CurveFile> {
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

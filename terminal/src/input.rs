//! Documents and texts from files or stdin.

use std::io::Read;
use std::path::Path;

use anyhow::Result;
use roost_api::Fault;
use roost_api::printable::{fault_line, one_line};
use roost_solver::scenario::{self, ScenarioError};
use serde_json::Value;

use crate::exit::BadInput;

/// Reads a JSON document; `-` is stdin. If the design of a sweep names a CSV file, the document gets its content.
///
/// # Errors
/// If a file cannot be read, or is not JSON.
pub fn read_document(path: &Path) -> Result<Value> {
    let mut document = read_json(path)?;
    let design = document.get_mut("design").and_then(Value::as_object_mut);
    let csv_file = design.and_then(|design| {
        let name = design.get("file")?.as_str()?.to_owned();
        (design.get("kind")? == "csv").then_some((design, name))
    });
    if let Some((design, name)) = csv_file {
        let folder = path.parent().unwrap_or(Path::new(""));
        let table = read_text(&folder.join(name)).map_err(|error| error.context("/design/file"))?;
        design.remove("file");
        design.insert("table".to_owned(), Value::from(table));
    }
    Ok(document)
}

fn read_json(path: &Path) -> Result<Value> {
    let text = read_text(path)?;
    scenario::read_json(&text).map_err(|error| {
        let reason = match &error {
            ScenarioError::Syntax { line, column, message } => {
                format!("not JSON at line {line}, column {column}: {message}")
            }
            ScenarioError::Faults(_) => error.to_string(),
        };
        BadInput(format!("{}: {reason}", display_name(path))).into()
    })
}

/// Reads a text file; `-` is stdin.
///
/// # Errors
/// If it cannot be read, or is not UTF-8.
pub fn read_text(path: &Path) -> Result<String> {
    let text = if path == Path::new("-") {
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text).map(|_| text)
    } else {
        std::fs::read_to_string(path)
    };
    text.map_err(|error| BadInput(format!("cannot read {}: {error}", display_name(path))).into())
}

/// The name of a path in messages, escaped: a document may have given it.
pub fn display_name(path: &Path) -> String {
    if path == Path::new("-") {
        "stdin".to_owned()
    } else {
        one_line(&path.display().to_string()).into_owned()
    }
}

/// An error with the number of faults of a document, and a line for each.
pub fn faults_error(path: &Path, faults: &[Fault]) -> BadInput {
    let noun = if faults.len() == 1 { "fault" } else { "faults" };
    let mut text = format!("{}: {} {noun}", display_name(path), faults.len());
    for fault in faults {
        text.push_str("\n  ");
        text.push_str(&fault_line(fault));
    }
    BadInput(text)
}

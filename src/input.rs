//! Documents from files or stdin: read, parsed, told apart.

use std::io::Read;
use std::path::Path;

use anyhow::Result;
use roost_api::Fault;
use roost_api::printable::one_line;
use roost_solver::scenario::{self, ScenarioError};
use roost_worker::client::fault_line;
use serde_json::Value;

use crate::exit::BadInput;

/// What a JSON document is, by what it holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// One scenario.
    Scenario,
    /// A scenario in an envelope, as `POST /v1/jobs` takes it.
    Job,
    /// Many scenarios.
    Sweep,
}

impl Kind {
    pub(crate) fn of(document: &Value) -> Self {
        if roost_server::is_sweep(document) {
            Self::Sweep
        } else if document.get("scenario").is_some() {
            Self::Job
        } else {
            Self::Scenario
        }
    }
}

/// Reads a JSON document; `-` is stdin. The CSV file that the design of a sweep names is read as well.
pub(crate) fn read(path: &Path) -> Result<Value> {
    let mut document = parsed(path)?;
    let design = document.get_mut("design").and_then(Value::as_object_mut);
    let named = design.and_then(|design| {
        let name = design.get("file")?.as_str()?.to_owned();
        (design.get("kind")? == "csv").then_some((design, name))
    });
    if let Some((design, name)) = named {
        let folder = path.parent().unwrap_or(Path::new(""));
        let table = text(&folder.join(name)).map_err(|error| error.context("/design/file"))?;
        design.remove("file");
        design.insert("table".to_owned(), Value::from(table));
    }
    Ok(document)
}

fn parsed(path: &Path) -> Result<Value> {
    let text = text(path)?;
    scenario::read_json(&text).map_err(|error| {
        let place = match &error {
            ScenarioError::Syntax { line, column, message } => {
                format!("not JSON at line {line}, column {column}: {message}")
            }
            ScenarioError::Faults(_) => error.to_string(),
        };
        BadInput(format!("{}: {place}", name(path))).into()
    })
}

/// A path as messages name it; a document may have named it.
pub(crate) fn name(path: &Path) -> String {
    if path == Path::new("-") {
        "stdin".to_owned()
    } else {
        one_line(&path.display().to_string()).into_owned()
    }
}

/// Every fault, one a line, under a line that counts them.
pub(crate) fn faults(path: &Path, faults: &[Fault]) -> BadInput {
    let plural = if faults.len() == 1 { "fault" } else { "faults" };
    let mut text = format!("{}: {} {plural}", name(path), faults.len());
    for fault in faults {
        text.push_str("\n  ");
        text.push_str(&fault_line(fault));
    }
    BadInput(text)
}

/// The text of a file; `-` is stdin.
pub(crate) fn text(path: &Path) -> Result<String> {
    let read = if path == Path::new("-") {
        let mut text = String::new();
        std::io::stdin().read_to_string(&mut text).map(|_| text)
    } else {
        std::fs::read_to_string(path)
    };
    read.map_err(|error| BadInput(format!("cannot read {}: {error}", name(path))).into())
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn documents_are_told_apart() {
        assert_eq!(Kind::of(&json!({"experiment": "hopper"})), Kind::Scenario);
        assert_eq!(Kind::of(&json!({"scenario": {}})), Kind::Job);
        assert_eq!(Kind::of(&json!({"base": {}, "factors": []})), Kind::Sweep);
        assert_eq!(Kind::of(&json!([])), Kind::Scenario);
    }
}

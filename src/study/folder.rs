//! The folder of `roost study run`: the question that it belongs to, and changes of that question.

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_api::Fault;
use roost_solver::scenario::escape;
use roost_terminal::{BadInput, input};
use serde_json::Value;

use super::answer::write_file;

/// The file with the question, as submitted.
const QUESTION: &str = "question.json";
/// The only field that may change.
const BUDGET: &str = "/budget/max_runs";

/// A folder with a question and the data of its server.
#[derive(Debug)]
pub(super) struct Folder {
    path: PathBuf,
}

impl Folder {
    /// Opens the folder, and creates it if it is missing.
    pub(super) fn open(path: PathBuf) -> Result<Self> {
        std::fs::create_dir_all(&path)
            .map_err(|error| BadInput(format!("cannot create the folder {}: {error}", path.display())))?;
        Ok(Self { path })
    }

    /// Stores the question. It is there before the study is, so that no study has an unknown question.
    pub(super) fn store(&self, question: &Value) -> Result<()> {
        write_file(self.path.join(QUESTION), format!("{question:#}\n").as_bytes()).map(drop)
    }

    /// Refuses the question in a file if it differs from the folder's in more than its budget.
    pub(super) fn check(&self, file: &Path, question: &Value) -> Result<()> {
        let mut changes = changes(&input::read_document(&self.path.join(QUESTION))?, question);
        changes.retain(|change| change.pointer != BUDGET);
        if changes.is_empty() {
            return Ok(());
        }
        let faults = input::faults_error(file, &changes);
        let advice = "only a larger budget goes on in this folder; name another one with -o";
        Err(BadInput(format!("{}\n{advice}", faults.0)).into())
    }

    /// The folder of the server's data.
    pub(super) fn data(&self) -> PathBuf {
        self.path.join("data")
    }

    pub(super) fn path(&self) -> &Path {
        &self.path
    }
}

/// An error for a budget in a file that is below the present one.
pub(super) fn smaller_budget(file: &Path, wanted: u64, present: u64) -> BadInput {
    let fault = Fault {
        pointer: BUDGET.to_owned(),
        value: wanted.into(),
        detail: "the budget of a study can only grow".to_owned(),
        allowed: Some(format!("at least {present}")),
    };
    input::faults_error(file, &[fault])
}

/// An error for a question whose runs are made by clients: there are none without a server.
pub(super) fn client_driver(file: &Path) -> BadInput {
    let fault = Fault {
        pointer: "/driver".to_owned(),
        value: "client".into(),
        detail: "clients ask a server for runs: use `roost study submit`".to_owned(),
        allowed: Some("server".to_owned()),
    };
    input::faults_error(file, &[fault])
}

/// The fields in which a question differs from the folder's.
fn changes(known: &Value, question: &Value) -> Vec<Fault> {
    let mut found = Vec::new();
    compare(String::new(), known, question, &mut found);
    found
}

fn compare(pointer: String, known: &Value, question: &Value, found: &mut Vec<Fault>) {
    match (known, question) {
        (Value::Object(known), Value::Object(question)) => {
            let names = known.keys().chain(question.keys().filter(|name| !known.contains_key(*name)));
            for name in names {
                let value = |of: &serde_json::Map<String, Value>| of.get(name).cloned().unwrap_or_default();
                compare(format!("{pointer}/{}", escape(name)), &value(known), &value(question), found);
            }
        }
        (Value::Array(known), Value::Array(question)) if known.len() == question.len() => {
            for (index, (known, question)) in known.iter().zip(question).enumerate() {
                compare(format!("{pointer}/{index}"), known, question, found);
            }
        }
        _ if is_equal(known, question) => {}
        _ => found.push(Fault {
            pointer,
            value: question.clone(),
            detail: "it differs from the question that the folder belongs to".to_owned(),
            allowed: Some(if known.is_null() { "left out".to_owned() } else { known.to_string() }),
        }),
    }
}

/// Whether two values are equal; 1 and 1.0 are.
fn is_equal(one: &Value, other: &Value) -> bool {
    one == other || one.as_f64().zip(other.as_f64()).is_some_and(|(one, other)| one == other)
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn changes_are_named_by_field() {
        let known = json!({"name": "a", "base": {"seed": 1, "x/y": 2}, "factors": [{"low": 1, "high": 2}]});
        let pointers = |question: Value| -> Vec<String> {
            changes(&known, &question).into_iter().map(|change| change.pointer).collect()
        };
        assert!(
            pointers(
                json!({"name": "a", "base": {"seed": 1.0, "x/y": 2}, "factors": [{"low": 1, "high": 2}]})
            )
            .is_empty()
        );
        let changed =
            json!({"base": {"seed": 1, "x/y": 3}, "factors": [{"low": 1, "high": 3}], "cache": "bypass"});
        assert_eq!(pointers(changed), ["/base/x~1y", "/factors/0/high", "/name", "/cache"]);
        assert_eq!(
            pointers(json!({"name": "a", "base": {"seed": 1, "x/y": 2}, "factors": []})),
            ["/factors"]
        );
    }

    #[test]
    fn folder_belongs_to_one_question() {
        let place = tempfile::tempdir().unwrap();
        let file = Path::new("gate.json");
        let folder = Folder::open(place.path().join("out")).unwrap();
        let mut question = json!({"base": {"seed": 1}, "budget": {"max_runs": 10}});
        assert!(folder.check(file, &question).is_err(), "its question is unknown");
        folder.store(&question).unwrap();
        question["budget"]["max_runs"] = json!(20);
        folder.check(file, &question).unwrap();
        question["base"]["seed"] = json!(2);
        let error = folder.check(file, &question).unwrap_err().to_string();
        assert!(error.contains("/base/seed: it differs") && !error.contains(BUDGET), "{error}");
        assert!(smaller_budget(file, 5, 20).0.contains("/budget/max_runs: the budget"));
    }
}

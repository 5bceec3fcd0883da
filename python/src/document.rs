//! Documents as JSON text, and the exceptions of refused ones.

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use roost_solver::scenario::Fault;

create_exception!(_native, Faults, PyException, "Faults of a document: its argument is a JSON list of them.");
create_exception!(_native, Refused, PyException, "A run cannot start: its argument is the reason.");

/// The error with all faults of a document.
pub(crate) fn faults_error(faults: &[Fault]) -> PyErr {
    Faults::new_err(json(&faults))
}

/// JSON text of a document.
pub(crate) fn json(document: &impl serde::Serialize) -> String {
    serde_json::to_string(document).expect("the document is text, numbers and lists of them")
}

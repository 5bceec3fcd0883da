//! `roost._native`: the solver in the interpreter's process. The Python code around it is in `python/roost/`.
//!
//! Documents cross the border as JSON text, the form that files and the HTTP API have as well. Numbers then have the digits
//! of `roost run`, and no type is declared twice.

mod checkpoint_file;
mod device;
mod frames;
mod observer;
mod scenario;

use pyo3::create_exception;
use pyo3::exceptions::PyException;
use pyo3::prelude::*;
use roost_solver::scenario::Fault;
use roost_solver::{SOLVER_REVISION, VERSION};

create_exception!(_native, Faults, PyException, "Faults of a document: its argument is a JSON list of them.");
create_exception!(_native, Refused, PyException, "A run cannot start: its argument is the reason.");

/// The error with all faults of a document.
fn faults_error(faults: &[Fault]) -> PyErr {
    Faults::new_err(json(&faults))
}

/// JSON text of a document.
fn json(document: &impl serde::Serialize) -> String {
    serde_json::to_string(document).expect("the document is text, numbers and lists of them")
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", VERSION)?;
    module.add("SOLVER_REVISION", SOLVER_REVISION)?;
    module.add("Faults", module.py().get_type::<Faults>())?;
    module.add("Refused", module.py().get_type::<Refused>())?;
    module.add_class::<scenario::Scenario>()
}

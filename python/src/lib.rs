//! `roost._native`: the solver in the interpreter's process. The Python code around it is in `python/roost/`.
//!
//! Documents cross the border as JSON text, the form that files and the HTTP API have as well. Numbers then have the digits
//! of `roost run`, and no type is declared twice.

mod checkpoint_file;
mod device;
mod document;
mod frames;
mod observer;
mod scenario;

use pyo3::prelude::*;
use roost_solver::{SOLVER_REVISION, VERSION};

use document::{Faults, Refused};

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("VERSION", VERSION)?;
    module.add("SOLVER_REVISION", SOLVER_REVISION)?;
    module.add("Faults", module.py().get_type::<Faults>())?;
    module.add("Refused", module.py().get_type::<Refused>())?;
    module.add_class::<scenario::Scenario>()
}

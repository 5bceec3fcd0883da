//! The class `Scenario` of the native module: a scenario whose fields are sound, with its mesh files. It is checked and run here.

use std::path::{Path, PathBuf};
use std::time::Duration;

use pyo3::exceptions::PyBaseException;
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use roost_solver::result::EndReason;
use roost_solver::scenario::{self, Fault, MeshFiles, read_json, read_mesh_files};
use roost_solver::{Checked, Limits};

use crate::checkpoint_file::CheckpointFile;
use crate::device;
use crate::document::{Refused, faults_error, json};
use crate::frames::FrameOptions;
use crate::observer::PythonObserver;

/// A scenario with all defaults, and its mesh files.
#[pyclass(frozen, module = "roost._native")]
pub(crate) struct Scenario {
    scenario: scenario::Scenario,
    files: MeshFiles,
}

/// Result as JSON, the exception that stopped the run, and warnings: why its checkpoint is missing, or its frames end early.
type Ended = (String, Option<Py<PyBaseException>>, Vec<String>);

#[pymethods]
impl Scenario {
    /// Reads JSON text. Mesh files are relative to `folder`. All faults are raised at once.
    #[new]
    fn new(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        py.detach(|| read(text, &folder)).map_err(|faults| faults_error(&faults))
    }

    /// The scenario as JSON, with every default, and with digests in place of mesh files.
    #[getter]
    fn document(&self) -> String {
        json(&self.scenario)
    }

    /// Digest of the document.
    #[getter]
    fn digest(&self) -> String {
        self.scenario.digest()
    }

    /// Content of the mesh files by digest.
    #[getter]
    fn meshes<'py>(&self, py: Python<'py>) -> Vec<(&str, Bound<'py, PyBytes>)> {
        self.files.files.iter().map(|file| (&*file.digest, PyBytes::new(py, &file.bytes))).collect()
    }

    /// Checks fit, stability and cost. Returns the estimate as JSON.
    fn check(&self, py: Python<'_>) -> PyResult<String> {
        Ok(json(self.checked(py)?.estimate()))
    }

    /// Runs the scenario without the interpreter's lock. `report` gets the progress as JSON about ten times a second.
    ///
    /// An exception of `report` or of a signal handler stops the run, and is returned beside the result so far.
    #[pyo3(signature = (*, threads, device, report, checkpoint, checkpoint_every_s, from_start, frames))]
    #[allow(clippy::too_many_arguments, reason = "named in every call")]
    fn run(
        &self,
        py: Python<'_>,
        threads: usize,
        device: &str,
        report: Option<Py<PyAny>>,
        checkpoint: Option<PathBuf>,
        checkpoint_every_s: f64,
        from_start: bool,
        frames: Option<FrameOptions>,
    ) -> PyResult<Ended> {
        let checked = self.checked(py)?;
        let computer = py.detach(|| device::open(device, threads)).map_err(Refused::new_err)?;
        let interval = Duration::try_from_secs_f64(checkpoint_every_s)
            .map_err(|error| Refused::new_err(format!("checkpoint_every: {error}")))?;
        let file = checkpoint.map(|path| CheckpointFile::new(path, interval));
        let saved = match &file {
            Some(file) if !from_start => {
                py.detach(|| file.read(&computer.stamp(&checked))).map_err(Refused::new_err)?
            }
            _ => None,
        };
        let recorder = frames.map(|frames| py.detach(|| frames.recorder(&checked)));
        let recorder = recorder.transpose().map_err(Refused::new_err)?;
        let mut observer = PythonObserver::new(report, file, recorder);
        let (result, (raised, warnings)) = py.detach(|| {
            let result = computer.simulate_from(&checked, saved.as_ref(), &mut observer);
            let is_at_its_end = result.as_ref().is_ok_and(|result| result.end_reason != EndReason::Cancelled);
            (result, observer.finish(is_at_its_end))
        });
        let result = result.map_err(|error| Refused::new_err(error.to_string()))?;
        Ok((json(&result), raised.map(|error| error.into_value(py)), warnings))
    }
}

impl Scenario {
    fn checked(&self, py: Python<'_>) -> PyResult<Checked> {
        let checked =
            py.detach(|| roost_solver::check(&self.scenario, &self.files.meshes, &Limits::default()));
        checked.map_err(|faults| faults_error(&faults))
    }
}

fn read(text: &str, folder: &Path) -> Result<Scenario, Vec<Fault>> {
    let mut document = read_json(text)
        .map_err(|error| vec![Fault::new("", &().into(), format!("not JSON at {error}"), None)])?;
    let files = read_mesh_files(folder, &mut document);
    match scenario::from_value(&document) {
        Ok(scenario) if files.faults.is_empty() => Ok(Scenario { scenario, files }),
        outcome => Err(files.with_faults(outcome.err().unwrap_or_default())),
    }
}

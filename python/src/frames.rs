//! The frames of a run. `roost run --frames` writes the same files.

use std::path::PathBuf;

use pyo3::prelude::*;
use roost_frames::{FrameRecorder, Options, forecast};
use roost_solver::Checked;

/// Bytes of a megabyte.
const MB: u64 = 1_000_000;

/// Folder and settings, the attributes of a Python object. The Python code has checked their ranges.
#[derive(FromPyObject)]
pub(crate) struct FrameOptions {
    folder: PathBuf,
    interval_s: f64,
    vtk: bool,
    web: bool,
    limit_mb: u64,
}

impl FrameOptions {
    /// A recorder for a run. It makes the folder, and removes the frames of an earlier run from it.
    ///
    /// # Errors
    /// In words, when the frames would be larger than the limit, or the folder cannot be written.
    pub(crate) fn recorder(&self, checked: &Checked) -> Result<FrameRecorder, String> {
        let (scenario, estimate) = (checked.scenario(), checked.estimate());
        let options = Options {
            interval_s: self.interval_s,
            vtk: self.vtk,
            web: self.web,
            limit_bytes: self.limit_mb * MB,
        };
        let forecast = forecast(scenario, estimate, &options);
        if forecast.bytes() > options.limit_bytes {
            let least_s = self.interval_s * forecast.bytes() as f64 / options.limit_bytes as f64;
            let other_format = if self.vtk && self.web { ", frame_format=\"web\"" } else { "" };
            return Err(format!(
                "frame_interval is {} s: about {} frames make {} MB, more than the {} MB of frame_limit_mb; allowed: {} s or \
                 more{other_format}, or a higher frame_limit_mb",
                self.interval_s,
                forecast.frames,
                forecast.bytes().div_ceil(MB),
                self.limit_mb,
                rounded_up(least_s),
            ));
        }
        let folder = &self.folder;
        FrameRecorder::create(folder, scenario, estimate.timestep_s, options).map_err(|error| {
            format!("frames is {folder:?}: {error}; allowed: a folder that exists or can be made, and can be written")
        })
    }
}

/// A positive number with three digits, and not less than it was.
fn rounded_up(value: f64) -> f64 {
    let unit = 10f64.powi(value.log10().floor() as i32 - 2);
    let text = format!("{:.2e}", (value / unit).ceil() * unit);
    text.parse().unwrap_or(value)
}

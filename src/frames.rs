//! Frames of `roost run`: options, forecast of their size, and report.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use clap::ValueEnum;
use roost_api::Estimate;
use roost_frames::{FrameRecorder, Options, Report, forecast};
use roost_solver::scenario::Scenario;
use roost_terminal::{BadInput, format, message};
use roost_worker::runner::FrameObserver;
use serde_json::{Value, json};

/// Bytes of a megabyte.
const MB: f64 = 1e6;

/// Options for frames.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Frames")]
pub(crate) struct FrameArgs {
    /// Write frames into this folder. A frame has the positions of all sub-particles at one moment. The file frames.pvd is for the
    /// program ParaView, and the file run.roostframes is for the player of the dashboard. The command replaces the frames of an
    /// earlier run
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Simulated time between two frames. Roost rounds this time to a multiple of the field /numerics/output_interval_s of the
    /// scenario
    #[arg(long, requires = "frames", default_value_t = 0.05, value_name = "SECONDS", allow_negative_numbers = true, value_parser = interval)]
    frame_interval: f64,
    /// Files of frames that the command writes
    #[arg(long, requires = "frames", value_enum, default_value_t = Format::Both)]
    frame_format: Format,
    /// Maximum size of all frames together. Before the run, Roost forecasts the size, and refuses the run if the forecast is larger. If
    /// the frames reach the maximum during the run, the run continues, but records no more frames
    #[arg(long, requires = "frames", default_value_t = 2000, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    frame_limit_mb: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// frames.pvd and its data files
    Vtk,
    /// run.roostframes
    Web,
    /// Both kinds of files
    Both,
}

fn interval(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if 0.0 < seconds && seconds < f64::INFINITY => Ok(seconds),
        _ => Err("write a number of seconds above 0".to_owned()),
    }
}

/// The frames of a run.
#[derive(Debug)]
pub(crate) struct Frames {
    recorder: Arc<Mutex<FrameRecorder>>,
    folder: PathBuf,
    /// Whether the user knows that recording has stopped.
    is_warned: bool,
}

impl FrameArgs {
    /// Prepares the recording, if the options ask for it, and prints its forecast.
    pub(crate) fn prepare(
        self,
        scenario: &Scenario,
        estimate: &Estimate,
    ) -> Result<Option<Frames>, BadInput> {
        let Some(folder) = self.frames else { return Ok(None) };
        let options = Options {
            interval_s: self.frame_interval,
            vtk: self.frame_format != Format::Web,
            web: self.frame_format != Format::Vtk,
            limit_bytes: self.frame_limit_mb * MB as u64,
        };
        let forecast = forecast(scenario, estimate, &options);
        if forecast.bytes() > options.limit_bytes {
            let minimum_s = self.frame_interval * forecast.bytes() as f64 / options.limit_bytes as f64;
            let other_format = if self.frame_format == Format::Both { ", --frame-format web" } else { "" };
            return Err(BadInput(format!(
                "about {} frames of {} (ParaView {}, web {}) make {}, more than --frame-limit-mb {}; allowed: a \
                 --frame-interval of {} or more{other_format}, or a higher limit",
                forecast.frames,
                megabytes(forecast.vtk_bytes + forecast.web_bytes),
                megabytes(forecast.vtk_bytes),
                megabytes(forecast.web_bytes),
                megabytes(forecast.bytes()),
                self.frame_limit_mb,
                format::significant(minimum_s),
            )));
        }
        let recorder = FrameRecorder::create(&folder, scenario, estimate.timestep_s, options)
            .map_err(|error| BadInput(format!("cannot write frames into {}: {error}", folder.display())))?;
        let schedule = recorder.schedule();
        message!(
            "frames: one every {} s ({} of {} s), about {} of at most {}, {} in all",
            format::significant(schedule.interval_s()),
            if schedule.every() == 1 {
                "each sample".to_owned()
            } else {
                format!("{} samples", schedule.every())
            },
            format::significant(schedule.sample_s()),
            forecast.frames,
            megabytes(forecast.vtk_bytes + forecast.web_bytes),
            megabytes(forecast.bytes()),
        );
        Ok(Some(Frames { recorder: Arc::new(Mutex::new(recorder)), folder, is_warned: false }))
    }
}

impl Frames {
    /// The recorder, for the run.
    pub(crate) fn pictures(&self) -> FrameObserver {
        self.recorder.clone()
    }

    /// A warning that recording has stopped, once.
    pub(crate) fn warning(&mut self) -> Option<String> {
        if self.is_warned {
            return None;
        }
        // The recorder is locked while it writes a frame.
        let stopped = self.recorder.try_lock().ok()?.stopped()?.to_owned();
        self.is_warned = true;
        Some(format!("warning: {stopped}; the run continues without frames"))
    }

    /// Completes the files and prints a summary.
    pub(crate) fn finish(&mut self) -> Report {
        let report = self.recorder.lock().unwrap_or_else(PoisonError::into_inner).finish();
        if let Some(reason) = report.stopped.as_ref().filter(|_| !self.is_warned) {
            message!("warning: {reason}");
        }
        let (frames, size) = (report.frames, megabytes(report.bytes));
        message!("frames: {frames} in {}, {size}", self.folder.display());
        report
    }
}

/// The report as JSON.
pub(crate) fn summary(report: &Report) -> Value {
    json!({ "frames": report.frames, "bytes": report.bytes, "stopped": report.stopped, "files": report.files })
}

/// A number of bytes in MB, or in kB below 1 MB.
fn megabytes(bytes: u64) -> String {
    match bytes as f64 {
        bytes if bytes < MB => format!("{} kB", format::significant(bytes / 1e3)),
        bytes => format!("{} MB", format::significant(bytes / MB)),
    }
}

//! Frames of a run: the options of `roost run` for them, what they will weigh, what became of them.

use std::path::PathBuf;
use std::sync::{Arc, Mutex, PoisonError};

use clap::ValueEnum;
use roost_api::Estimate;
use roost_frames::{Options, Recorder, Report, forecast};
use roost_solver::scenario::Scenario;
use roost_worker::runner::FrameObserver;
use serde_json::{Value, json};

use crate::exit::BadInput;
use crate::ui;
use crate::ui::format;

/// A megabyte, as disks are sold.
const MB: f64 = 1e6;

/// What `roost run` can be told of frames.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Frames")]
pub(crate) struct FrameArgs {
    /// Write frames into this folder, in place of those of an earlier run: frames.pvd for ParaView, run.roostframes for
    /// the web
    #[arg(long, value_name = "DIR")]
    frames: Option<PathBuf>,
    /// Simulated time between frames; rounded to whole samples (numerics.output_interval_s)
    #[arg(long, requires = "frames", default_value_t = 0.05, value_name = "SECONDS", allow_negative_numbers = true, value_parser = interval)]
    frame_interval: f64,
    /// Which files to write
    #[arg(long, requires = "frames", value_enum, default_value_t = Format::Both)]
    frame_format: Format,
    /// What all frames together may weigh; a run that would pass it is refused, or goes on without frames
    #[arg(long, requires = "frames", default_value_t = 2000, value_name = "MB", value_parser = clap::value_parser!(u64).range(1..=1_000_000_000))]
    frame_limit_mb: u64,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Format {
    /// frames.pvd and the files it names
    Vtk,
    /// run.roostframes
    Web,
    /// All of them
    Both,
}

fn interval(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if 0.0 < seconds && seconds < f64::INFINITY => Ok(seconds),
        _ => Err("allowed: a number of seconds above 0".to_owned()),
    }
}

/// The frames of a run.
#[derive(Debug)]
pub(crate) struct Frames {
    recorder: Arc<Mutex<Recorder>>,
    folder: PathBuf,
    is_warned: bool,
}

impl FrameArgs {
    /// Makes ready to record a scenario, if that is asked for; says what it will weigh.
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
            let least_s = self.frame_interval * forecast.bytes() as f64 / options.limit_bytes as f64;
            let others = if self.frame_format == Format::Both { ", --frame-format web" } else { "" };
            return Err(BadInput(format!(
                "about {} frames of {} (ParaView {}, web {}) make {}, more than --frame-limit-mb {}; allowed: a \
                 --frame-interval of {} or more{others}, or a higher limit",
                forecast.frames,
                megabytes(forecast.vtk_bytes + forecast.web_bytes),
                megabytes(forecast.vtk_bytes),
                megabytes(forecast.web_bytes),
                megabytes(forecast.bytes()),
                self.frame_limit_mb,
                format::significant(least_s),
            )));
        }
        let recorder = Recorder::create(&folder, scenario, estimate.timestep_s, options)
            .map_err(|error| BadInput(format!("cannot write frames into {}: {error}", folder.display())))?;
        let schedule = recorder.schedule();
        ui::say!(
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
    /// For the run.
    pub(crate) fn pictures(&self) -> FrameObserver {
        self.recorder.clone()
    }

    /// Why recording has stopped while the run goes on: once, when it is news.
    pub(crate) fn warning(&mut self) -> Option<String> {
        if self.is_warned {
            return None;
        }
        // Never wait for a frame that is being written.
        let stopped = self.recorder.try_lock().ok()?.stopped()?.to_owned();
        self.is_warned = true;
        Some(format!("warning: {stopped}; the run goes on without frames"))
    }

    /// Brings the files to their end, and says what there is.
    pub(crate) fn finish(&mut self) -> Report {
        let report = self.recorder.lock().unwrap_or_else(PoisonError::into_inner).finish();
        if let Some(why) = report.stopped.as_ref().filter(|_| !self.is_warned) {
            ui::say!("warning: {why}");
        }
        let (frames, size) = (report.frames, megabytes(report.bytes));
        ui::say!("frames: {frames} in {}, {size}", self.folder.display());
        report
    }
}

/// A report for programs.
pub(crate) fn summary(report: &Report) -> Value {
    json!({ "frames": report.frames, "bytes": report.bytes, "stopped": report.stopped, "files": report.files })
}

/// Bytes in the unit of the limit; small ones in thousandths of it.
fn megabytes(bytes: u64) -> String {
    match bytes as f64 {
        bytes if bytes < MB => format!("{} kB", format::significant(bytes / 1e3)),
        bytes => format!("{} MB", format::significant(bytes / MB)),
    }
}

//! Frames of a run, recorded while it runs: files for ParaView and a compact stream for the web.
//!
//! [`FrameRecorder`] is the solver's observer. [`schedule`] selects the samples that become frames, [`vtk`] and [`web`] encode them, and
//! [`forecast()`] predicts their size. Only the recorder opens files. `docs/frames.md` describes both formats.

mod forecast;
mod recorder;
pub mod schedule;
#[cfg(test)]
mod testing;
pub mod vtk;
pub mod web;

pub use forecast::{Forecast, forecast};
pub use recorder::{FrameRecorder, Options, Report, STREAM};

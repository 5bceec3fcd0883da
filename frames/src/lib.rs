//! Pictures of a run, taken while it runs: files for ParaView and a compact stream for the web.
//!
//! [`Recorder`] is the observer that `roost run --frames` hands to the solver: [`schedule`] says which samples become
//! frames, [`vtk`] and [`web`] what a frame looks like on disk, [`forecast()`] what all of it will weigh. The formats
//! know nothing of folders; the recorder alone opens files. `docs/frames.md` is for whoever reads the files.

mod forecast;
mod recorder;
pub mod schedule;
#[cfg(test)]
mod testing;
pub mod vtk;
pub mod web;

pub use forecast::{Forecast, forecast};
pub use recorder::{Options, Recorder, Report, STREAM};

//! From samples to responses: rates, regime, settling, bend angle, modulus.
//!
//! All functions are pure functions of samples without access to the engine. They are tested on hand-made
//! curves.

mod bend;
mod compression;
mod curve;
mod discharge;
mod jam;
mod recorder;
mod regime;
mod residence;
mod rest;
mod settle;
mod sliding;
#[cfg(test)]
mod tests;

pub use bend::BendGauge;
pub use compression::{Compression, CompressionSample, StressStrain, modulus_pa};
pub use curve::{RATE_WINDOW_S, known_mass_rates, mass_rate};
pub use discharge::{Discharge, DischargeResponses};
pub use jam::{Jam, Passages, has_stopped};
pub use recorder::{Clock, RecordedSeries, Recorder, SavedSamples, SeriesId};
pub use regime::Regime;
pub use residence::{Residence, ResidenceTimes};
pub use rest::{REST_DURATION_S, RestDetector};
pub use settle::{SETTLED_SHARE, SettlingTimer};
pub use sliding::{FAST_M_S, SLOW_M_S, SlidingDetector};

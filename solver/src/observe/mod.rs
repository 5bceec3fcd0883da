//! From samples to what a run is asked for: rates, responses, regime.
//!
//! Everything here is a pure function of samples, knows no engine, and so is tested on curves drawn by hand.

mod bend;
mod compression;
mod curve;
mod discharge;
mod regime;
mod rest;
mod settle;
mod sliding;
#[cfg(test)]
mod tests;

pub use bend::BendGauge;
pub use compression::{Compression, CompressionSample, StressStrain, modulus_pa};
pub use curve::{RATE_WINDOW_S, mass_rate};
pub use discharge::{Discharge, DischargeResponses};
pub use regime::Regime;
pub use rest::{REST_DURATION_S, RestDetector};
pub use settle::{SETTLED_SHARE, SettlingTimer};
pub use sliding::{FAST_M_S, SLOW_M_S, SlidingDetector};

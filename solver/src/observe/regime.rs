//! The regime of a discharge: constant, inconsistent or no flow (section 3.4, Table 3), from the curve.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | Q_b | what the belt carries away when the opening is full: bulk density · belt speed · width · opening | kg/s |
//! | q | lowest running 1 s mean of the rate over Q_b, until 80 % is out | – |
//!
//! The reference is Q_b and never the opening spill (5–9 kg/s for 0.3 s), which no belt could carry on with.

use serde::{Deserialize, Serialize};

use super::curve::{Curve, RATE_WINDOW_S};

/// The opening spill is over by now, in seconds.
pub(super) const SPILL_S: f64 = 0.5;

/// The window of the running mean that regime, variation and peak are read from, in seconds.
pub(super) const WINDOW_S: f64 = 1.0;

/// A share of Q_b under which nothing worth the name flows.
const NO_FLOW: f64 = 0.15;

/// A share of Q_b under which flow is not constant.
const CONSTANT: f64 = 0.55;

/// A discharge in one word.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// q ≥ 0.55.
    Constant,
    /// 0.15 ≤ q < 0.55: bridges form and break.
    Inconsistent,
    /// q < 0.15: for a second at least, (almost) nothing came.
    NoFlow,
    /// The run ended before anything could be said.
    TooShort,
}

impl Regime {
    /// The regime that q says.
    pub(super) fn of(lowest_rate_ratio: f64) -> Self {
        match lowest_rate_ratio {
            q if q < NO_FLOW => Self::NoFlow,
            q if q < CONSTANT => Self::Inconsistent,
            _ => Self::Constant,
        }
    }
}

/// The lowest running 1 s mean of the rate from the end of the spill until `until`, in kg/s. A hopper that
/// is out before a window fits there is judged by the last second, or by all there is.
pub(super) fn lowest_rate(curve: &Curve<'_>, until: f64) -> f64 {
    let from = SPILL_S.min(until - WINDOW_S).max(0.0);
    let window = WINDOW_S.min(until - from);
    let rates = curve.running_mean(from, until, window);
    rates.iter().map(|rate| rate.1).reduce(f64::min).unwrap_or(0.0)
}

/// The coefficient of variation (standard deviation over mean) of the running 1 s mean of the rate from the
/// end of the spill until `until`; none when that is under 1.5 s, or nothing flowed.
pub(super) fn variation(curve: &Curve<'_>, until: f64) -> Option<f64> {
    if until - SPILL_S < 1.5 * WINDOW_S {
        return None;
    }
    let rates = curve.running_mean(SPILL_S, until, WINDOW_S);
    let mean = rates.iter().map(|rate| rate.1).sum::<f64>() / rates.len() as f64;
    let square = rates.iter().map(|rate| (rate.1 - mean).powi(2)).sum::<f64>() / rates.len() as f64;
    (mean > 0.0).then(|| square.sqrt() / mean)
}

/// The longest stretch until `until`, in seconds, that is covered by windows of [`RATE_WINDOW_S`] without
/// interruption whose mean rate is under 0.15 Q_b; 0 when there is none, none when no window fits.
pub(super) fn longest_stoppage(curve: &Curve<'_>, until: f64, capacity: f64) -> Option<f64> {
    let rates = curve.running_mean(0.0, until, RATE_WINDOW_S);
    if rates.is_empty() {
        return None;
    }
    let stopped = |pair: &(f64, f64)| pair.1 < NO_FLOW * capacity;
    let stretches = rates.split(|pair| !stopped(pair)).filter_map(|stretch| {
        let (first, last) = (stretch.first()?, stretch.last()?);
        Some(last.0 - first.0 + RATE_WINDOW_S)
    });
    Some(stretches.fold(0.0, f64::max))
}

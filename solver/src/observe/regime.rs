//! The regime of a discharge: constant, inconsistent or no flow (section 3.4, Table 3), from the curve; or a belt that outruns the bed.
//!
//! | symbol | meaning | unit |
//! |---|---|---|
//! | Q_b | belt capacity with a full opening: bulk density · belt speed · width · opening | kg/s |
//! | q | lowest running 1 s mean of the rate over Q_b, until 80 % is out | – |
//!
//! The reference is Q_b and not the opening spill (5–9 kg/s for 0.3 s), which no belt sustains. A belt that could carry the
//! whole bed away within the spill, Q_b · 0.5 s ≥ the filled mass, is no reference either: what falls onto it limits the flow.

use serde::{Deserialize, Serialize};

use super::curve::{Curve, RATE_WINDOW_S};

/// End of the opening spill, in seconds.
pub(super) const SPILL_S: f64 = 0.5;

/// Window of the running mean for regime, variation and peak, in seconds.
pub(super) const WINDOW_S: f64 = 1.0;

/// Share of Q_b below which a discharge counts as no flow.
const NO_FLOW: f64 = 0.15;

/// Share of the filled mass, in one window, below which a bed stands still that the belt outruns.
const STANDSTILL_SHARE: f64 = 0.01;

/// Share of Q_b from which flow counts as constant.
const CONSTANT: f64 = 0.55;

/// Regime of a discharge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Regime {
    /// q ≥ 0.55.
    Constant,
    /// 0.15 ≤ q < 0.55: bridges form and break.
    Inconsistent,
    /// q < 0.15: (almost) no flow for at least a second, in a hopper that did not empty.
    NoFlow,
    /// The belt outruns the bed: at Q_b it would be empty within 0.5 s.
    Outrun,
    /// The run ended before a regime could be determined.
    TooShort,
}

/// The limits by which a regime is judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Flow {
    /// Lowest running mean of the rate, in kg/s.
    pub lowest_rate_kg_s: f64,
    /// Q_b, in kg/s.
    pub capacity_kg_s: f64,
    /// Filled mass, in kg.
    pub filled_kg: f64,
    /// Whether the hopper emptied.
    pub emptied: bool,
}

impl Regime {
    /// The regime of a flow.
    pub(super) fn of(flow: Flow) -> Self {
        if flow.capacity_kg_s * SPILL_S >= flow.filled_kg {
            let stands = flow.lowest_rate_kg_s * WINDOW_S < STANDSTILL_SHARE * flow.filled_kg;
            return if stands && !flow.emptied { Self::NoFlow } else { Self::Outrun };
        }
        match flow.lowest_rate_kg_s / flow.capacity_kg_s {
            q if q < NO_FLOW && !flow.emptied => Self::NoFlow,
            q if q < CONSTANT => Self::Inconsistent,
            _ => Self::Constant,
        }
    }
}

/// Lowest running 1 s mean of the rate from the end of the spill until `until`, in kg/s. A hopper that is out
/// before a window fits is judged by its last second, or by its whole curve.
pub(super) fn lowest_rate(curve: &Curve<'_>, until: f64) -> f64 {
    let from = SPILL_S.min(until - WINDOW_S).max(0.0);
    let window = WINDOW_S.min(until - from);
    let rates = curve.running_mean(from, until, window);
    rates.iter().map(|rate| rate.1).reduce(f64::min).unwrap_or(0.0)
}

/// Coefficient of variation (standard deviation over mean) of the running 1 s mean of the rate, from the end
/// of the spill until `until`. `None` for less than 1.5 s, or without flow.
pub(super) fn variation(curve: &Curve<'_>, until: f64) -> Option<f64> {
    if until - SPILL_S < 1.5 * WINDOW_S {
        return None;
    }
    let rates = curve.running_mean(SPILL_S, until, WINDOW_S);
    let mean = rates.iter().map(|rate| rate.1).sum::<f64>() / rates.len() as f64;
    let square = rates.iter().map(|rate| (rate.1 - mean).powi(2)).sum::<f64>() / rates.len() as f64;
    (mean > 0.0).then(|| square.sqrt() / mean)
}

/// Longest stoppage until `until`, in seconds: a stretch covered by windows of [`RATE_WINDOW_S`] with mean
/// rates below 0.15 Q_b. 0 without a stoppage, `None` when no window fits.
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

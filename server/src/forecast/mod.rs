//! Forecasts, without IO and clock: when jobs start and end on a farm, as ranges.
//!
//! The cost of a run is its wall time by the check, e. Finished runs give ratios r of measured time to e (`speed`). The farm is then
//! simulated many times (`farm`): running jobs end, queued ones start in their order on free slots, and each takes e times a ratio.
//! A range goes from the 10 % to the 90 % quantile of these futures: it should hold the true time in 80 % of the cases.
//! `tests` measures the share on simulated farms.
//!
//! A forecast assumes that workers stay and that nobody submits jobs that come first.

mod answer;
mod farm;
mod speed;
#[cfg(test)]
mod tests;

pub use answer::on_this_machine;
pub(crate) use answer::{
    CLIENTS_CHOOSE, cost_of_clients, cost_without_workers, durations, no_forecast, range, with_spans,
};
pub(crate) use farm::{Batch, Farm, Progressed, Queue, Span, Spans, forecast};
pub(crate) use speed::Speed;

/// Share of ranges that hold the true time.
pub(crate) const SHARE: f64 = 0.8;

//! Forecasts in the types of the API.

use roost_api::forecast::{
    CostForecast, DurationRange, Forecast, ForecastBasis, LearnedFrom, RunRange, TimeRange,
};
use roost_api::time::Timestamp;
use roost_api::validate::ValidationReport;

use super::{Batch, Farm, Queue, SHARE, Span, Spans, Speed, forecast};

impl Spans {
    /// The same, if no job starts before this time, in seconds from now.
    pub(crate) fn held(self, held_s: f64) -> Self {
        let Some(start) = self.start else { return self };
        let late = |start_s: f64, time_s: f64| time_s + (held_s - start_s).max(0.0);
        let end =
            Span { low_s: late(start.low_s, self.end.low_s), high_s: late(start.high_s, self.end.high_s) };
        let start = Span { low_s: start.low_s.max(held_s), high_s: start.high_s.max(held_s) };
        Self { start: Some(start), end, ..self }
    }
}

/// A range of seconds from now as a range of time.
pub(crate) fn range(now: Timestamp, span: Span) -> TimeRange {
    let at = |seconds: f64| now.plus_ms((1000.0 * seconds) as i64);
    TimeRange { earliest: at(span.low_s), latest: at(span.high_s) }
}

/// A range of seconds as a range of a duration.
pub(crate) fn durations(span: Span) -> DurationRange {
    DurationRange { shortest_s: span.low_s, longest_s: span.high_s }
}

/// The lack of a forecast, and why.
pub(crate) fn no_forecast(detail: &str, runs_left: RunRange, now: Timestamp) -> Forecast {
    Forecast {
        waiting: Vec::new(),
        start: None,
        end: None,
        no_forecast: Some(detail.to_owned()),
        runs_left,
        basis: None,
        made_at: now,
    }
}

/// A forecast with ranges of start and end.
pub(crate) fn with_spans(base: Forecast, now: Timestamp, spans: &Spans, basis: ForecastBasis) -> Forecast {
    Forecast {
        start: spans.start.map(|span| range(now, span)),
        end: Some(range(now, spans.end)),
        no_forecast: None,
        basis: Some(basis),
        ..base
    }
}

/// The time of some runs one after the other in one slot, without what finished runs teach.
fn bare_spans(runs: RunRange, estimate_s: f64, slots: usize) -> Option<(Spans, Spans)> {
    let farm = Farm { slots, running: Vec::new() };
    let spans = |jobs| {
        let queue = Queue { own: Batch { jobs, estimate_s }, ..Queue::default() };
        forecast(&farm, &queue, &Speed::learned([]), 1)
    };
    spans(runs.least).zip(spans(runs.most))
}

/// The processor time of a number of runs, each of which takes this long by the check, where no worker can take them.
pub(crate) fn cost_without_workers(runs: RunRange, estimate_s: f64, why: String) -> CostForecast {
    let work = bare_spans(runs, estimate_s, 1).map_or(Span { low_s: 0.0, high_s: 0.0 }, |(fewest, most)| {
        Span { low_s: fewest.work.low_s, high_s: most.work.high_s }
    });
    CostForecast {
        runs,
        processor: Some(durations(work)),
        duration: None,
        end: None,
        no_forecast: Some(why),
        basis: None,
    }
}

/// Why the runs of a study with the driver `client` have no forecast.
pub(crate) const CLIENTS_CHOOSE: &str = "clients choose when its runs are made";

/// The number of runs that clients make, whose time nobody here knows.
pub(crate) fn cost_of_clients(runs: RunRange) -> CostForecast {
    CostForecast {
        runs,
        processor: None,
        duration: None,
        end: None,
        no_forecast: Some(CLIENTS_CHOOSE.to_owned()),
        basis: None,
    }
}

/// The forecast of a valid document on a machine with this many processors and no other work.
pub fn on_this_machine(report: &ValidationReport, processors: usize, now: Timestamp) -> CostForecast {
    let runs = RunRange { least: report.min_jobs, most: report.jobs };
    let estimate_s = report.wall_s / report.jobs.max(1) as f64;
    let slots = processors.max(1);
    let base = cost_without_workers(runs, estimate_s, String::new());
    let Some((fewest, most)) = bare_spans(runs, estimate_s, slots) else { return base };
    let span = Span { low_s: fewest.end.low_s, high_s: most.end.high_s };
    let basis = ForecastBasis {
        workers: 0,
        slots: slots as u64,
        finished_runs: 0,
        learned_from: LearnedFrom::Nothing,
        time_ratio: Speed::learned([]).median(),
        share: SHARE,
    };
    CostForecast {
        duration: Some(durations(span)),
        end: Some(range(now, span)),
        no_forecast: None,
        basis: Some(basis),
        ..base
    }
}

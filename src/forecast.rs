//! Forecasts and reasons for waiting, as people read them.

use roost_api::forecast::{CostForecast, Forecast, ForecastBasis, LearnedFrom, TimeRange};
use roost_api::time::Timestamp;
use roost_terminal::format;

/// The lines about a job, a sweep or a study that has not ended: why its jobs wait, when they start and end, and the facts behind it.
pub(crate) fn lines(forecast: &Forecast) -> Vec<String> {
    let waits = forecast.waiting.iter().map(|it| match it.jobs {
        1 => format!("1 job waits ({}): {}", it.reason, it.detail),
        jobs => format!("{jobs} jobs wait ({}): {}", it.reason, it.detail),
    });
    let mut lines: Vec<String> = waits.collect();
    for (name, range) in [("start", &forecast.start), ("end", &forecast.end)] {
        if let Some(range) = range {
            lines.push(format!("expected to {name} {}", times(range, forecast.made_at)));
        }
    }
    let runs = forecast.runs_left;
    if runs.least < runs.most && runs.most > 0 {
        lines.push(format!("{} to {} runs are left: its rule may end it early", runs.least, runs.most));
    }
    match (&forecast.no_forecast, &forecast.basis) {
        (Some(why), _) if forecast.waiting.iter().all(|it| it.detail != *why) => {
            lines.push(format!("no forecast: {why}"));
        }
        (None, Some(basis)) => lines.push(facts(basis)),
        _ => {}
    }
    lines
}

/// The end as a few words for a progress bar, such as `ends in 3:10 to 4:30`; none without a forecast.
pub(crate) fn ends_in(forecast: &Forecast) -> Option<String> {
    forecast.end.map(|end| format!("ends in {}", durations(&end, forecast.made_at)))
}

/// The lines about a document that is not submitted.
pub(crate) fn cost_lines(forecast: &CostForecast, place: &str) -> Vec<String> {
    let runs = forecast.runs;
    let count = if runs.least == runs.most {
        runs.most.to_string()
    } else {
        format!("{} to {}", runs.least, runs.most)
    };
    let hours = |seconds: f64| format::significant((seconds / 3600.0 * 1e4).round() / 1e4);
    let work = forecast.processor.map(|work| {
        format!(", {} to {} hours of processor time", hours(work.shortest_s), hours(work.longest_s))
    });
    let mut lines = vec![format!("{count} runs{}", work.unwrap_or_default())];
    if let Some(duration) = forecast.duration {
        let (short, long) = (format::duration(duration.shortest_s), format::duration(duration.longest_s));
        let end =
            forecast.end.map_or_else(String::new, |end| format!(", done at {}", clock_times(&end, None)));
        lines.push(format!("{short} to {long} {place}{end}"));
    }
    if let Some(why) = &forecast.no_forecast {
        lines.push(format!("no time of completion: {why}"));
    }
    lines.extend(forecast.basis.as_ref().map(facts));
    lines
}

/// The facts that a forecast rests on.
fn facts(basis: &ForecastBasis) -> String {
    let slots = if basis.slots == 1 { "1 slot".to_owned() } else { format!("{} slots", basis.slots) };
    let runs = match (basis.learned_from, basis.finished_runs) {
        (LearnedFrom::Sweep, runs) => format!("{runs} finished runs of it"),
        (LearnedFrom::Backend, 1) => "1 finished run of another job".to_owned(),
        (LearnedFrom::Backend, runs) => format!("{runs} finished runs of other jobs"),
        (LearnedFrom::Nothing, _) => "a rough estimate, since no run has finished".to_owned(),
    };
    format!("by {runs}, on {slots}; {:.0} % of such ranges hold the true time", 100.0 * basis.share)
}

/// A range of time, from now and by the clock.
fn times(range: &TimeRange, now: Timestamp) -> String {
    format!("in {} ({})", durations(range, now), clock_times(range, Some(now)))
}

fn durations(range: &TimeRange, now: Timestamp) -> String {
    let after = |time: Timestamp| format::duration((time.0 - now.0) as f64 / 1000.0);
    let (earliest, latest) = (after(range.earliest), after(range.latest));
    if earliest == latest { earliest } else { format!("{earliest} to {latest}") }
}

/// Times of day in UTC, such as `14:05 to 14:20 UTC`, with the date unless it is that of `now`.
fn clock_times(range: &TimeRange, now: Option<Timestamp>) -> String {
    let (earliest, latest) = (range.earliest.to_string(), range.latest.to_string());
    let day = |text: &str| text.get(..10).unwrap_or_default().to_owned();
    let minute = |text: &str| text.get(11..16).unwrap_or_default().to_owned();
    let today = now.map(|now| day(&now.to_string()));
    let shown = |text: &str, known: Option<&String>| match known {
        Some(known) if *known == day(text) => minute(text),
        _ => format!("{} {}", day(text), minute(text)),
    };
    let first = shown(&earliest, today.as_ref());
    let last = shown(&latest, Some(&day(&earliest)));
    if day(&earliest) == day(&latest) && minute(&earliest) == minute(&latest) {
        return format!("{first} UTC");
    }
    format!("{first} to {last} UTC")
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::*;

    fn forecast(change: impl FnOnce(&mut Value)) -> Forecast {
        let mut document = json!({
            "waiting": [{"reason": "workers_busy", "jobs": 1, "detail": "it is next"},
                        {"reason": "behind", "jobs": 340, "detail": "behind 1 job"}],
            "start": {"earliest": "2026-03-01T14:05:00.000Z", "latest": "2026-03-01T14:20:00.000Z"},
            "end": {"earliest": "2026-03-01T20:00:00.000Z", "latest": "2026-03-02T01:00:00.000Z"},
            "no_forecast": null, "runs_left": {"least": 341, "most": 341},
            "basis": {"workers": 1, "slots": 4, "finished_runs": 12, "learned_from": "sweep", "time_ratio": 2.1, "share": 0.8},
            "made_at": "2026-03-01T14:00:00.000Z"
        });
        change(&mut document);
        serde_json::from_value(document).unwrap()
    }

    #[test]
    fn forecast_in_words_has_reasons_times_and_facts() {
        let expected = [
            "1 job waits (workers_busy): it is next",
            "340 jobs wait (behind): behind 1 job",
            "expected to start in 5:00 to 20:00 (14:05 to 14:20 UTC)",
            "expected to end in 6:00:00 to 11:00:00 (20:00 to 2026-03-02 01:00 UTC)",
            "by 12 finished runs of it, on 4 slots; 80 % of such ranges hold the true time",
        ];
        assert_eq!(lines(&forecast(|_| {})), expected);
        assert_eq!(ends_in(&forecast(|_| {})).unwrap(), "ends in 6:00:00 to 11:00:00");
        let study = lines(&forecast(|document| document["runs_left"]["least"] = json!(59)));
        assert!(
            study.contains(&"59 to 341 runs are left: its rule may end it early".to_owned()),
            "{study:?}"
        );
    }

    #[test]
    fn missing_forecast_is_explained_once() {
        let none = |why: &str| {
            forecast(|document| {
                document["no_forecast"] = json!(why);
                (document["start"], document["end"], document["basis"]) =
                    (Value::Null, Value::Null, Value::Null);
            })
        };
        assert_eq!(lines(&none("it is next")).len(), 2, "a reason says it");
        assert_eq!(lines(&none("the study is paused"))[2], "no forecast: the study is paused");
        assert_eq!(ends_in(&none("")), None);
    }

    #[test]
    fn cost_of_a_document_has_runs_hours_and_completion() {
        let cost = json!({
            "runs": {"least": 59, "most": 300}, "processor": {"shortest_s": 3600.0, "longest_s": 9000.0},
            "duration": {"shortest_s": 1800.0, "longest_s": 4500.0},
            "end": {"earliest": "2026-03-01T14:30:00.000Z", "latest": "2026-03-01T15:15:00.000Z"},
            "no_forecast": null,
            "basis": {"workers": 0, "slots": 2, "finished_runs": 0, "learned_from": "nothing", "time_ratio": 2.0, "share": 0.8}
        });
        let expected = [
            "59 to 300 runs, 1 to 2.5 hours of processor time",
            "30:00 to 1:15:00 on this machine, done at 2026-03-01 14:30 to 15:15 UTC",
            "by a rough estimate, since no run has finished, on 2 slots; 80 % of such ranges hold the true time",
        ];
        assert_eq!(cost_lines(&serde_json::from_value(cost).unwrap(), "on this machine"), expected);
    }
}

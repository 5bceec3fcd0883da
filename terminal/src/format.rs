//! Numbers and names as people read them.

use roost_api::table::Summary;
use serde_json::Value;

/// A wall time, such as `42 s`, `3:07` or `1:02:09`.
pub fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m}:{s:02}"),
        (h, m, s) => format!("{h}:{m:02}:{s:02}"),
    }
}

/// Time left of an activity whose fraction done took `elapsed_s`; none while that is too little for an estimate.
pub fn time_left(fraction: f64, elapsed_s: f64) -> Option<String> {
    let is_early = fraction < 0.005 || elapsed_s < 0.5;
    (!is_early).then(|| format!("{} left", duration(elapsed_s * (1.0 - fraction) / fraction)))
}

/// A count with three digits and a prefix, such as `12.3 k` or `4.56 M`.
pub fn count(value: f64) -> String {
    let (scaled, prefix) = match value.abs() {
        v if v >= 1e9 => (value / 1e9, " G"),
        v if v >= 1e6 => (value / 1e6, " M"),
        v if v >= 1e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    format!("{}{prefix}", three_digits(scaled))
}

/// A number of bytes, such as `12.3 MiB`.
pub fn bytes(value: u64) -> String {
    let value = value as f64;
    let (scaled, unit) = match value {
        v if v >= 1073741824.0 => (v / 1073741824.0, "GiB"),
        v if v >= 1048576.0 => (v / 1048576.0, "MiB"),
        v => (v / 1024.0, "KiB"),
    };
    format!("{} {unit}", three_digits(scaled))
}

/// A JSON value as a table cell. Numbers have four significant digits, null is a dash, a mesh is the start of its digest.
pub fn cell(value: &Value) -> String {
    match value {
        Value::Null => "–".to_owned(),
        Value::String(text) => text.clone(),
        Value::Bool(true) => "yes".to_owned(),
        Value::Bool(false) => "no".to_owned(),
        Value::Object(mesh) if mesh.contains_key("digest") => {
            let word = |name| mesh.get(name).and_then(Value::as_str).unwrap_or_default();
            format!("{:.8}… {}", word("digest"), word("units"))
        }
        Value::Number(number) if number.is_f64() => number.as_f64().map_or_else(String::new, significant),
        other => other.to_string(),
    }
}

/// A response over the replicates of a design point: `4.21 ± 0.2` (the 95 % interval), or words with their counts.
/// The mean of an indicator is a share: `3 of 12 (9 to 53 %)`. Where replicates drew parameters from a posterior, the deviations by
/// parameters and by chance follow.
pub fn summary(summary: &Summary, is_indicator: bool) -> String {
    if let (true, Some(mean), Some(low), Some(high)) =
        (is_indicator, summary.mean, summary.low_95, summary.high_95)
    {
        let ones = (mean * summary.n as f64).round();
        return format!("{ones} of {} ({:.0} to {:.0} %)", summary.n, 100.0 * low, 100.0 * high);
    }
    if let Some(words) = &summary.words {
        let counted =
            words.iter().map(|(word, n)| if *n == summary.n { word.clone() } else { format!("{word} ×{n}") });
        return counted.collect::<Vec<_>>().join(", ");
    }
    match (summary.mean, summary.high_95) {
        (Some(mean), Some(high)) => {
            let deviations = summary.input_deviation.zip(summary.chance_deviation);
            let deviations = deviations.map(|(input, chance)| {
                format!(" (input {}, chance {})", two_digits(input), two_digits(chance))
            });
            format!("{} ± {}{}", significant(mean), two_digits(high - mean), deviations.unwrap_or_default())
        }
        (Some(mean), None) => significant(mean),
        (None, _) => "–".to_owned(),
    }
}

/// An interval, such as `0.4 to 1.2`; a dash without one.
pub fn interval(low: Option<f64>, high: Option<f64>) -> String {
    match low.zip(high) {
        Some((low, high)) => format!("{} to {}", significant(low), significant(high)),
        None => "–".to_owned(),
    }
}

/// Two significant digits, for errors.
fn two_digits(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { significant(format!("{value:.1e}").parse().unwrap_or(value)) }
}

/// Four significant digits without trailing zeros; very large and very small values have an exponent.
pub fn significant(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    if !(-4..6).contains(&exponent) {
        return format!("{value:.2e}");
    }
    let places = usize::try_from(3 - exponent).unwrap_or(0);
    let text = format!("{value:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

fn three_digits(value: f64) -> String {
    match value.abs() {
        v if v >= 100.0 => format!("{value:.0}"),
        v if v >= 10.0 => format!("{value:.1}"),
        _ => format!("{value:.2}"),
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn durations_and_time_left_are_formatted() {
        let shown: Vec<_> = [0.2, 59.4, 59.6, 187.0, 3729.0].into_iter().map(duration).collect();
        assert_eq!(shown, ["0 s", "59 s", "1:00", "3:07", "1:02:09"]);
        assert_eq!(time_left(0.25, 10.0).unwrap(), "30 s left");
        assert_eq!(time_left(0.0, 10.0), None);
    }

    #[test]
    fn summaries_have_an_interval_or_counts() {
        let text = |value| summary(&serde_json::from_value(value).unwrap(), false);
        assert_eq!(text(json!({"n": 3, "mean": 4.2131, "low_95": 4.0, "high_95": 4.4262})), "4.213 ± 0.21");
        assert_eq!(text(json!({"n": 1, "mean": 40.0})), "40");
        assert_eq!(text(json!({"n": 0})), "–");
        let drawn = json!({"n": 8, "mean": 4.2, "low_95": 4.0, "high_95": 4.4, "input_deviation": 0.15, "chance_deviation": 0.05});
        assert_eq!(text(drawn), "4.2 ± 0.2 (input 0.15, chance 0.05)");
        let share = json!({"n": 12, "mean": 0.25, "low_95": 0.0889, "high_95": 0.5323});
        assert_eq!(summary(&serde_json::from_value(share).unwrap(), true), "3 of 12 (9 to 53 %)");
        assert_eq!(summary(&Summary::default(), true), "–");
        assert_eq!(text(json!({"n": 2, "words": {"constant": 2}})), "constant");
        assert_eq!(text(json!({"n": 3, "words": {"constant": 2, "no_flow": 1}})), "constant ×2, no_flow ×1");
    }

    #[test]
    fn counts_bytes_and_cells_are_formatted() {
        assert_eq!([count(950.0), count(12_340.0), count(4.56e6)], ["950", "12.3 k", "4.56 M"]);
        assert_eq!(bytes(3 * 1024 * 1024 / 2), "1.50 MiB");
        let shown: Vec<_> =
            [33.2178, 0.045, 1234567.0, 120000.0, 5.75e-5, -0.5].into_iter().map(significant).collect();
        assert_eq!(shown, ["33.22", "0.045", "1.23e6", "120000", "5.75e-5", "-0.5"]);
        assert_eq!(cell(&json!(191)), "191");
        assert_eq!(cell(&json!(null)), "–");
        assert_eq!(cell(&json!(2.0)), "2");
        let mesh = json!({"digest": "0123456789abcdef".repeat(4), "units": "mm"});
        assert_eq!(cell(&mesh), "01234567… mm");
    }
}

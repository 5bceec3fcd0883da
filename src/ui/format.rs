//! Numbers as people read them.

use roost_api::table::Summary;
use serde_json::Value;

/// `42 s`, `3:07`, `1:02:09`: a stretch of wall time.
pub(crate) fn duration(seconds: f64) -> String {
    let whole = seconds.max(0.0).round() as u64;
    match (whole / 3600, whole / 60 % 60, whole % 60) {
        (0, 0, s) => format!("{s} s"),
        (0, m, s) => format!("{m}:{s:02}"),
        (h, m, s) => format!("{h}:{m:02}:{s:02}"),
    }
}

/// What is left of something that has taken `elapsed_s` for a share of `fraction`; none when it is too early to say.
pub(crate) fn time_left(fraction: f64, elapsed_s: f64) -> Option<String> {
    let is_early = fraction < 0.005 || elapsed_s < 0.5;
    (!is_early).then(|| format!("{} left", duration(elapsed_s * (1.0 - fraction) / fraction)))
}

/// `12.3 k`, `4.56 M`: a count with three digits and a prefix.
pub(crate) fn count(value: f64) -> String {
    let (scaled, prefix) = match value.abs() {
        v if v >= 1e9 => (value / 1e9, " G"),
        v if v >= 1e6 => (value / 1e6, " M"),
        v if v >= 1e3 => (value / 1e3, " k"),
        _ => (value, ""),
    };
    format!("{}{prefix}", digits(scaled))
}

/// `12.3 MiB`.
pub(crate) fn bytes(value: u64) -> String {
    let value = value as f64;
    let (scaled, unit) = match value {
        v if v >= 1073741824.0 => (v / 1073741824.0, "GiB"),
        v if v >= 1048576.0 => (v / 1048576.0, "MiB"),
        v => (v / 1024.0, "KiB"),
    };
    format!("{} {unit}", digits(scaled))
}

/// Short names of factors: the last word of each pointer, with the one before it where two end in the same.
pub(crate) fn factor_names<'a>(pointers: impl Iterator<Item = &'a String> + Clone) -> Vec<String> {
    let last = |pointer: &'a str| pointer.rsplit('/').next().unwrap_or(pointer);
    let name = |pointer: &'a String| {
        let name = last(pointer);
        let alike = pointers.clone().filter(|other| last(other) == name).count();
        let section = pointer.rsplit('/').nth(1).filter(|section| alike > 1 && !section.is_empty());
        section.map_or_else(|| name.to_owned(), |section| format!("{section}.{name}"))
    };
    pointers.clone().map(name).collect()
}

/// A JSON value as a table cell: numbers with four significant digits, a dash for null, a mesh by the start of its digest.
pub(crate) fn cell(value: &Value) -> String {
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

/// Names of factors as heads of columns: the last part of the pointer, with what stands before it where that is not enough.
pub(crate) fn factors(pointers: &[String]) -> Vec<String> {
    let tail = |pointer: &str, parts: usize| {
        let segments: Vec<&str> = pointer.trim_start_matches('/').split('/').collect();
        segments[segments.len().saturating_sub(parts)..].join(".")
    };
    let name = |pointer: &String| {
        let is_taken = |name: &String, parts| {
            pointers.iter().any(|other| other != pointer && tail(other, parts) == *name)
        };
        let lengths = 1..=pointer.split('/').count();
        let mut names = lengths.map(|parts| (parts, tail(pointer, parts)));
        let unique =
            names.find(|(parts, name)| name.starts_with(char::is_alphabetic) && !is_taken(name, *parts));
        unique.map_or_else(|| pointer.clone(), |(_, name)| name)
    };
    pointers.iter().map(name).collect()
}

/// A response over the replicates of a point: `4.21 ± 0.2` (the 95 % interval), or words with how often they came.
pub(crate) fn summary(summary: &Summary) -> String {
    if let Some(words) = &summary.words {
        let counted =
            words.iter().map(|(word, n)| if *n == summary.n { word.clone() } else { format!("{word} ×{n}") });
        return counted.collect::<Vec<_>>().join(", ");
    }
    match (summary.mean, summary.high_95) {
        (Some(mean), Some(high)) => format!("{} ± {}", significant(mean), short(high - mean)),
        (Some(mean), None) => significant(mean),
        (None, _) => "–".to_owned(),
    }
}

/// Two significant digits: enough for an error.
fn short(value: f64) -> String {
    if value == 0.0 { "0".to_owned() } else { significant(format!("{value:.1e}").parse().unwrap_or(value)) }
}

/// Four significant digits, without trailing zeros, in exponent form where it is far from 1.
pub(crate) fn significant(value: f64) -> String {
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

fn digits(value: f64) -> String {
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
    fn factors_that_end_alike_are_told_apart() {
        let pointers =
            ["/contact/fillet_belt/static_friction", "/contact/fillet_fillet/static_friction", "/condition"];
        let names = factor_names(pointers.map(str::to_owned).iter());
        assert_eq!(names, ["fillet_belt.static_friction", "fillet_fillet.static_friction", "condition"]);
    }

    #[test]
    fn durations() {
        let shown: Vec<_> = [0.2, 59.4, 59.6, 187.0, 3729.0].into_iter().map(duration).collect();
        assert_eq!(shown, ["0 s", "59 s", "1:00", "3:07", "1:02:09"]);
        assert_eq!(time_left(0.25, 10.0).unwrap(), "30 s left");
        assert_eq!(time_left(0.0, 10.0), None);
    }

    #[test]
    fn names_of_factors_are_as_short_as_they_may_be() {
        let names =
            |pointers: &[&str]| factors(&pointers.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>());
        assert_eq!(names(&["/equipment/gate_opening_m", "/seed"]), ["gate_opening_m", "seed"]);
        let twins = ["/contact/fillet_belt/friction", "/contact/fillet_wall/friction"];
        assert_eq!(names(&twins), ["fillet_belt.friction", "fillet_wall.friction"]);
        assert_eq!(names(&["/product/sizes_m/0/1"]), ["sizes_m.0.1"], "an index alone is no name");
    }

    #[test]
    fn summaries_are_short() {
        let of = |value| summary(&serde_json::from_value(value).unwrap());
        assert_eq!(of(json!({"n": 3, "mean": 4.2131, "low_95": 4.0, "high_95": 4.4262})), "4.213 ± 0.21");
        assert_eq!(of(json!({"n": 1, "mean": 40.0})), "40");
        assert_eq!(of(json!({"n": 0})), "–");
        assert_eq!(of(json!({"n": 2, "words": {"constant": 2}})), "constant");
        assert_eq!(of(json!({"n": 3, "words": {"constant": 2, "no_flow": 1}})), "constant ×2, no_flow ×1");
    }

    #[test]
    fn numbers() {
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

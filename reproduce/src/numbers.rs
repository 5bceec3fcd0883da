//! Numbers of the report as texts: values of rows, shares, significant digits.

use roost_terminal::format::significant;
use serde_json::Value;

/// A number or a text for a cell; a dash for null.
pub(crate) fn value(value: &Value) -> String {
    match value {
        Value::Number(number) => number.as_f64().map_or_else(String::new, significant),
        Value::String(text) => text.clone(),
        _ => "–".to_owned(),
    }
}

/// A share in per cent, with its sign.
pub(crate) fn percent(share: f64) -> String {
    if share.abs() < 5e-4 {
        return "0 %".to_owned();
    }
    let text = significant_to(100.0 * share, 2);
    if share > 0.0 { format!("+{text} %") } else { format!("{} %", text.replace('-', "−")) }
}

/// A number with this many significant digits.
pub(crate) fn significant_to(value: f64, digits: i32) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let step = 10f64.powi(value.abs().log10().floor() as i32 + 1 - digits);
    significant((value / step).round() * step)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentages_and_significant_digits() {
        let shown = [0.0712, -0.5, 1.5, 3e-6].map(percent);
        assert_eq!(shown, ["+7.1 %", "−50 %", "+150 %", "0 %"]);
        assert_eq!([significant_to(0.01234, 2), significant_to(0.0, 2)], ["0.012", "0"]);
    }
}

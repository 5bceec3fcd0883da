//! Words for factors, measures and numbers.

use roost_api::quantity::Quantity;
use roost_design::{Factor, Measure};
use serde_json::Value;

/// A number with the unit of a quantity.
pub(super) fn number(quantity: &Quantity, value: f64) -> String {
    quantity.with_unit(&digits(value))
}

/// Two numbers with the unit of a quantity.
pub(super) fn range(quantity: &Quantity, low: f64, high: f64) -> String {
    format!("{} to {}", digits(low), number(quantity, high))
}

/// A number to four digits; from 100,000 on with an exponent.
pub(super) fn digits(number: f64) -> String {
    if number == 0.0 || !number.is_finite() {
        return number.to_string();
    }
    if number.abs() >= 1e5 {
        let text = format!("{number:.3e}");
        let (digits, exponent) = text.split_once('e').unwrap_or((&text, "0"));
        return format!("{}e{exponent}", digits.trim_end_matches('0').trim_end_matches('.'));
    }
    let places = (3 - number.abs().log10().floor() as i32).clamp(0, 12) as usize;
    let text = format!("{number:.places$}");
    if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.').to_owned() } else { text }
}

/// A measure: the probability of an event, or the mean of a quantity.
pub(super) fn measure(measure: &Measure) -> String {
    match measure {
        Measure::Probability(response) => format!("the probability of `{response}`"),
        Measure::Mean(response) => {
            let name = Quantity::of_response(response).name;
            format!("the mean {}", name.strip_prefix("mean ").unwrap_or(&name))
        }
    }
}

/// A value of a measure with its unit.
pub(super) fn value(measure: &Measure, value: f64) -> String {
    match measure {
        Measure::Probability(_) => digits(value),
        Measure::Mean(response) => number(&Quantity::of_response(response), value),
    }
}

/// A value of a factor: a number with its unit, or a level.
pub(super) fn level(factor: &Factor, value: &Value) -> String {
    match value {
        Value::String(word) => word.replace('_', " "),
        Value::Number(of) => number(&Quantity::of_field(&factor.name), of.as_f64().unwrap_or_default()),
        other => other.to_string(),
    }
}

/// A list in words: `a, b and c`.
pub(super) fn list(items: &[String]) -> String {
    match items {
        [] => String::new(),
        [only] => only.clone(),
        [first @ .., last] => format!("{} and {last}", first.join(", ")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        let pairs = [
            (0.0, "0"),
            (0.034_853, "0.03485"),
            (12.0, "12"),
            (99_999.0, "99999"),
            (1e6, "1e6"),
            (2_592_016.0, "2.592e6"),
            (-300_000.0, "-3e5"),
        ];
        for (number, text) in pairs {
            assert_eq!(digits(number), text);
        }
    }
}

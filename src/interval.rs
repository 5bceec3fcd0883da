//! Wall times on the command line.

use std::time::Duration;

/// Parses a wall time such as `30s`. The maximum is a week.
pub(crate) fn interval(text: &str) -> Result<Duration, String> {
    let error = || "write 0, or a time from 1s to 168h, such as 30s, 5m or 1h".to_owned();
    if text == "0" {
        return Ok(Duration::ZERO);
    }
    let (number, unit) = text.split_at_checked(text.len().saturating_sub(1)).ok_or_else(error)?;
    let seconds = match unit {
        "s" => 1,
        "m" => 60,
        "h" => 3600,
        _ => return Err(error()),
    };
    let time = number.parse().ok().and_then(|number: u64| number.checked_mul(seconds));
    time.filter(|time| (1..=7 * 24 * 3600).contains(time)).map(Duration::from_secs).ok_or_else(error)
}

/// Parses a wall time such as `30s`, which is not zero. The maximum is a week.
pub(crate) fn time(text: &str) -> Result<Duration, String> {
    let found = interval(text).ok().filter(|time| !time.is_zero());
    found.ok_or_else(|| "write a time from 1s to 168h, such as 30s, 5m or 1h".to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_interval_is_zero_or_a_number_and_a_unit() {
        for (text, seconds) in [("0", 0), ("1s", 1), ("30s", 30), ("5m", 300), ("168h", 604_800)] {
            assert_eq!(interval(text), Ok(Duration::from_secs(seconds)), "{text}");
        }
        for text in ["", "s", "30", "0s", "169h", "-1s", "1.5m", "5 m", "1d", "99999999999999999999h", "5é"]
        {
            assert!(interval(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_time_is_not_zero() {
        assert_eq!(time("5m"), Ok(Duration::from_secs(300)));
        for text in ["0", "", "5", "169h"] {
            assert!(time(text).is_err_and(|error| error.contains("1s to 168h")), "{text}");
        }
    }
}

//! Mean, standard deviation and number of replicates.

use roost_api::Fault;
use roost_api::measurements::MeasuredResponse;
use roost_stats::Sample;
use serde_json::{Value, json};

use super::units::Conversion;
use crate::document::fault;

/// Statistics of the replicates of one number, in the unit as written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ReplicateStatistics {
    pub(super) mean: f64,
    pub(super) deviation: f64,
    pub(super) n: u64,
}

impl ReplicateStatistics {
    /// The same in another unit; infinite numbers if they overflow.
    pub(super) fn converted(self, conversion: Conversion) -> Self {
        let [mean, deviation] = [self.mean, self.deviation].map(|number| conversion.of(number));
        Self { mean, deviation, n: self.n }
    }

    /// The first number that overflowed, by name.
    pub(super) fn overflow(&self) -> Option<&'static str> {
        let numbers = [("mean", self.mean), ("deviation", self.deviation)];
        numbers.into_iter().find(|(_, number)| !number.is_finite()).map(|(name, _)| name)
    }

    /// The replicates of a measured response: from its values, or as stated.
    pub(super) fn of_response(
        at: &str,
        measured: &MeasuredResponse,
        faults: &mut Vec<Fault>,
    ) -> Option<Self> {
        let MeasuredResponse { values, mean, deviation, n, .. } = measured;
        let Some(values) = values else {
            let mut missing = |name: &str, allowed: &str| {
                let detail = "is missing, and there are no `values`";
                faults.push(fault(&format!("{at}/{name}"), Value::Null, detail, allowed));
            };
            if mean.is_none() {
                missing("mean", "a number");
            }
            if n.is_none() {
                missing("n", "a whole number, 1 or more");
            }
            let report = |detail: &str, allowed: &str| {
                fault(&format!("{at}/deviation"), json!(deviation), detail, allowed)
            };
            let deviation = checked_deviation(*deviation, n.unwrap_or(2).into(), report, faults);
            return Some(Self { mean: (*mean)?, deviation: deviation?, n: (*n)?.into() });
        };
        let repeated = [("mean", mean.map(|mean| json!(mean))), ("n", n.map(|n| json!(n)))];
        for (name, value) in repeated {
            if let Some(value) = value {
                let detail = "follows from `values`";
                faults.push(fault(&format!("{at}/{name}"), value, detail, "left out beside `values`"));
            }
        }
        let sample = Sample::of(values);
        match (values.len(), deviation) {
            (0, _) => {
                faults.push(fault(
                    &format!("{at}/values"),
                    json!([]),
                    "there is no value",
                    "at least one number",
                ));
                None
            }
            (1, _) => {
                let report = |detail: &str, allowed: &str| {
                    fault(&format!("{at}/deviation"), json!(deviation), detail, allowed)
                };
                let deviation = checked_deviation(*deviation, 1, report, faults)?;
                Some(Self { mean: values[0], deviation, n: 1 })
            }
            (_, Some(stated)) => {
                let detail = "follows from `values`";
                faults.push(fault(
                    &format!("{at}/deviation"),
                    json!(stated),
                    detail,
                    "left out beside several `values`",
                ));
                None
            }
            (n, None) => Some(Self { mean: sample?.mean, deviation: sample?.deviation?, n: n as u64 }),
        }
    }
}

/// The stated deviation of `n` replicates; `report` makes the fault of a detail and the allowed values.
pub(super) fn checked_deviation(
    deviation: Option<f64>,
    n: u64,
    report: impl Fn(&str, &str) -> Fault,
    faults: &mut Vec<Fault>,
) -> Option<f64> {
    let wrong = match deviation {
        Some(deviation) if deviation >= 0.0 => return Some(deviation),
        Some(_) => report("a standard deviation is not negative", "0 or more"),
        None if n == 1 => report(
            "a single value has no deviation of its own",
            "the deviation of the instrument, or of earlier tests",
        ),
        None => report("the standard deviation is missing", "0 or more"),
    };
    faults.push(wrong);
    None
}

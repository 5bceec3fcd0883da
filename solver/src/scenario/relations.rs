//! Faults between fields: each value is in its range, yet two of them do not go together.

use serde_json::Value;

use super::Fault;
use super::field::plain;
use super::fields::{FIELDS, find};

/// A number that must not be greater than another, and what it would mean if it were.
struct AtMost {
    small: &'static str,
    large: &'static str,
    otherwise: &'static str,
}

const ORDER: &[AtMost] = &[
    AtMost {
        small: "/equipment/gate_opening_m",
        large: "/equipment/hopper_height_m",
        otherwise: "the gate would open above the hopper",
    },
    AtMost {
        small: "/numerics/output_interval_s",
        large: "/numerics/duration_s",
        otherwise: "the run would end before its first sample",
    },
    AtMost {
        small: "/numerics/timestep_s",
        large: "/numerics/output_interval_s",
        otherwise: "a sample would be due within a time step",
    },
];

/// The most samples of a run.
pub(super) const MAX_SAMPLES: f64 = 100_000.0;

/// Checks the fields of `completed` against each other. `document` tells which of two the author wrote, and
/// so can change.
pub(super) fn check(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    for order in ORDER {
        check_order(order, document, completed, faults);
    }
    check_samples(document, completed, faults);
    check_alternatives(document, completed, faults);
}

fn number(document: &Value, pointer: &str) -> Option<f64> {
    document.pointer(pointer)?.as_f64()
}

/// The value that the author wrote, or else the default.
fn as_written<'a>(document: &'a Value, completed: &'a Value, pointer: &str) -> &'a Value {
    document.pointer(pointer).or_else(|| completed.pointer(pointer)).unwrap_or(&Value::Null)
}

fn check_order(order: &AtMost, document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let (Some(small), Some(large)) = (number(completed, order.small), number(completed, order.large)) else {
        return;
    };
    if small <= large {
        return;
    }
    let only_large = document.pointer(order.small).is_none() && document.pointer(order.large).is_some();
    let (pointer, sign, other, bound) = if only_large {
        (order.large, '≥', order.small, small)
    } else {
        (order.small, '≤', order.large, large)
    };
    let unit = find(pointer).map_or("", |field| field.unit);
    let allowed = format!("{sign} {} {unit} ({other})", plain(bound));
    let value = as_written(document, completed, pointer);
    faults.push(Fault::new(pointer, value, order.otherwise.to_owned(), Some(allowed)));
}

fn check_samples(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    let interval_at = "/numerics/output_interval_s";
    let time = |name| number(completed, &format!("/numerics/{name}"));
    let (Some(interval), Some(fill), Some(process)) =
        (number(completed, interval_at), time("max_fill_s"), time("duration_s"))
    else {
        return;
    };
    let duration = fill + process;
    if duration / interval > MAX_SAMPLES {
        let detail = format!("makes more than {MAX_SAMPLES} samples");
        let allowed = format!("≥ {} s at this duration and longest fill", plain(duration / MAX_SAMPLES));
        let value = as_written(document, completed, interval_at);
        faults.push(Fault::new(interval_at, value, detail, Some(allowed)));
    }
}

/// Of a field and the one it yields to, exactly one is a number.
fn check_alternatives(document: &Value, completed: &Value, faults: &mut Vec<Fault>) {
    for field in FIELDS {
        let Some(other) = field.yields_to else { continue };
        let (Some(one), Some(two)) = (completed.pointer(field.pointer), completed.pointer(other)) else {
            continue;
        };
        let allowed = Some(format!("null in one of {} and {other}", field.pointer));
        if !one.is_null() && !two.is_null() {
            let two = as_written(document, completed, other);
            faults.push(Fault::new(other, two, format!("excludes {}", field.pointer), allowed));
        } else if one.is_null() && two.is_null() {
            faults.push(Fault::new(field.pointer, one, format!("is null, and so is {other}"), allowed));
        }
    }
}

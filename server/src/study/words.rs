//! Words for factors, measures and numbers.

use roost_design::Measure;
use roost_solver::experiments::all_responses;
use roost_solver::scenario::fields;

/// A quantity with its name and unit.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Quantity {
    pub(super) name: String,
    unit: String,
}

impl Quantity {
    /// The quantity of a scenario's field: `/equipment/gate_opening_m` is the gate opening in m.
    pub(super) fn of_field(pointer: &str) -> Self {
        let unit = fields::find(pointer).map_or("", |field| field.unit);
        Self::new(pointer.rsplit('/').next().unwrap_or(pointer), unit)
    }

    /// The quantity of a response.
    pub(super) fn of_response(response: &str) -> Self {
        let row = all_responses().into_iter().find(|shared| shared.row.name == response);
        Self::new(response, row.map_or("", |shared| shared.row.unit))
    }

    fn new(name: &str, unit: &str) -> Self {
        let suffix = format!("_{}", unit.replace('/', "_").replace('²', "2").replace('³', "3"));
        let unit = if unit == "1" { "" } else { unit };
        let stem = name.strip_suffix(&suffix).filter(|_| !unit.is_empty()).unwrap_or(name);
        Self { name: stem.replace('_', " "), unit: unit.to_owned() }
    }

    /// A number with the unit.
    pub(super) fn value(&self, number: f64) -> String {
        let unit = if self.unit.is_empty() { String::new() } else { format!(" {}", self.unit) };
        format!("{}{unit}", digits(number))
    }

    /// Two numbers with the unit.
    pub(super) fn range(&self, low: f64, high: f64) -> String {
        format!("{} to {}", digits(low), self.value(high))
    }
}

/// A number to four digits.
pub(super) fn digits(number: f64) -> String {
    if number == 0.0 || !number.is_finite() {
        return number.to_string();
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
pub(super) fn value(measure: &Measure, number: f64) -> String {
    match measure {
        Measure::Probability(_) => digits(number),
        Measure::Mean(response) => Quantity::of_response(response).value(number),
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

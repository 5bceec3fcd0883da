//! Axes: linear, logarithmic, or with a tick for each level, with the label of their quantity.

use std::ops::Range;

use anyhow::Result;
use plotters::coord::ranged1d::{KeyPointHint, NoDefaultFormatting, Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;
use roost_design::{Factor, Measure, Scale};
use serde_json::Value;

use super::Area;
use crate::format::significant;
use crate::plot::FONT;
use roost_api::quantity::Quantity;

pub(super) type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<AxisRange, AxisRange>>;

/// The range of an axis with its scale.
#[derive(Clone)]
pub(super) enum AxisRange {
    Linear(RangedCoordf64),
    Log(Range<f64>),
    /// Names of levels at 0, 1, …
    Levels(Vec<String>),
}

impl Ranged for AxisRange {
    type FormatOption = NoDefaultFormatting;
    type ValueType = f64;

    fn map(&self, value: &f64, limit: (i32, i32)) -> i32 {
        match self {
            Self::Linear(range) => range.map(value, limit),
            Self::Levels(_) => RangedCoordf64::from(self.range()).map(value, limit),
            Self::Log(range) => {
                let share = (value / range.start).ln() / (range.end / range.start).ln();
                limit.0 + (share * f64::from(limit.1 - limit.0)).round() as i32
            }
        }
    }

    fn key_points<Hint: KeyPointHint>(&self, hint: Hint) -> Vec<f64> {
        let range = match self {
            Self::Linear(range) => return range.key_points(hint),
            Self::Levels(names) => return (0..names.len()).map(|level| level as f64).collect(),
            Self::Log(range) => range,
        };
        let first = range.start.log10().floor() as i32;
        let last = range.end.log10().ceil() as i32;
        let round = (first..=last).flat_map(|power| [1.0, 2.0, 5.0].map(|digit| digit * 10_f64.powi(power)));
        let round: Vec<f64> = round.filter(|value| range.contains(value)).collect();
        // A narrow range has no such numbers.
        if round.len() < 3 { RangedCoordf64::from(range.clone()).key_points(hint) } else { round }
    }

    fn range(&self) -> Range<f64> {
        match self {
            Self::Linear(range) => range.range(),
            Self::Log(range) => range.clone(),
            Self::Levels(names) => -0.5..names.len() as f64 - 0.5,
        }
    }
}

impl ValueFormatter<f64> for AxisRange {
    fn format(value: &f64) -> String {
        significant(*value)
    }

    fn format_ext(&self, value: &f64) -> String {
        match self {
            Self::Levels(names) => names.get(*value as usize).cloned().unwrap_or_default(),
            _ => significant(*value),
        }
    }
}

/// An axis with its label.
pub(super) struct Axis {
    pub(super) label: String,
    pub(super) range: AxisRange,
}

impl Axis {
    /// The range of a factor.
    pub(super) fn of_factor(factor: &Factor) -> Self {
        // Whole numbers lie in the middle of their cells.
        let range = factor.place(0.0)..factor.place(1.0);
        let range = match factor.scale {
            _ if factor.is_categorical() => {
                AxisRange::Levels(factor.levels.iter().map(|level| value_words(factor, level)).collect())
            }
            Scale::Linear => AxisRange::Linear(range.into()),
            Scale::Log => AxisRange::Log(range),
        };
        Self { label: Quantity::of_field(&factor.name).label(), range }
    }

    /// A measure over a range of its values: 0 to 1 for a probability, else the values with some space around.
    pub(super) fn of_measure(measure: &Measure, values: impl Iterator<Item = f64>) -> Self {
        let range = match measure {
            Measure::Probability(_) => 0.0..1.0,
            Measure::Mean(_) => spread(values),
        };
        Self { label: measure_label(measure), range: AxisRange::Linear(range.into()) }
    }
}

/// The range of some values, with 5 % more on both sides.
pub(super) fn spread(values: impl Iterator<Item = f64>) -> Range<f64> {
    let ends = values
        .filter(|value| value.is_finite())
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
    match ends {
        (low, high) if low < high => low - 0.05 * (high - low)..high + 0.05 * (high - low),
        (value, _) if value.is_finite() => {
            value - 0.5 * value.abs().max(1e-9)..value + 0.5 * value.abs().max(1e-9)
        }
        _ => 0.0..1.0,
    }
}

/// A value of a factor in words: a number with its unit, or a level.
pub(super) fn value_words(factor: &Factor, value: &Value) -> String {
    match value {
        Value::String(word) => word.replace('_', " "),
        Value::Number(number) => {
            let number = number.as_f64().unwrap_or_default();
            Quantity::of_field(&factor.name).with_unit(&significant(number))
        }
        other => other.to_string(),
    }
}

/// A measure in words with its unit: `probability of jammed`, `mean rate (kg/s)`.
pub(super) fn measure_label(measure: &Measure) -> String {
    match measure {
        Measure::Probability(response) => format!("probability of {}", Quantity::of_response(response).name),
        Measure::Mean(response) => {
            let label = Quantity::of_response(response).label();
            if label.starts_with("mean ") { label } else { format!("mean {label}") }
        }
    }
}

/// A value of a measure with its unit.
pub(super) fn measure_value(measure: &Measure, value: f64) -> String {
    match measure {
        Measure::Probability(_) => significant(value),
        Measure::Mean(response) => Quantity::of_response(response).with_unit(&significant(value)),
    }
}

/// A pair of axes with its grid.
pub(super) fn chart<'a, 'b>(area: &'a Area<'b>, x: Axis, y: Axis) -> Result<Chart<'a, 'b>> {
    chart_with(area, x, y, 11)
}

/// A pair of axes with at most so many numbers along each.
pub(super) fn chart_with<'a, 'b>(
    area: &'a Area<'b>,
    x: Axis,
    y: Axis,
    labels: usize,
) -> Result<Chart<'a, 'b>> {
    let mut builder = ChartBuilder::on(area);
    builder.margin(12).x_label_area_size(44).y_label_area_size(64);
    let mut chart = builder.build_cartesian_2d(x.range, y.range)?;
    let mut mesh = chart.configure_mesh();
    mesh.x_labels(labels)
        .y_labels(labels)
        .x_desc(x.label)
        .y_desc(y.label)
        .axis_desc_style((FONT, 15))
        .label_style((FONT, 13))
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .axis_style(BLACK.mix(0.6))
        .draw()?;
    Ok(chart)
}

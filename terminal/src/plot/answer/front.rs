//! Recommendations for two objectives: the front, with intervals of both.

use anyhow::Result;
use plotters::prelude::*;
use roost_design::Factor;
use roost_design::goals::{Objective, Optimise, OptimiseAnswer, Recommendation};

use super::axis::{Axis, AxisRange, chart, measure_label, spread, value_words};
use super::legend::{self, Glyph};
use super::{Area, BLUE, Body, GREEN};
use crate::plot::{FONT, WIDTH};
use roost_api::quantity::Quantity;
use serde_json::Value;

const HEIGHT: u32 = 500;

/// A front.
pub(super) struct Front<'a> {
    pub(super) goal: &'a Optimise,
    pub(super) factors: &'a [Factor],
    pub(super) found: &'a OptimiseAnswer,
}

/// Value, lower and upper end of both objectives.
type Pair = [(f64, f64, f64); 2];

/// The forecasts of a point.
fn forecast(point: &Recommendation) -> Option<Pair> {
    let [one, other] = point.objectives.as_slice() else { return None };
    Some([(one.value, one.low, one.high), (other.value, other.low, other.high)])
}

/// The confirmation of a point, once both objectives have intervals.
fn confirmed(point: &Recommendation) -> Option<Pair> {
    let [Some(one), Some(other)] = point.confirmation.as_ref()?.objectives.as_slice() else { return None };
    Some([(one.value, one.low?, one.high?), (other.value, other.low?, other.high?)])
}

impl Body for Front<'_> {
    fn height(&self) -> u32 {
        HEIGHT
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        let (plot, side) = area.split_horizontally(WIDTH - legend::WIDTH);
        let points = || self.found.recommended.iter().chain(&self.found.rejected);
        let axis = |objective: usize| {
            let pairs = points().flat_map(|point| [forecast(point), confirmed(point)]).flatten();
            let ends = pairs.flat_map(|pair| [pair[objective].1, pair[objective].2]);
            let range = spread(ends);
            let objective = &self.goal.objectives[objective];
            let word = if matches!(objective, Objective::Minimise(_)) { "minimised" } else { "maximised" };
            let label = format!("{}, {word}", measure_label(objective.measure()));
            Axis { label, range: AxisRange::Linear(range.into()) }
        };
        let mut chart = chart(&plot, axis(0), axis(1))?;
        let (model, fresh, left_out) = (BLUE.mix(0.45), GREEN.mix(1.0), BLACK.mix(0.3));
        let rejected = self.found.rejected.iter().map(|point| (forecast(point), left_out, 4));
        let forecasts = self.found.recommended.iter().map(|point| (forecast(point), model, 4));
        let confirmed = self.found.recommended.iter().map(|point| (confirmed(point), fresh, 6));
        for (pair, colour, radius) in rejected.chain(forecasts).chain(confirmed) {
            let Some([(x, left, right), (y, low, high)]) = pair else { continue };
            for ends in [[(left, y), (right, y)], [(x, low), (x, high)]] {
                chart.draw_series([PathElement::new(ends, colour.stroke_width(2))])?;
            }
            chart.draw_series([Circle::new((x, y), radius, colour.filled())])?;
        }
        let mut rows = vec![
            (Glyph::Dot(4, model.filled()), "forecast by the model, 95 %".to_owned()),
            (Glyph::Dot(6, fresh.filled()), "confirmation with fresh seeds, 95 %".to_owned()),
        ];
        if !self.found.rejected.is_empty() {
            rows.push((Glyph::Dot(4, left_out.filled()), "rejected by its confirmation".to_owned()));
        }
        for (index, point) in self.found.recommended.iter().enumerate() {
            let number = (index + 1).to_string();
            let at = self::confirmed(point).or_else(|| forecast(point));
            if let Some([(x, ..), (y, ..)]) = at {
                let text = Text::new(number.clone(), (8, -18), (FONT, 14));
                chart.draw_series([EmptyElement::at((x, y)) + text])?;
            }
            let value = |(factor, value): (&Factor, &Value)| {
                format!("{} {}", Quantity::of_field(&factor.name).name, value_words(factor, value))
            };
            let values: Vec<String> = self.factors.iter().zip(&point.values).map(value).collect();
            rows.push((Glyph::None, format!("{number}: {}", values.join(", "))));
        }
        legend::draw(&side, 20, &rows).map(drop)
    }
}

//! Curves over one factor: the estimate with its band, the level and its crossings, and the points with their intervals.

use anyhow::Result;
use plotters::prelude::*;
use roost_design::goals::{BoundaryAnswer, EstimateAnswer};
use roost_design::intervals::Estimated;
use roost_design::{Factor, Measure};

use super::axis::{Axis, AxisRange, chart, measure_label, measure_value};
use super::legend::{self, Glyph};
use super::{Area, BLUE, Body, ORANGE};
use crate::format::significant;
use crate::plot::{DASHES, WIDTH};
use roost_api::quantity::Quantity;

const HEIGHT: u32 = 460;
const PANEL_HEIGHT: u32 = 340;

/// A panel over one factor.
pub(super) struct Curve<'a> {
    factor: &'a Factor,
    of: &'a Measure,
    boundary: Option<&'a BoundaryAnswer>,
    points: Vec<(f64, Estimated)>,
}

/// A panel per measure.
pub(super) struct Curves<'a>(Vec<Curve<'a>>);

impl<'a> Curve<'a> {
    pub(super) fn of_boundary(factor: &'a Factor, of: &'a Measure, found: &'a BoundaryAnswer) -> Self {
        let points = found.observed.iter().map(|point| (point.values[0], point.estimated)).collect();
        Self { factor, of, boundary: Some(found), points }
    }

    fn axis_of_measure(&self) -> Axis {
        let map = self.boundary.iter().flat_map(|found| &found.map);
        let map = map.flat_map(|point| [point.low, point.high]);
        let values = self.points.iter().map(|(_, estimated)| estimated.value);
        let level = self.boundary.map(|found| found.level);
        if let (Measure::Probability(_), Some(level)) = (self.of, level) {
            // A small level would be at the bottom of an axis to 1. Intervals of points with few runs are cut.
            let top = map.chain(values).fold(2.0 * level, f64::max);
            return Axis {
                range: AxisRange::Linear((0.0..(1.05 * top).min(1.0)).into()),
                label: measure_label(self.of),
            };
        }
        let ends = self.points.iter().flat_map(|(_, estimated)| [estimated.low, estimated.high]).flatten();
        Axis::of_measure(self.of, map.chain(values).chain(ends).chain(level))
    }

    fn paint(&self, area: &Area<'_>) -> Result<()> {
        let (plot, side) = area.split_horizontally(WIDTH - legend::WIDTH);
        let x = Axis::of_factor(self.factor);
        let y = self.axis_of_measure();
        let range = Ranged::range(&y.range);
        let mut chart = chart(&plot, x, y)?;
        let line = BLUE.stroke_width(2);
        let level = BLACK.stroke_width(1);
        let interval = BLACK.mix(0.35).stroke_width(1);
        let dot = BLACK.mix(0.75).filled();
        let mut rows = Vec::new();
        if let Some(found) = self.boundary {
            let map = &found.map;
            let upper = map.iter().map(|point| (point.values[0], point.high));
            let lower = map.iter().rev().map(|point| (point.values[0], point.low));
            if !map.is_empty() {
                chart.draw_series([Polygon::new(upper.chain(lower).collect::<Vec<_>>(), BLUE.mix(0.18))])?;
            }
            for crossing in &found.crossings {
                let corners = [(crossing.low, range.start), (crossing.high, range.end)];
                chart.draw_series([Rectangle::new(corners, ORANGE.mix(0.15).filled())])?;
                for at in &crossing.estimates {
                    let ends = [(*at, range.start), (*at, range.end)];
                    chart.draw_series([PathElement::new(ends, ORANGE.stroke_width(2))])?;
                }
            }
            chart.draw_series(LineSeries::new(
                map.iter().map(|point| (point.values[0], point.estimate)),
                line,
            ))?;
            let across = [(self.factor.low, found.level), (self.factor.high, found.level)];
            let (dash, gap) = DASHES[1].unwrap_or((9, 5));
            chart.draw_series(DashedLineSeries::new(across, dash, gap, level))?;
            rows.extend(self.rows(found));
        }
        for (at, estimated) in &self.points {
            if let (Some(low), Some(high)) = (estimated.low, estimated.high) {
                let ends = [(*at, low), (*at, high.min(range.end))];
                chart.draw_series([PathElement::new(ends, interval)])?;
            }
            chart.draw_series([Circle::new((*at, estimated.value), legend::radius(estimated.n), dot)])?;
        }
        rows.push((Glyph::Line(interval), "95 % interval of the runs at a point alone".to_owned()));
        rows.extend(legend::sizes(self.points.iter().map(|(_, estimated)| estimated.n), dot));
        legend::draw(&side, 20, &rows).map(drop)
    }

    /// Rows of the legend about the boundary.
    fn rows(&self, found: &BoundaryAnswer) -> Vec<(Glyph, String)> {
        let quantity = Quantity::of_field(&self.factor.name);
        let mut rows = vec![
            (Glyph::Line(BLUE.stroke_width(2)), format!("{}, by the model", measure_label(self.of))),
            (Glyph::Patch(BLUE.mix(0.18)), "its band, 95 % for the whole boundary".to_owned()),
            (Glyph::Dashes(BLACK.stroke_width(1)), format!("level {}", measure_value(self.of, found.level))),
        ];
        for crossing in &found.crossings {
            for at in &crossing.estimates {
                rows.push((
                    Glyph::Line(ORANGE.stroke_width(2)),
                    format!("crossing at {}", quantity.with_unit(&significant(*at))),
                ));
            }
            let word = if crossing.is_certain { "its 95 % interval" } else { "perhaps a crossing" };
            let ends = format!(
                "{word}: {} to {}",
                significant(crossing.low),
                quantity.with_unit(&significant(crossing.high))
            );
            rows.push((Glyph::Patch(ORANGE.mix(0.15)), ends));
        }
        rows
    }
}

impl Body for Curve<'_> {
    fn height(&self) -> u32 {
        HEIGHT
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        self.paint(area)
    }
}

impl<'a> Curves<'a> {
    pub(super) fn of_estimate(factor: &'a Factor, found: &'a EstimateAnswer) -> Self {
        let measures = found.points.first().map_or(0, |point| point.measures.len());
        let panel = |index: usize| {
            let points = found.points.iter().filter_map(|point| {
                let at = factor.number(point.values.first()?)?;
                Some((at, point.measures.get(index)?.estimated?))
            });
            Curve {
                factor,
                of: &found.points[0].measures[index].of,
                boundary: None,
                points: points.collect(),
            }
        };
        Self((0..measures).map(panel).collect())
    }
}

impl Body for Curves<'_> {
    fn height(&self) -> u32 {
        PANEL_HEIGHT * self.0.len() as u32
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        for (panel, area) in self.0.iter().zip(area.split_evenly((self.0.len().max(1), 1))) {
            panel.paint(&area)?;
        }
        Ok(())
    }
}

//! The map of a boundary over two factors: colours of the estimate, the boundary with its band, and the points. Of three or four
//! factors the two with the shortest length scales span the map, and each panel has one value of the others.

use anyhow::Result;
use plotters::prelude::*;
use roost_design::goals::{BoundaryAnswer, MapPoint};
use roost_design::{Factor, Measure};

use super::axis::{Axis, chart, measure_label, measure_value};
use super::legend::{self, Glyph};
use super::{Area, BLUE, Body, ORANGE, contour};
use crate::format::significant;
use crate::plot::{DASHES, FONT, WIDTH};
use roost_api::quantity::Quantity;

const HEIGHT: u32 = 580;
const SLICE_HEIGHT: u32 = 400;
/// Colours on each side of the level.
const SHADES: i32 = 10;
/// Parts of a cell of the map in the picture, along each factor.
const PARTS: usize = 4;
/// Width and height of the colour bar, in pixels.
const BAR: (i32, i32) = (22, 150);

/// A map, or slices.
pub(super) struct Map<'a> {
    pub(super) of: &'a Measure,
    pub(super) factors: &'a [Factor],
    pub(super) found: &'a BoundaryAnswer,
}

/// A panel: both factors, and the points of the map over them.
struct Panel<'a> {
    x: &'a Factor,
    y: &'a Factor,
    steps: usize,
    /// The second factor varies fastest.
    map: Vec<&'a MapPoint>,
    /// Values of the other factors, in words.
    title: String,
}

/// Colours of values below and above a level.
struct Shades {
    low: f64,
    level: f64,
    high: f64,
}

impl Shades {
    /// From −[`SHADES`] to [`SHADES`], 0 at the level.
    fn shade(&self, value: f64) -> i32 {
        let end = if value > self.level { self.high } else { self.low };
        let share = if end == self.level { 1.0 } else { (value - self.level) / (end - self.level) };
        let shade = (share.clamp(0.0, 1.0) * f64::from(SHADES)).ceil() as i32;
        if value > self.level { shade } else { -shade }
    }

    fn colour(shade: i32) -> RGBColor {
        let end = if shade > 0 { ORANGE } else { BLUE };
        let share = 0.85 * f64::from(shade.abs()) / f64::from(SHADES);
        let mixed = |part: u8| (255.0 + (f64::from(part) - 255.0) * share).round() as u8;
        RGBColor(mixed(end.0), mixed(end.1), mixed(end.2))
    }
}

impl Map<'_> {
    fn shades(&self) -> Shades {
        let level = self.found.level;
        match self.of {
            Measure::Probability(_) => Shades { low: 0.0, level, high: 1.0 },
            Measure::Mean(_) => {
                let ends = (level, level);
                let map = self.found.map.iter().map(|point| point.estimate);
                let (low, high) = map.fold(ends, |(low, high), value| (low.min(value), high.max(value)));
                Shades { low, level, high }
            }
        }
    }

    fn panels(&self) -> Vec<Panel<'_>> {
        let count = self.factors.len();
        let mut order: Vec<usize> = (0..count).collect();
        let length = |factor: &usize| self.found.length_scales.get(*factor).copied().unwrap_or(f64::INFINITY);
        order.sort_by(|one, other| length(one).total_cmp(&length(other)));
        let (shown, others) = order.split_at_mut(2);
        shown.sort_unstable();
        others.sort_unstable();
        let (x, y) = (shown[0], shown[1]);
        let steps = (self.found.map.len() as f64).powf(1.0 / count as f64).round() as usize;
        let middle = steps / 2;
        let slices = if others.is_empty() || steps == 0 { vec![middle] } else { vec![0, middle, steps - 1] };
        let panel = |slice: usize| {
            let mut index = vec![middle; count];
            if let Some(other) = others.first() {
                index[*other] = slice;
            }
            let mut map = Vec::with_capacity(steps * steps);
            for i in 0..steps {
                for j in 0..steps {
                    (index[x], index[y]) = (i, j);
                    map.push(&self.found.map[index.iter().fold(0, |sum, digit| sum * steps + digit)]);
                }
            }
            let value = |factor: &usize| {
                let quantity = Quantity::of_field(&self.factors[*factor].name);
                format!("{} {}", quantity.name, quantity.with_unit(&significant(map[0].values[*factor])))
            };
            let title = if map.is_empty() { Vec::new() } else { others.iter().map(value).collect() };
            Panel { x: &self.factors[x], y: &self.factors[y], steps, map, title: title.join(", ") }
        };
        slices.into_iter().map(panel).collect()
    }

    fn paint(&self, panel: &Panel<'_>, area: &Area<'_>, shades: &Shades) -> Result<()> {
        let mut chart = chart(area, Axis::of_factor(panel.x), Axis::of_factor(panel.y))?;
        if panel.steps > 1 {
            for ((from, to), shade) in panel.cells(shades) {
                chart.draw_series([Rectangle::new([from, to], Shades::colour(shade).filled())])?;
            }
            let level = self.found.level;
            let line = |of: fn(&MapPoint) -> f64| {
                let values: Vec<f64> = panel.map.iter().map(|point| of(point) - level).collect();
                let place = |(x, y): (f64, f64)| (panel.x.place(x), panel.y.place(y));
                let lines = contour::lines(&values, panel.steps);
                lines
                    .into_iter()
                    .map(|line| line.into_iter().map(place).collect::<Vec<_>>())
                    .collect::<Vec<_>>()
            };
            for boundary in line(|point| point.estimate) {
                chart.draw_series(LineSeries::new(boundary, BLACK.stroke_width(3)))?;
            }
            let (dash, gap) = DASHES[1].unwrap_or((9, 5));
            for edge in line(|point| point.low).into_iter().chain(line(|point| point.high)) {
                chart.draw_series(DashedLineSeries::new(edge, dash, gap, BLACK.stroke_width(1)))?;
            }
        }
        if self.factors.len() == 2 {
            for point in &self.found.observed {
                let (at, radius) = ((point.values[0], point.values[1]), legend::radius(point.estimated.n));
                chart.draw_series([Circle::new(at, radius, BLACK.mix(0.3).filled())])?;
                chart.draw_series([Circle::new(at, radius, BLACK.stroke_width(1))])?;
            }
        }
        if !panel.title.is_empty() {
            area.draw(&Text::new(panel.title.clone(), (84, 18), (FONT, 14)))?;
        }
        Ok(())
    }

    fn legend(&self, area: &Area<'_>, shades: &Shades) -> Result<()> {
        let is_map = self.factors.len() == 2;
        let label = format!("{}, by the model", measure_label(self.of));
        let mut y = legend::draw(area, 20, &[(Glyph::None, label)])? + 6;
        let (width, height) = BAR;
        for shade in -SHADES + 1..=SHADES {
            // From the top down; shade 0 is the level alone and has no part of the bar.
            let row = SHADES - shade;
            let top = y + row * height / (2 * SHADES);
            let below = y + (row + 1) * height / (2 * SHADES);
            let shade = if shade > 0 { shade } else { shade - 1 };
            let colour = Shades::colour(shade).filled();
            area.draw(&Rectangle::new([(4, top), (4 + width, below)], colour))?;
        }
        for (value, at) in [(shades.high, y), (shades.level, y + height / 2), (shades.low, y + height)] {
            let text = measure_value(self.of, value);
            area.draw(&PathElement::new([(4, at), (4 + width, at)], BLACK.stroke_width(1)))?;
            area.draw(&Text::new(text, (38, at - 6), (FONT, 13)))?;
        }
        y += height + 22;
        let mut rows = vec![
            (
                Glyph::Line(BLACK.stroke_width(3)),
                format!("boundary, {}", measure_value(self.of, self.found.level)),
            ),
            (
                Glyph::Dashes(BLACK.stroke_width(1)),
                "its band: all of it is inside with 95 % confidence".to_owned(),
            ),
        ];
        if is_map {
            let runs = self.found.observed.iter().map(|point| point.estimated.n);
            rows.extend(legend::sizes(runs, BLACK.mix(0.3).filled()));
        }
        legend::draw(area, y, &rows).map(drop)
    }
}

impl Body for Map<'_> {
    fn height(&self) -> u32 {
        if self.factors.len() == 2 { HEIGHT } else { SLICE_HEIGHT * self.panels().len() as u32 }
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        let (plots, side) = area.split_horizontally(WIDTH - legend::WIDTH);
        let (panels, shades) = (self.panels(), self.shades());
        for (panel, area) in panels.iter().zip(plots.split_evenly((panels.len(), 1))) {
            self.paint(panel, &area, &shades)?;
        }
        self.legend(&side, &shades)
    }
}

type Corner = (f64, f64);

impl Panel<'_> {
    /// Rectangles of one colour, from a bilinear interpolation of the map.
    fn cells(&self, shades: &Shades) -> Vec<((Corner, Corner), i32)> {
        let count = (self.steps - 1) * PARTS;
        let estimate = |i: usize, j: usize| self.map[i * self.steps + j].estimate;
        let shade = |i: usize, j: usize| {
            let part = |index: usize| ((index % PARTS) as f64 + 0.5) / PARTS as f64;
            let (a, b, u, v) = (i / PARTS, j / PARTS, part(i), part(j));
            let along = |j: usize| estimate(a, j) + u * (estimate(a + 1, j) - estimate(a, j));
            shades.shade(along(b) + v * (along(b + 1) - along(b)))
        };
        let x = |index: usize| self.x.place(index as f64 / count as f64);
        let y = |index: usize| self.y.place(index as f64 / count as f64);
        let mut cells = Vec::new();
        for i in 0..count {
            // Neighbours of one colour are one rectangle.
            let mut from = 0;
            for j in 1..=count {
                if j == count || shade(i, j) != shade(i, from) {
                    cells.push((((x(i), y(from)), (x(i + 1), y(j))), shade(i, from)));
                    from = j;
                }
            }
        }
        cells
    }
}

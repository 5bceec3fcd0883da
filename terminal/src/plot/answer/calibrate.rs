//! A calibration: samples of the parameters in pairs, and simulated against measured numbers and curves.

use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use roost_api::quantity::Quantity;
use roost_design::goals::CalibrateAnswer;
use roost_design::goals::calibrate::TargetAgreement;
use roost_design::{Factor, Scale};

use super::axis::{Axis, AxisRange, chart_with, measure_value, spread};
use super::legend::{self, Glyph};
use super::measured_curve::{self, MeasuredCurve};
use super::{Area, BLUE, Body, ORANGE};
use crate::plot::{FONT, WIDTH};

/// Largest side of a panel of the samples, in pixels.
const MAX_SIDE: u32 = 270;
const ROW_HEIGHT: u32 = 44;
/// Height of the comparison beside its rows.
const FRAME_HEIGHT: u32 = 84;
/// Width of the names of rows, in pixels.
const NAMES_WIDTH: u32 = 330;
/// Maximum number of numbers along an axis of the samples.
const LABELS: usize = 4;
/// Number of columns of a histogram.
const COLUMNS: usize = 24;

/// A calibration.
pub(super) struct Calibration<'a> {
    pub(super) factors: &'a [Factor],
    pub(super) found: &'a CalibrateAnswer,
}

impl Calibration<'_> {
    fn side(&self) -> u32 {
        (WIDTH / self.factors.len().max(1) as u32).min(MAX_SIDE)
    }

    /// The samples of a parameter.
    fn samples(&self, parameter: usize) -> impl Iterator<Item = f64> + '_ {
        self.found.samples.iter().filter_map(move |sample| sample.get(parameter).copied())
    }

    /// The range of the samples of a parameter, on the scale of its factor.
    fn axis(&self, parameter: usize) -> Axis {
        let factor = &self.factors[parameter];
        let label = Quantity::of_field(&factor.name).label();
        let range = match factor.scale {
            Scale::Linear => AxisRange::Linear(spread(self.samples(parameter)).into()),
            Scale::Log => {
                let logs = spread(self.samples(parameter).map(f64::ln));
                AxisRange::Log(logs.start.exp()..logs.end.exp())
            }
        };
        Axis { label, range }
    }

    /// The place of a value between the ends of an axis, from 0 to 1.
    fn share(&self, parameter: usize, axis: &AxisRange, value: f64) -> f64 {
        let ends = plotters::coord::ranged1d::Ranged::range(axis);
        match self.factors[parameter].scale {
            Scale::Linear => (value - ends.start) / (ends.end - ends.start),
            Scale::Log => (value / ends.start).ln() / (ends.end / ends.start).ln(),
        }
    }

    /// Parameters in pairs: histograms on the diagonal, samples below it.
    fn draw_samples(&self, area: &Area<'_>) -> Result<()> {
        let count = self.factors.len();
        for row in 0..count {
            for column in 0..=row {
                let side = self.side() as i32;
                let (left, top) = (column as i32 * side, row as i32 * side);
                let panel = area.clone().shrink((left, top), (side, side));
                if row == column {
                    self.draw_histogram(&panel, row)?;
                } else {
                    let mut chart = chart_with(&panel, self.axis(column), self.axis(row), LABELS)?;
                    let pairs = self.samples(column).zip(self.samples(row));
                    chart.draw_series(pairs.map(|at| Circle::new(at, 2, BLUE.mix(0.25).filled())))?;
                    let best = (self.found.parameters[column].best, self.found.parameters[row].best);
                    chart.draw_series([Cross::new(best, 5, ORANGE.stroke_width(2))])?;
                }
            }
        }
        Ok(())
    }

    fn draw_histogram(&self, panel: &Area<'_>, parameter: usize) -> Result<()> {
        let axis = self.axis(parameter);
        let mut columns = [0.0; COLUMNS];
        for value in self.samples(parameter) {
            let share = self.share(parameter, &axis.range, value);
            columns[((share * COLUMNS as f64) as usize).min(COLUMNS - 1)] += 1.0;
        }
        let highest = columns.iter().copied().fold(1.0, f64::max);
        let ends = plotters::coord::ranged1d::Ranged::range(&axis.range);
        let scale = self.factors[parameter].scale;
        let at = |column: usize| {
            let share = column as f64 / COLUMNS as f64;
            match scale {
                Scale::Linear => ends.start + share * (ends.end - ends.start),
                Scale::Log => ends.start * (ends.end / ends.start).powf(share),
            }
        };
        let height =
            Axis { label: "samples".to_owned(), range: AxisRange::Linear((0.0..1.08 * highest).into()) };
        let mut chart = chart_with(panel, axis, height, LABELS)?;
        let bars = columns.iter().enumerate().map(|(column, count)| {
            Rectangle::new([(at(column), 0.0), (at(column + 1), *count)], BLUE.mix(0.5).filled())
        });
        chart.draw_series(bars)?;
        let found = &self.found.parameters[parameter];
        let line = |value: f64| PathElement::new([(value, 0.0), (value, 1.08 * highest)], BLACK.mix(0.5));
        chart.draw_series([line(found.estimate.low), line(found.estimate.high)])?;
        chart.draw_series([Cross::new((found.best, 0.03 * highest), 5, ORANGE.stroke_width(2))])?;
        Ok(())
    }

    /// The numbers that can be drawn relative to their measured means.
    fn compared(&self) -> Vec<&TargetAgreement> {
        let is_drawn = |of: &&TargetAgreement| {
            of.simulated.is_some() && of.target.mean != 0.0 && of.target.curve.is_none()
        };
        self.found.targets.iter().filter(is_drawn).collect()
    }

    fn comparison_height(&self) -> u32 {
        match self.compared().len() as u32 {
            0 => 0,
            rows => FRAME_HEIGHT + ROW_HEIGHT * rows,
        }
    }

    /// Simulated and measured means, relative to the measured ones.
    fn draw_comparison(&self, area: &Area<'_>) -> Result<()> {
        let compared = self.compared();
        let relative = |of: &TargetAgreement, value: f64| value / of.target.mean;
        let measured = |of: &TargetAgreement| {
            let width = 2.0 * of.target.deviation / (of.target.n as f64).sqrt() / of.target.mean.abs();
            (1.0 - width, 1.0 + width)
        };
        let simulated = |of: &TargetAgreement| {
            let found = of.simulated.expect("targets without it are left out");
            [found.mean, found.low, found.high].map(|value| relative(of, value))
        };
        let ends = compared.iter().flat_map(|of| {
            let (low, high) = measured(of);
            [low, high].into_iter().chain(simulated(of))
        });
        let range = spread(ends);
        let (names, plot) = area.split_horizontally(NAMES_WIDTH);
        let label = "relative to the measured mean".to_owned();
        let x = Axis { label, range: AxisRange::Linear(range.into()) };
        let rows = compared.len() as f64;
        let mut builder = ChartBuilder::on(&plot);
        builder.margin(12).x_label_area_size(44);
        let mut chart = builder.build_cartesian_2d(x.range, AxisRange::Linear((0.0..rows).into()))?;
        let mut mesh = chart.configure_mesh();
        mesh.disable_y_axis().disable_y_mesh().x_desc(x.label).axis_desc_style((FONT, 15));
        mesh.label_style((FONT, 13)).light_line_style(TRANSPARENT).bold_line_style(BLACK.mix(0.12)).draw()?;
        let anchor = Pos::new(HPos::Right, VPos::Center);
        let (_, height) = plot.dim_in_pixel();
        let row_height = (height as f64 - 68.0) / rows;
        for (index, of) in compared.iter().enumerate() {
            let y = rows - index as f64 - 0.5;
            let (low, high) = measured(of);
            let [mean, from, to] = simulated(of);
            let paths = [(low, high, 1.0, y + 0.14, ORANGE, 6), (from, to, mean, y - 0.14, BLUE, 5)];
            for (low, high, mean, y, colour, radius) in paths {
                chart.draw_series([PathElement::new([(low, y), (high, y)], colour.stroke_width(3))])?;
                chart.draw_series([Circle::new((mean, y), radius, colour.filled())])?;
            }
            let middle = (12.0 + row_height * (index as f64 + 0.5)) as i32;
            let right = NAMES_WIDTH as i32 - 8;
            let style = TextStyle::from((FONT, 13)).pos(anchor);
            let name = format!("{}: {}", of.target.test, Quantity::of_response(of.target.of.response()).name);
            names.draw(&Text::new(name, (right, middle - 8), style.clone()))?;
            let simulated = of.simulated.map_or(f64::NAN, |found| found.mean);
            let numbers = format!(
                "measured {}, simulated {}",
                measure_value(&of.target.of, of.target.mean),
                measure_value(&of.target.of, simulated)
            );
            names.draw(&Text::new(numbers, (right, middle + 8), style.color(&BLACK.mix(0.6))))?;
        }
        Ok(())
    }
}

impl Body for Calibration<'_> {
    fn height(&self) -> u32 {
        if self.found.parameters.is_empty() {
            return 0;
        }
        let samples = self.side() * self.factors.len() as u32;
        samples + self.comparison_height() + measured_curve::height(&MeasuredCurve::all(self.found))
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        if self.found.parameters.is_empty() {
            return Ok(());
        }
        let samples = self.side() * self.factors.len() as u32;
        let (corner, rest) = area.split_vertically(samples);
        self.draw_samples(&corner)?;
        // The first row has one panel: the place to its right is free.
        let place = ((WIDTH - legend::WIDTH - 20) as i32, 20);
        let legend = corner.shrink(place, (legend::WIDTH, self.side() - 20));
        let rows = [
            (
                Glyph::Dot(4, BLUE.mix(0.5).filled()),
                "samples of the posterior; simulated with them, 95 %".to_owned(),
            ),
            (
                Glyph::Dot(5, ORANGE.filled()),
                "most probable set; measured, mean ± 2 standard errors".to_owned(),
            ),
        ];
        legend::draw(&legend, 0, &rows)?;
        let (numbers, curves) = rest.split_vertically(self.comparison_height());
        if !self.compared().is_empty() {
            self.draw_comparison(&numbers)?;
        }
        measured_curve::draw(&curves, &MeasuredCurve::all(self.found))
    }
}

//! Measured curves, such as stress over strain, with the simulated ones over them.

use anyhow::Result;
use plotters::prelude::*;
use roost_api::quantity::Quantity;
use roost_design::goals::CalibrateAnswer;
use roost_design::goals::calibrate::TargetAgreement;

use super::axis::{Axis, AxisRange, chart_with, spread};
use super::{Area, BLUE, ORANGE};
use crate::plot::{FONT, WIDTH};

const HEIGHT: u32 = 300;
const TITLE_HEIGHT: u32 = 24;
/// Curves side by side.
const COLUMNS: usize = 2;
/// Maximum number of numbers along an axis.
const LABELS: usize = 6;

/// A curve of a test: its points in the order of their places.
pub(super) struct MeasuredCurve<'a> {
    test: &'a str,
    name: &'a str,
    points: Vec<(f64, &'a TargetAgreement)>,
}

impl<'a> MeasuredCurve<'a> {
    /// All curves of a calibration.
    pub(super) fn all(found: &'a CalibrateAnswer) -> Vec<Self> {
        let mut curves: Vec<Self> = Vec::new();
        for of in &found.targets {
            let Some(place) = &of.target.curve else { continue };
            let point = (place.at, of);
            match curves.iter_mut().find(|curve| curve.test == of.target.test && curve.name == place.name) {
                Some(curve) => curve.points.push(point),
                None => curves.push(Self { test: &of.target.test, name: &place.name, points: vec![point] }),
            }
        }
        for curve in &mut curves {
            curve.points.sort_by(|(one, _), (other, _)| one.total_cmp(other));
        }
        curves
    }

    /// Place, measured mean, and two standard errors of it.
    fn measured(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        self.points.iter().map(|(at, of)| {
            let target = &of.target;
            (*at, target.mean, 2.0 * target.deviation / (target.n as f64).sqrt())
        })
    }

    /// Place, simulated mean, and both ends of its interval.
    fn simulated(&self) -> impl DoubleEndedIterator<Item = (f64, [f64; 3])> + '_ {
        self.points.iter().filter_map(|(at, of)| {
            let found = of.simulated?;
            Some((*at, [found.mean, found.low, found.high]))
        })
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        let (title, plot) = area.split_vertically(TITLE_HEIGHT);
        title.draw(&Text::new(self.test.to_owned(), (76, 6), (FONT, 15)))?;
        let (of, along) = self.name.split_once('@').unwrap_or((self.name, ""));
        let ends = self.measured().flat_map(|(_, mean, width)| [mean - width, mean + width]);
        let ends = ends.chain(self.simulated().flat_map(|(_, values)| values));
        let axis = |name: &str, values: std::ops::Range<f64>| Axis {
            label: Quantity::of_axis(name).label(),
            range: AxisRange::Linear(values.into()),
        };
        let x = axis(along, spread(self.points.iter().map(|(at, _)| *at)));
        let mut chart = chart_with(&plot, x, axis(of, spread(ends)), LABELS)?;
        let upper = self.simulated().map(|(at, [_, _, high])| (at, high));
        let lower = self.simulated().rev().map(|(at, [_, low, _])| (at, low));
        chart.draw_series([Polygon::new(upper.chain(lower).collect::<Vec<_>>(), BLUE.mix(0.25).filled())])?;
        let means = self.simulated().map(|(at, [mean, _, _])| (at, mean));
        chart.draw_series([PathElement::new(means.collect::<Vec<_>>(), BLUE.stroke_width(2))])?;
        for (at, mean, width) in self.measured() {
            let bar = [(at, mean - width), (at, mean + width)];
            chart.draw_series([PathElement::new(bar, ORANGE.stroke_width(3))])?;
            chart.draw_series([Circle::new((at, mean), 5, ORANGE.filled())])?;
        }
        Ok(())
    }
}

/// The height of all curves, in pixels.
pub(super) fn height(curves: &[MeasuredCurve<'_>]) -> u32 {
    curves.len().div_ceil(COLUMNS) as u32 * HEIGHT
}

/// Draws the curves in rows.
pub(super) fn draw(area: &Area<'_>, curves: &[MeasuredCurve<'_>]) -> Result<()> {
    let width = WIDTH / COLUMNS as u32;
    for (index, curve) in curves.iter().enumerate() {
        let place = ((index % COLUMNS) as i32 * width as i32, (index / COLUMNS) as i32 * HEIGHT as i32);
        curve.draw(&area.clone().shrink(place, (width, HEIGHT)))?;
    }
    Ok(())
}

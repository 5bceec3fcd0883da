//! Rows with intervals: estimates at points, a recommendation, and the sensitivity of measures to factors.

use anyhow::Result;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};
use roost_design::goals::{
    Confirmation, Effects, EstimateAnswer, Optimise, OptimiseAnswer, Recommendation, SensitivityAnswer,
};
use roost_design::intervals::Estimated;
use roost_design::{Factor, Measure};
use serde_json::Value;

use super::axis::{Axis, AxisRange, measure_label, spread, value_words};
use super::legend::{self, Glyph};
use super::{Area, BLUE, Body, GREEN, ORANGE};
use crate::plot::{FONT, WIDTH};
use roost_api::quantity::Quantity;

const ROW_HEIGHT: u32 = 44;
/// Height of a panel beside its rows: axis and margins.
const FRAME_HEIGHT: u32 = 72;
/// Width of the names of rows, in pixels.
const NAMES_WIDTH: i32 = 210;

/// A value with its interval in a row.
#[derive(Clone, Copy)]
struct Mark {
    value: f64,
    ends: Option<(f64, f64)>,
    colour: RGBColor,
    /// Radius of its point, in pixels.
    radius: u32,
}

struct Row {
    name: String,
    marks: Vec<Mark>,
}

#[derive(Default)]
struct Panel {
    label: String,
    rows: Vec<Row>,
    /// Whether values are bars from 0 on.
    has_bars: bool,
    /// Limits across all rows.
    limits: Vec<f64>,
    is_probability: bool,
}

/// Panels one below the other.
#[derive(Default)]
pub(super) struct Panels {
    panels: Vec<Panel>,
    legend: Vec<(Glyph, String)>,
}

/// Values of factors as the name of a row.
fn place(factors: &[Factor], values: &[Value]) -> String {
    let value = |(factor, value): (&Factor, &Value)| match value {
        // A truth value says nothing without its name.
        Value::Bool(_) => format!("{}: {value}", Quantity::of_field(&factor.name).name),
        _ => value_words(factor, value),
    };
    factors.iter().zip(values).map(value).collect::<Vec<_>>().join(", ")
}

fn mark(estimated: &Estimated, colour: RGBColor) -> Mark {
    let ends = estimated.low.zip(estimated.high);
    Mark { value: estimated.value, ends, colour, radius: legend::radius(estimated.n) }
}

impl Panels {
    pub(super) fn of_estimate(factors: &[Factor], found: &EstimateAnswer) -> Self {
        let measures = found.points.first().map_or(&[][..], |point| &point.measures);
        let panel = |(index, measure): (usize, &roost_design::goals::MeasureEstimate)| {
            let row = |point: &roost_design::goals::PointEstimate| {
                let estimated = point.measures.get(index).and_then(|measure| measure.estimated.as_ref());
                let marks = estimated.map(|estimated| mark(estimated, BLUE)).into_iter().collect();
                Row { name: place(factors, &point.values), marks }
            };
            let rows = found.points.iter().map(row).collect();
            Panel { rows, ..Panel::of_measure(&measure.of) }
        };
        let runs = found.points.iter().flat_map(|point| &point.measures);
        let runs = runs.filter_map(|measure| Some(measure.estimated.as_ref()?.n));
        let mut legend = vec![(Glyph::Line(BLUE.stroke_width(2)), "95 % interval".to_owned())];
        legend.extend(legend::sizes(runs, BLUE.filled()));
        Self { panels: measures.iter().enumerate().map(panel).collect(), legend }
    }

    pub(super) fn of_optimise(goal: &Optimise, factors: &[Factor], found: &OptimiseAnswer) -> Self {
        let objectives = goal.objectives.iter().map(|objective| (objective.measure(), None));
        let constraints = goal.constraints.iter();
        let constraints =
            constraints.map(|constraint| (&constraint.of, constraint.at_most.or(constraint.at_least)));
        let of_measure = |(index, (of, limit)): (usize, (&Measure, Option<f64>))| {
            let count = goal.objectives.len();
            let rows = |point: &Recommendation, word: &str| {
                let forecast = match index.checked_sub(count) {
                    None => &point.objectives[index],
                    Some(index) => &point.constraints[index],
                };
                let ends = Some((forecast.low, forecast.high));
                let name = place(factors, &point.values);
                let forecast =
                    Mark { value: forecast.value, ends, colour: BLUE, radius: legend::radius(point.runs) };
                let confirmed = point.confirmation.as_ref().and_then(|found| confirmed(found, index, count));
                Row {
                    name: format!("{word}{name}"),
                    marks: [Some(forecast), confirmed].into_iter().flatten().collect(),
                }
            };
            let recommended = found.recommended.iter().map(|point| rows(point, ""));
            let rejected = found.rejected.iter().map(|point| rows(point, "rejected: "));
            Panel {
                rows: recommended.chain(rejected).collect(),
                limits: limit.into_iter().collect(),
                ..Panel::of_measure(of)
            }
        };
        let mut legend = vec![
            (Glyph::Line(BLUE.stroke_width(2)), "forecast by the model, 95 %".to_owned()),
            (Glyph::Line(GREEN.stroke_width(2)), "confirmation with fresh seeds, 95 %".to_owned()),
        ];
        if !goal.constraints.is_empty() {
            legend.push((Glyph::Line(ORANGE.stroke_width(2)), "limit of the constraint".to_owned()));
        }
        Self { panels: objectives.chain(constraints).enumerate().map(of_measure).collect(), legend }
    }

    pub(super) fn of_sensitivity(found: &SensitivityAnswer) -> Self {
        let (mut panels, mut legend) = (Vec::new(), Vec::new());
        let name = |factor: &str| Quantity::of_field(factor).name;
        for measure in &found.measures {
            let what = measure_label(&measure.of);
            match &measure.effects {
                Some(Effects::Sobol(indices)) => {
                    let rows = indices.iter().map(|index| Row {
                        name: name(&index.factor),
                        marks: vec![bar(&index.first_order, BLUE), bar(&index.total, ORANGE)],
                    });
                    let label = format!("share of the variance of the {what}");
                    panels.push(Panel { label, rows: rows.collect(), has_bars: true, ..Panel::default() });
                    legend = vec![
                        (Glyph::Patch(BLUE.mix(0.6)), "first-order index: the factor alone".to_owned()),
                        (Glyph::Patch(ORANGE.mix(0.6)), "total index: with its interactions".to_owned()),
                    ];
                }
                Some(Effects::Morris(effects)) => {
                    let rows = effects.iter().map(|effect| Row {
                        name: name(&effect.factor),
                        marks: vec![bar(&effect.mu_star, BLUE)],
                    });
                    let floor = effects.iter().find_map(|effect| effect.noise_floor);
                    panels.push(Panel {
                        label: format!("mean absolute effect over the range, {what}"),
                        rows: rows.collect(),
                        has_bars: true,
                        limits: floor.into_iter().collect(),
                        ..Panel::default()
                    });
                    legend = vec![
                        (Glyph::Patch(BLUE.mix(0.6)), "μ*, noise included".to_owned()),
                        (Glyph::Line(ORANGE.stroke_width(2)), "μ* of noise alone".to_owned()),
                    ];
                }
                None => {
                    panels.push(Panel {
                        label: format!("{what}: no variation beyond noise"),
                        ..Panel::default()
                    });
                }
            }
        }
        legend.push((Glyph::Line(BLACK.stroke_width(1)), "95 % interval".to_owned()));
        Self { panels, legend }
    }
}

/// A bar without a point.
fn bar(estimated: &Estimated, colour: RGBColor) -> Mark {
    Mark { radius: 0, ..mark(estimated, colour) }
}

/// The confirmation of a measure: objectives first.
fn confirmed(found: &Confirmation, index: usize, objectives: usize) -> Option<Mark> {
    let Some(constraint) = index.checked_sub(objectives) else {
        return Some(mark(found.objectives.get(index)?.as_ref()?, GREEN));
    };
    let bounds = found.constraints.get(constraint)?.as_ref()?;
    let radius = legend::radius(bounds.n);
    Some(Mark { value: bounds.value, ends: Some((bounds.low, bounds.high)), colour: GREEN, radius })
}

impl Panel {
    fn of_measure(of: &Measure) -> Self {
        let is_probability = matches!(of, Measure::Probability(_));
        Self { label: measure_label(of), is_probability, ..Self::default() }
    }

    fn height(&self) -> u32 {
        FRAME_HEIGHT + ROW_HEIGHT * self.rows.len() as u32
    }

    fn range(&self) -> AxisRange {
        let marks = self.rows.iter().flat_map(|row| &row.marks);
        let ends = marks.flat_map(|mark| {
            let (low, high) = mark.ends.unwrap_or((mark.value, mark.value));
            [mark.value, low, high]
        });
        let zero = self.has_bars.then_some(0.0);
        let range = spread(ends.chain(self.limits.iter().copied()).chain(zero));
        let range = if self.is_probability { 0.0..range.end.min(1.0) } else { range };
        AxisRange::Linear(range.into())
    }

    fn paint(&self, area: &Area<'_>) -> Result<()> {
        let count = self.rows.len() as f64;
        let y = Axis { label: String::new(), range: AxisRange::Linear((0.0..count.max(1.0)).into()) };
        let mut builder = ChartBuilder::on(area);
        builder.margin(12).x_label_area_size(44).y_label_area_size(NAMES_WIDTH);
        let mut chart = builder.build_cartesian_2d(self.range(), y.range)?;
        let mut mesh = chart.configure_mesh();
        mesh.x_desc(self.label.clone())
            .y_labels(0)
            .disable_y_mesh()
            .axis_desc_style((FONT, 15))
            .label_style((FONT, 13))
            .light_line_style(TRANSPARENT)
            .bold_line_style(BLACK.mix(0.12))
            .axis_style(BLACK.mix(0.6))
            .draw()?;
        for (index, row) in self.rows.iter().enumerate() {
            // The first row is the uppermost.
            let middle = count - index as f64 - 0.5;
            let step = 0.8 / row.marks.len().max(1) as f64;
            for (position, mark) in row.marks.iter().enumerate() {
                let at = middle + step * ((row.marks.len() - 1) as f64 / 2.0 - position as f64);
                let line = if self.has_bars { BLACK.stroke_width(1) } else { mark.colour.stroke_width(2) };
                if self.has_bars {
                    let corners = [(0.0, at - 0.4 * step), (mark.value, at + 0.4 * step)];
                    chart.draw_series([Rectangle::new(corners, mark.colour.mix(0.6).filled())])?;
                }
                if let Some((low, high)) = mark.ends {
                    chart.draw_series([PathElement::new([(low, at), (high, at)], line)])?;
                }
                if mark.radius > 0 {
                    chart.draw_series([Circle::new((mark.value, at), mark.radius, mark.colour.filled())])?;
                }
            }
            let (left, height) = chart.plotting_area().map_coordinate(&(self.start(), middle));
            let (corner_x, corner_y) = area.get_base_pixel();
            let style = (FONT, 13).into_font().color(&BLACK).pos(Pos::new(HPos::Right, VPos::Center));
            area.draw(&Text::new(row.name.clone(), (left - corner_x - 10, height - corner_y), style))?;
        }
        for limit in &self.limits {
            let ends = [(*limit, 0.0), (*limit, count)];
            chart.draw_series([PathElement::new(ends, ORANGE.stroke_width(2))])?;
        }
        Ok(())
    }

    /// The left end of the axis.
    fn start(&self) -> f64 {
        plotters::coord::ranged1d::Ranged::range(&self.range()).start
    }
}

impl Body for Panels {
    fn height(&self) -> u32 {
        let panels: u32 = self.panels.iter().map(Panel::height).sum();
        panels.max(if self.panels.is_empty() { 0 } else { 150 })
    }

    fn draw(&self, area: &Area<'_>) -> Result<()> {
        let (mut rest, side) = area.split_horizontally(WIDTH - legend::WIDTH);
        for panel in &self.panels {
            let (top, below) = rest.split_vertically(panel.height());
            panel.paint(&top)?;
            rest = below;
        }
        legend::draw(&side, 20, &self.legend).map(drop)
    }
}

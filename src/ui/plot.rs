//! Plots as SVG: one or more panels, the legend beside the data.

use std::path::Path;

use anyhow::{Context, Result};
use plotters::coord::Shift;
use plotters::prelude::*;

/// Okabe and Ito's palette: told apart by the colour-blind too.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(213, 94, 0),
    RGBColor(0, 158, 115),
    RGBColor(204, 121, 167),
    RGBColor(230, 159, 0),
    RGBColor(86, 180, 233),
    RGBColor(0, 0, 0),
];
/// Dash and gap in pixels; the first is a solid line.
const DASHES: [Option<(i32, i32)>; 3] = [None, Some((9, 5)), Some((2, 4))];
const WIDTH: u32 = 860;
const PANEL_HEIGHT: u32 = 380;
const FONT: &str = "sans-serif";

/// How a curve is told from the others: an index into colours and one into dash patterns; both wrap.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Look {
    pub(crate) colour: usize,
    pub(crate) dash: usize,
}

/// One curve.
#[derive(Clone, Debug)]
pub(crate) struct Curve {
    /// For the legend; a panel whose only curve has none needs no legend.
    pub(crate) label: String,
    pub(crate) look: Look,
    pub(crate) points: Vec<(f64, f64)>,
}

/// One pair of axes.
#[derive(Clone, Debug)]
pub(crate) struct Panel {
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    pub(crate) curves: Vec<Curve>,
}

/// Draws panels above each other into an SVG file.
pub(crate) fn draw(path: &Path, title: &str, panels: &[Panel]) -> Result<()> {
    let height = PANEL_HEIGHT * panels.len() as u32 + 40;
    let root = SVGBackend::new(path, (WIDTH, height)).into_drawing_area();
    paint(&root, title, panels)
        .and_then(|()| Ok(root.present()?))
        .with_context(|| format!("drawing {}", path.display()))
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn paint(root: &Area<'_>, title: &str, panels: &[Panel]) -> Result<()> {
    root.fill(&WHITE)?;
    let below = root.titled(title, (FONT, 20).into_font().color(&BLACK))?;
    let has_legend = panels.iter().flat_map(|panel| &panel.curves).any(|curve| !curve.label.is_empty());
    let longest =
        panels.iter().flat_map(|panel| &panel.curves).map(|curve| curve.label.chars().count()).max();
    let legend_width = if has_legend { 60 + 8 * longest.unwrap_or(0) as u32 } else { 20 };
    let (plots, side) = below.split_horizontally(WIDTH.saturating_sub(legend_width));
    for (area, panel) in plots.split_evenly((panels.len(), 1)).iter().zip(panels) {
        axes(area, panel)?;
    }
    if has_legend {
        legend(&side, &panels[0].curves)?;
    }
    Ok(())
}

fn axes(area: &Area<'_>, panel: &Panel) -> Result<()> {
    let points = || panel.curves.iter().flat_map(|curve| &curve.points);
    let span = |values: &mut dyn Iterator<Item = f64>| {
        values
            .filter(|value| value.is_finite())
            .fold((0.0_f64, f64::MIN_POSITIVE), |(low, high), value| (low.min(value), high.max(value)))
    };
    let (t_low, t_high) = span(&mut points().map(|point| point.0));
    let (low, high) = span(&mut points().map(|point| point.1));
    let mut chart = ChartBuilder::on(area)
        .margin(12)
        .x_label_area_size(44)
        .y_label_area_size(64)
        .build_cartesian_2d(t_low..t_high, low..(high + 0.05 * (high - low)))?;
    chart
        .configure_mesh()
        .x_desc(panel.x_label.as_str())
        .y_desc(panel.y_label.as_str())
        .axis_desc_style((FONT, 15))
        .label_style((FONT, 13))
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .axis_style(BLACK.mix(0.6))
        .draw()?;
    for curve in &panel.curves {
        let points = || curve.points.iter().copied().filter(|point| point.1.is_finite());
        let stroke = stroke(curve.look);
        match DASHES[curve.look.dash % DASHES.len()] {
            None => chart.draw_series(LineSeries::new(points(), stroke))?,
            Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(points(), dash, gap, stroke))?,
        };
    }
    Ok(())
}

fn legend(area: &Area<'_>, curves: &[Curve]) -> Result<()> {
    for (row, curve) in curves.iter().enumerate() {
        let y = 30 + 22 * row as i32;
        let stroke = stroke(curve.look);
        match DASHES[curve.look.dash % DASHES.len()] {
            None => area.draw(&PathElement::new([(0, y), (34, y)], stroke))?,
            Some((dash, gap)) => {
                for x in (0..34).step_by((dash + gap) as usize) {
                    area.draw(&PathElement::new([(x, y), ((x + dash).min(34), y)], stroke))?;
                }
            }
        }
        area.draw(&Text::new(curve.label.clone(), (42, y - 6), (FONT, 14)))?;
    }
    Ok(())
}

fn stroke(look: Look) -> ShapeStyle {
    COLOURS[look.colour % COLOURS.len()].stroke_width(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(label: &str, look: Look, rate: f64) -> Curve {
        let points = (0..300).map(|i| i as f64 * 0.02).map(|t| (t, 9.5 * (1.0 - (-rate * t).exp())));
        Curve { label: label.to_owned(), look, points: points.collect() }
    }

    /// Draws to a folder that `ROOST_KEEP_PLOTS` names, to be looked at; otherwise to one that goes away.
    #[test]
    fn every_curve_and_label_is_in_the_picture() {
        let folder = tempfile::tempdir().unwrap();
        let kept = std::env::var_os("ROOST_KEEP_PLOTS").map(std::path::PathBuf::from);
        let path = kept.as_deref().unwrap_or(folder.path()).join("synthetic.svg");
        let looks = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)];
        let curves: Vec<_> = looks
            .iter()
            .enumerate()
            .map(|(i, &(colour, dash))| {
                curve(&format!("gate {i} m, wet"), Look { colour, dash }, 0.4 + i as f64 * 0.2)
            })
            .collect();
        let panel = |y_label: &str| Panel {
            x_label: "time from belt start (s)".to_owned(),
            y_label: y_label.to_owned(),
            curves: curves.clone(),
        };
        draw(&path, "Discharge of a hopper", &[panel("discharged mass (kg)"), panel("mass rate (kg/s)")])
            .unwrap();
        let svg = std::fs::read_to_string(&path).unwrap();
        for text in
            ["Discharge of a hopper", "time from belt start (s)", "discharged mass (kg)", "gate 4 m, wet"]
        {
            assert!(svg.contains(text), "no `{text}`");
        }
        for colour in ["#0072B2", "#D55E00", "#009E73"] {
            assert!(svg.contains(colour), "no curve in {colour}");
        }
    }

    #[test]
    fn empty_and_flat_curves_draw_too() {
        let folder = tempfile::tempdir().unwrap();
        for points in
            [vec![], vec![(0.0, 0.0)], vec![(0.0, 0.0), (1.0, 0.0)], vec![(0.0, f64::NAN), (1.0, 2.0)]]
        {
            let curve = Curve { label: String::new(), look: Look::default(), points };
            let panel = Panel { x_label: "x".to_owned(), y_label: "y".to_owned(), curves: vec![curve] };
            draw(&folder.path().join("flat.svg"), "flat", &[panel]).unwrap();
        }
    }
}

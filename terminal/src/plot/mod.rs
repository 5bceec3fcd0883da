//! Plots as SVG: panels one above the other, and a legend beside them. Answers of studies have pictures of their own (`answer`).

mod answer;

use std::path::Path;

use anyhow::{Context, Result};
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use crate::format::significant;

pub use answer::answer_svg;

/// Okabe and Ito's palette, which colour-blind readers can distinguish.
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

/// Colour and dash pattern of a curve, as indices that wrap around.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Style {
    /// Index of the colour.
    pub colour: usize,
    /// Index of the dash pattern; 0 is a solid line.
    pub dash: usize,
}

/// Whether a curve has markers at its points.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Markers {
    /// A line without markers.
    #[default]
    None,
    /// A line with markers.
    WithLine,
    /// Markers without a line.
    Only,
}

/// One curve.
#[derive(Clone, Debug, Default)]
pub struct Curve {
    /// Text in the legend; a curve without one is not in the legend.
    pub label: String,
    /// Colour and dash pattern.
    pub style: Style,
    /// Markers at the points.
    pub markers: Markers,
    /// The points; those that are not finite are left out.
    pub points: Vec<(f64, f64)>,
    /// Half heights of the error bars, one per point; empty for no error bars.
    pub error_bars: Vec<f64>,
}

/// The scale of an x axis.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Scale {
    /// Linear, with zero.
    #[default]
    Linear,
    /// Logarithmic, over the range of the data.
    Log,
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub struct Panel {
    /// Label of the x axis.
    pub x_label: String,
    /// Label of the y axis.
    pub y_label: String,
    /// Scale of the x axis.
    pub x_scale: Scale,
    /// Start of the y axis; none means zero.
    pub y_start: Option<f64>,
    /// The curves.
    pub curves: Vec<Curve>,
}

/// Writes an SVG file with panels one above the other.
///
/// # Errors
/// If the file cannot be written.
pub fn write_svg(path: &Path, title: &str, panels: &[Panel]) -> Result<()> {
    let drawn = svg(title, panels)?;
    std::fs::write(path, drawn).with_context(|| format!("cannot write {}", path.display()))
}

/// An SVG document with panels one above the other; an empty title takes no space.
///
/// # Errors
/// If the plot cannot be drawn.
pub fn svg(title: &str, panels: &[Panel]) -> Result<String> {
    let head = if title.is_empty() { 0 } else { 40 };
    let height = PANEL_HEIGHT * panels.len() as u32 + head;
    let mut drawn = String::new();
    let root = SVGBackend::with_string(&mut drawn, (WIDTH, height)).into_drawing_area();
    paint(&root, title, panels).and_then(|()| Ok(root.present()?)).context("drawing a plot")?;
    drop(root);
    Ok(drawn)
}

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

fn paint(root: &Area<'_>, title: &str, panels: &[Panel]) -> Result<()> {
    root.fill(&WHITE)?;
    let below = match title {
        "" => root.clone(),
        title => root.titled(title, (FONT, 20).into_font().color(&BLACK))?,
    };
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
    let span = |values: &mut dyn Iterator<Item = f64>, from: Option<f64>| {
        let start = from.map_or((0.0, f64::MIN_POSITIVE), |from| (from, from + f64::MIN_POSITIVE));
        values
            .filter(|value| value.is_finite())
            .fold(start, |(low, high), value| (low.min(value), high.max(value)))
    };
    let tops = panel.curves.iter().flat_map(|curve| {
        let bars = curve.error_bars.iter().copied().chain(std::iter::repeat(0.0));
        curve.points.iter().zip(bars).flat_map(|(point, bar)| [point.1 - bar, point.1 + bar])
    });
    let (low, high) = span(&mut tops.into_iter(), panel.y_start);
    let y = low..(high + 0.05 * (high - low));
    let mut builder = ChartBuilder::on(area);
    builder.margin(12).x_label_area_size(44).y_label_area_size(64);
    match panel.x_scale {
        Scale::Linear => {
            let (from, to) = span(&mut points().map(|point| point.0), None);
            curves(builder.build_cartesian_2d(from..to, y)?, panel, |x| x > f64::NEG_INFINITY)
        }
        Scale::Log => {
            let mut known = points().map(|point| point.0).filter(|x| *x > 0.0).collect::<Vec<_>>();
            known.sort_by(f64::total_cmp);
            let from = known.first().map_or(1.0, |x| x / 1.25);
            let to = known.last().map_or(10.0, |x| x * 1.25);
            curves(builder.build_cartesian_2d((from..to).log_scale(), y)?, panel, |x| x > 0.0)
        }
    }
}

type Chart<'a, 'b, X> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<X, RangedCoordf64>>;

/// A label on a logarithmic axis, such as `0.5`, `10` or `1e5`.
fn power(value: &f64) -> String {
    if (1e-3..1e4).contains(value) { significant(*value) } else { format!("{value:e}") }
}

/// Draws the grid of a chart, and the points of its curves whose x is on the axis.
fn curves<X>(mut chart: Chart<'_, '_, X>, panel: &Panel, is_on_axis: impl Fn(f64) -> bool) -> Result<()>
where
    X: Ranged<ValueType = f64> + ValueFormatter<f64>,
{
    let mut mesh = chart.configure_mesh();
    if panel.x_scale == Scale::Log {
        mesh.x_label_formatter(&power);
    }
    mesh.x_desc(panel.x_label.as_str())
        .y_desc(panel.y_label.as_str())
        .axis_desc_style((FONT, 15))
        .label_style((FONT, 13))
        .light_line_style(TRANSPARENT)
        .bold_line_style(BLACK.mix(0.12))
        .axis_style(BLACK.mix(0.6))
        .draw()?;
    for curve in &panel.curves {
        let points =
            || curve.points.iter().copied().filter(|point| point.1.is_finite() && is_on_axis(point.0));
        let stroke = stroke(curve.style);
        if curve.markers != Markers::Only {
            match DASHES[curve.style.dash % DASHES.len()] {
                None => chart.draw_series(LineSeries::new(points(), stroke))?,
                Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(points(), dash, gap, stroke))?,
            };
        }
        if curve.markers != Markers::None {
            chart.draw_series(points().map(|point| Circle::new(point, 4, stroke.filled())))?;
        }
        let bars = curve
            .points
            .iter()
            .zip(&curve.error_bars)
            .filter(|(point, bar)| is_on_axis(point.0) && **bar > 0.0);
        chart.draw_series(
            bars.map(|(&(x, y), &bar)| PathElement::new([(x, y - bar), (x, y + bar)], stroke)),
        )?;
    }
    Ok(())
}

fn legend(area: &Area<'_>, curves: &[Curve]) -> Result<()> {
    for (row, curve) in curves.iter().filter(|curve| !curve.label.is_empty()).enumerate() {
        let y = 30 + 22 * row as i32;
        let stroke = stroke(curve.style);
        if curve.markers != Markers::None {
            area.draw(&Circle::new((17, y), 4, stroke.filled()))?;
        }
        match DASHES[curve.style.dash % DASHES.len()] {
            _ if curve.markers == Markers::Only => {}
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

fn stroke(style: Style) -> ShapeStyle {
    COLOURS[style.colour % COLOURS.len()].stroke_width(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn curve(label: &str, style: Style, rate: f64) -> Curve {
        let points = (0..300).map(|i| i as f64 * 0.02).map(|t| (t, 9.5 * (1.0 - (-rate * t).exp())));
        Curve { label: label.to_owned(), style, points: points.collect(), ..Curve::default() }
    }

    /// Writes the plot to the folder in `ROOST_KEEP_PLOTS`, for inspection; without it, to a temporary folder.
    #[test]
    fn plot_has_every_curve_and_label() {
        let folder = tempfile::tempdir().unwrap();
        let inspected = std::env::var_os("ROOST_KEEP_PLOTS").map(std::path::PathBuf::from);
        let path = inspected.as_deref().unwrap_or(folder.path()).join("synthetic.svg");
        let styles = [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)];
        let curves: Vec<_> = styles
            .iter()
            .enumerate()
            .map(|(i, &(colour, dash))| {
                curve(&format!("gate {i} m, wet"), Style { colour, dash }, 0.4 + i as f64 * 0.2)
            })
            .collect();
        let panel = |y_label: &str| Panel {
            x_label: "time from belt start (s)".to_owned(),
            y_label: y_label.to_owned(),
            curves: curves.clone(),
            ..Panel::default()
        };
        write_svg(
            &path,
            "Discharge of a hopper",
            &[panel("discharged mass (kg)"), panel("mass rate (kg/s)")],
        )
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
    fn curves_without_a_label_take_no_space_in_the_legend() {
        let unlabelled = (0..30).map(|_| curve("", Style::default(), 0.5));
        let curves = unlabelled.chain([curve("the last", Style { colour: 1, dash: 0 }, 0.4)]).collect();
        let drawn = svg("", &[Panel { curves, ..Panel::default() }]).unwrap();
        let before = drawn.split("\nthe last\n").next().unwrap();
        let place = before.rsplit(" y=\"").next().unwrap().split('"').next().unwrap();
        assert!(place.parse::<f64>().unwrap() < 60.0, "{place}: not the first in the legend");
    }

    #[test]
    fn empty_and_constant_curves_can_be_drawn() {
        let folder = tempfile::tempdir().unwrap();
        for points in
            [vec![], vec![(0.0, 0.0)], vec![(0.0, 0.0), (1.0, 0.0)], vec![(0.0, f64::NAN), (1.0, 2.0)]]
        {
            let curve = Curve { points, error_bars: vec![0.1], ..Curve::default() };
            for x_scale in [Scale::Linear, Scale::Log] {
                let panel = Panel { x_scale, curves: vec![curve.clone()], ..Panel::default() };
                write_svg(&folder.path().join("flat.svg"), "flat", &[panel]).unwrap();
            }
        }
    }

    /// Centres of the markers in an SVG document.
    fn marker_centres(svg: &str) -> Vec<(f64, f64)> {
        let number = |line: &str, name: &str| -> f64 {
            let rest = line.split(&format!(" {name}=\"")).nth(1).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        let circles = svg.lines().filter(|line| line.starts_with("<circle"));
        circles.map(|line| (number(line, "cx"), number(line, "cy"))).collect()
    }

    #[test]
    fn powers_of_ten_are_equally_spaced_on_a_log_axis() {
        let points = vec![(0.0, 1.0), (1e5, 1.0), (1e6, 1.5), (1e7, 2.0)];
        let curve = Curve { markers: Markers::Only, points, error_bars: vec![0.2; 4], ..Curve::default() };
        let panel = Panel { x_scale: Scale::Log, curves: vec![curve], ..Panel::default() };
        let drawn = svg("", &[panel]).unwrap();
        let centres = marker_centres(&drawn);
        assert_eq!(centres.len(), 3, "zero is not on a log axis");
        assert!((centres[2].0 - 2.0 * centres[1].0 + centres[0].0).abs() <= 2.0, "{centres:?}");
        assert!(centres[0].1 > centres[1].1 && centres[1].1 > centres[2].1, "y points upwards: {centres:?}");
        let bars = drawn.lines().filter(|line| line.contains("<polyline") && line.contains("#0072B2"));
        assert_eq!(bars.count(), 3, "error bars without a line");
        assert!(["1e5", "1e6", "1e7"].iter().all(|label| drawn.contains(&format!("\n{label}\n"))), "{drawn}");
    }
}

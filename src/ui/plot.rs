//! Plots as SVG: one or more panels, the legend beside the data.

use std::path::Path;

use anyhow::{Context, Result};
use plotters::coord::Shift;
use plotters::coord::ranged1d::ValueFormatter;
use plotters::coord::types::RangedCoordf64;
use plotters::prelude::*;

use super::format::significant;

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

/// What stands at the points of a curve.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Mark {
    /// Nothing: a line alone.
    #[default]
    None,
    /// A disc at each point, and a line through them.
    Joined,
    /// A disc at each point, and no line.
    Alone,
}

/// One curve.
#[derive(Clone, Debug, Default)]
pub(crate) struct Curve {
    /// For the legend, which leaves out what has none.
    pub(crate) label: String,
    pub(crate) look: Look,
    pub(crate) mark: Mark,
    pub(crate) points: Vec<(f64, f64)>,
    /// Half heights of the error bars, as many as points; or none at all.
    pub(crate) bars: Vec<f64>,
}

/// How an axis is divided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Scale {
    /// Evenly, zero included.
    #[default]
    Linear,
    /// By powers of ten, as far as the data go.
    Log,
}

/// One pair of axes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Panel {
    pub(crate) x_label: String,
    pub(crate) y_label: String,
    pub(crate) x_scale: Scale,
    /// Where the y axis begins, in place of zero.
    pub(crate) y_from: Option<f64>,
    pub(crate) curves: Vec<Curve>,
}

/// Draws panels above each other into an SVG file.
pub(crate) fn draw(path: &Path, title: &str, panels: &[Panel]) -> Result<()> {
    let drawn = svg(title, panels)?;
    std::fs::write(path, drawn).with_context(|| format!("cannot write {}", path.display()))
}

/// The same as a text; without a title where that is empty.
pub(crate) fn svg(title: &str, panels: &[Panel]) -> Result<String> {
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
        let bars = curve.bars.iter().copied().chain(std::iter::repeat(0.0));
        curve.points.iter().zip(bars).flat_map(|(point, bar)| [point.1 - bar, point.1 + bar])
    });
    let (low, high) = span(&mut tops.into_iter(), panel.y_from);
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

/// `0.5`, `10`, `1e5`: a place on an axis by powers of ten.
fn power(value: &f64) -> String {
    if (1e-3..1e4).contains(value) { significant(*value) } else { format!("{value:e}") }
}

/// The mesh of a chart, and its curves as far as their points are on the chart.
fn curves<X>(mut chart: Chart<'_, '_, X>, panel: &Panel, shows: impl Fn(f64) -> bool) -> Result<()>
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
        let points = || curve.points.iter().copied().filter(|point| point.1.is_finite() && shows(point.0));
        let stroke = stroke(curve.look);
        if curve.mark != Mark::Alone {
            match DASHES[curve.look.dash % DASHES.len()] {
                None => chart.draw_series(LineSeries::new(points(), stroke))?,
                Some((dash, gap)) => chart.draw_series(DashedLineSeries::new(points(), dash, gap, stroke))?,
            };
        }
        if curve.mark != Mark::None {
            chart.draw_series(points().map(|point| Circle::new(point, 4, stroke.filled())))?;
        }
        let bars = curve.points.iter().zip(&curve.bars).filter(|(point, bar)| shows(point.0) && **bar > 0.0);
        chart.draw_series(
            bars.map(|(&(x, y), &bar)| PathElement::new([(x, y - bar), (x, y + bar)], stroke)),
        )?;
    }
    Ok(())
}

fn legend(area: &Area<'_>, curves: &[Curve]) -> Result<()> {
    for (row, curve) in curves.iter().filter(|curve| !curve.label.is_empty()).enumerate() {
        let y = 30 + 22 * row as i32;
        let stroke = stroke(curve.look);
        if curve.mark != Mark::None {
            area.draw(&Circle::new((17, y), 4, stroke.filled()))?;
        }
        match DASHES[curve.look.dash % DASHES.len()] {
            _ if curve.mark == Mark::Alone => {}
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
        Curve { label: label.to_owned(), look, points: points.collect(), ..Curve::default() }
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
            ..Panel::default()
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
    fn what_has_no_label_takes_no_place_in_the_legend() {
        let unnamed = (0..30).map(|_| curve("", Look::default(), 0.5));
        let curves = unnamed.chain([curve("the last", Look { colour: 1, dash: 0 }, 0.4)]).collect();
        let drawn = svg("", &[Panel { curves, ..Panel::default() }]).unwrap();
        let before = drawn.split("\nthe last\n").next().unwrap();
        let place = before.rsplit(" y=\"").next().unwrap().split('"').next().unwrap();
        assert!(place.parse::<f64>().unwrap() < 60.0, "{place}: not the first in the legend");
    }

    #[test]
    fn empty_and_flat_curves_draw_too() {
        let folder = tempfile::tempdir().unwrap();
        for points in
            [vec![], vec![(0.0, 0.0)], vec![(0.0, 0.0), (1.0, 0.0)], vec![(0.0, f64::NAN), (1.0, 2.0)]]
        {
            let curve = Curve { points, bars: vec![0.1], ..Curve::default() };
            for x_scale in [Scale::Linear, Scale::Log] {
                let panel = Panel { x_scale, curves: vec![curve.clone()], ..Panel::default() };
                draw(&folder.path().join("flat.svg"), "flat", &[panel]).unwrap();
            }
        }
    }

    /// The centres of the discs of a picture.
    fn discs(svg: &str) -> Vec<(f64, f64)> {
        let number = |line: &str, name: &str| -> f64 {
            let rest = line.split(&format!(" {name}=\"")).nth(1).unwrap();
            rest.split('"').next().unwrap().parse().unwrap()
        };
        let circles = svg.lines().filter(|line| line.starts_with("<circle"));
        circles.map(|line| (number(line, "cx"), number(line, "cy"))).collect()
    }

    #[test]
    fn powers_of_ten_stand_evenly_on_a_log_axis() {
        let points = vec![(0.0, 1.0), (1e5, 1.0), (1e6, 1.5), (1e7, 2.0)];
        let curve = Curve { mark: Mark::Alone, points, bars: vec![0.2; 4], ..Curve::default() };
        let panel = Panel { x_scale: Scale::Log, curves: vec![curve], ..Panel::default() };
        let drawn = svg("", &[panel]).unwrap();
        let discs = discs(&drawn);
        assert_eq!(discs.len(), 3, "zero has no place there");
        assert!((discs[2].0 - 2.0 * discs[1].0 + discs[0].0).abs() <= 2.0, "{discs:?}");
        assert!(discs[0].1 > discs[1].1 && discs[1].1 > discs[2].1, "upwards: {discs:?}");
        let bars = drawn.lines().filter(|line| line.contains("<polyline") && line.contains("#0072B2"));
        assert_eq!(bars.count(), 3, "error bars and no line");
        assert!(["1e5", "1e6", "1e7"].iter().all(|label| drawn.contains(&format!("\n{label}\n"))), "{drawn}");
    }
}

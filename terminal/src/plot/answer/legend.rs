//! Legends beside a plot.

use anyhow::Result;
use plotters::prelude::*;

use super::{Area, wrapped};
use crate::plot::FONT;

/// Width of a legend, in pixels.
pub(super) const WIDTH: u32 = 200;
/// Letters on a line.
const LETTERS: usize = 21;
const LINE_HEIGHT: i32 = 17;
const TEXT_SIZE: u32 = 13;

/// The sign of a row.
pub(super) enum Glyph {
    Line(ShapeStyle),
    Dashes(ShapeStyle),
    Patch(RGBAColor),
    /// A circle with this radius in pixels.
    Dot(u32, ShapeStyle),
    /// Text alone.
    None,
}

/// Draws rows from a height on, in pixels. Returns the height below them.
pub(super) fn draw(area: &Area<'_>, from: i32, rows: &[(Glyph, String)]) -> Result<i32> {
    let mut y = from;
    for (glyph, text) in rows {
        let middle = y + 7;
        match glyph {
            Glyph::Line(style) => area.draw(&PathElement::new([(0, middle), (30, middle)], *style))?,
            Glyph::Dashes(style) => {
                for x in [0, 12, 24] {
                    area.draw(&PathElement::new([(x, middle), (x + 7, middle)], *style))?;
                }
            }
            Glyph::Patch(colour) => {
                area.draw(&Rectangle::new([(0, middle - 6), (30, middle + 6)], colour.filled()))?;
            }
            Glyph::Dot(radius, style) => area.draw(&Circle::new((15, middle), *radius, *style))?,
            Glyph::None => {}
        }
        for line in wrapped(text, LETTERS) {
            area.draw(&Text::new(line, (38, y), (FONT, TEXT_SIZE)))?;
            y += LINE_HEIGHT;
        }
        y += 6;
    }
    Ok(y)
}

/// Radius of a point with this number of runs, in pixels.
pub(super) fn radius(runs: usize) -> u32 {
    (2.5 + 0.9 * (runs as f64).sqrt()).min(13.0).round() as u32
}

/// A row for the sizes of points with the smallest and the largest number of runs.
pub(super) fn sizes(runs: impl Iterator<Item = usize> + Clone, style: ShapeStyle) -> Vec<(Glyph, String)> {
    let (Some(least), Some(most)) = (runs.clone().min(), runs.max()) else { return Vec::new() };
    let row = |runs: usize| {
        let noun = if runs == 1 { "run" } else { "runs" };
        (Glyph::Dot(radius(runs), style), format!("{runs} {noun} at the point"))
    };
    if least == most { vec![row(least)] } else { vec![row(least), row(most)] }
}

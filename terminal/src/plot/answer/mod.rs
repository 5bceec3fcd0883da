//! The picture of a study's answer: question and answer in words above a plot of the finding.
//!
//! | file | content |
//! |---|---|
//! | `curve` | a boundary or estimates over one factor |
//! | `map`, `contour` | a boundary over two factors, or slices of more |
//! | `rows` | estimates, recommendations and sensitivities as rows with intervals |
//! | `front` | recommendations for two objectives |
//! | `calibrate` | samples of parameters in pairs, and simulated against measured numbers |
//! | `measured_curve` | measured curves with the simulated ones over them |
//! | `axis`, `legend` | parts of all |

mod axis;
mod calibrate;
mod contour;
mod curve;
mod front;
mod legend;
mod map;
mod measured_curve;
mod rows;
#[cfg(test)]
mod tests;

use anyhow::{Context, Result};
use plotters::coord::Shift;
use plotters::prelude::*;
use roost_api::design::{self, Scale as ApiScale};
use roost_api::study::StudyAnswer;
use roost_design::{Answer, Factor, Finding, Goal, Scale};
use roost_solver::scenario::field::FieldKind;
use roost_solver::scenario::fields;

use super::{FONT, WIDTH};

type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

const BLUE: RGBColor = super::COLOURS[0];
const ORANGE: RGBColor = super::COLOURS[1];
const GREEN: RGBColor = super::COLOURS[2];
const MARGIN: i32 = 14;
const TITLE_SIZE: u32 = 20;
const TEXT_SIZE: u32 = 14;
const LINE_HEIGHT: i32 = 19;
/// Letters on a line of the head.
const LETTERS: usize = 112;

/// A drawing below the head of a picture.
trait Body {
    /// Its height in pixels.
    fn height(&self) -> u32;
    fn draw(&self, area: &Area<'_>) -> Result<()>;
}

/// An SVG document with the answer of a study.
///
/// # Errors
/// If goal or answer have another form than this version of Roost writes, or the picture cannot be drawn.
pub fn answer_svg(answer: &StudyAnswer) -> Result<String> {
    let found: Option<Answer> =
        serde_json::from_value(answer.answer.clone()).context("reading the answer of a study")?;
    let factors: Vec<Factor> = answer.factors.iter().map(factor).collect();
    let finding = found.as_ref().map(|found| &found.finding);
    // The goal of a calibration has measurements, which its picture does not need.
    let goal: Option<Goal> = match finding {
        Some(Finding::Calibrate(_)) => None,
        _ => Some(serde_json::from_value(answer.goal.clone()).context("reading the goal of a study")?),
    };
    let body = finding.map(|finding| body(goal.as_ref(), &factors, finding));
    let head = head(answer);
    let top = MARGIN + TITLE_SIZE as i32 + 8 + LINE_HEIGHT * head.len() as i32;
    let height = top as u32 + 10 + body.as_ref().map_or(0, |body| body.height());
    let mut drawn = String::new();
    let root = SVGBackend::with_string(&mut drawn, (WIDTH, height)).into_drawing_area();
    let paint = || -> Result<()> {
        root.fill(&WHITE)?;
        root.draw(&Text::new(answer.study.name.clone(), (MARGIN, MARGIN), (FONT, TITLE_SIZE)))?;
        let mut y = MARGIN + TITLE_SIZE as i32 + 8;
        for line in head {
            root.draw(&Text::new(line, (MARGIN, y), (FONT, TEXT_SIZE)))?;
            y += LINE_HEIGHT;
        }
        if let Some(body) = &body {
            let (_, area) = root.split_vertically(top + 10);
            body.draw(&area)?;
        }
        Ok(root.present()?)
    };
    paint().context("drawing an answer")?;
    drop(root);
    Ok(drawn)
}

fn body<'a>(goal: Option<&'a Goal>, factors: &'a [Factor], finding: &'a Finding) -> Box<dyn Body + 'a> {
    match (goal, finding) {
        (Some(Goal::Boundary(goal)), Finding::Boundary(found)) => match factors {
            [factor] => Box::new(curve::Curve::of_boundary(factor, &goal.of, found)),
            factors => Box::new(map::Map { of: &goal.of, factors, found }),
        },
        (_, Finding::Estimate(found)) => match factors {
            [factor] => Box::new(curve::Curves::of_estimate(factor, found)),
            factors => Box::new(rows::Panels::of_estimate(factors, found)),
        },
        (Some(Goal::Optimise(goal)), Finding::Optimise(found)) if goal.objectives.len() == 2 => {
            Box::new(front::Front { goal, factors, found })
        }
        (Some(Goal::Optimise(goal)), Finding::Optimise(found)) => {
            Box::new(rows::Panels::of_optimise(goal, factors, found))
        }
        (_, Finding::Sensitivity(found)) => Box::new(rows::Panels::of_sensitivity(found)),
        (_, Finding::Calibrate(found)) => Box::new(calibrate::Calibration { factors, found }),
        // Another goal than that of the finding: the head alone.
        _ => Box::new(rows::Panels::default()),
    }
}

/// Lines of the head: the question, the first sentence of the answer, and the number of runs.
fn head(answer: &StudyAnswer) -> Vec<String> {
    let mut lines = wrapped(&answer.study.question, LETTERS);
    let sentence = answer.study.answer.first().map_or("No run has a result yet.", String::as_str);
    lines.extend(wrapped(sentence, LETTERS));
    let runs = answer.study.runs;
    lines.push(format!("{} of {} runs, {} points", runs.done, runs.max_runs, answer.study.points));
    lines
}

fn factor(factor: &design::Factor) -> Factor {
    let name = factor.name().to_owned();
    if let Some(levels) = &factor.levels {
        return Factor::of_levels(name, levels.clone());
    }
    let kind = |pointer: &str| fields::find(pointer).map(|field| field.kind);
    let is_whole = |kind| matches!(kind, FieldKind::Integer(_) | FieldKind::NullableInteger(_));
    Factor {
        scale: match factor.scale {
            Some(ApiScale::Log) => Scale::Log,
            _ => Scale::Linear,
        },
        is_whole: factor.fields().into_iter().filter_map(kind).any(is_whole),
        ..Factor::range(name, factor.low.unwrap_or(0.0), factor.high.unwrap_or(1.0))
    }
}

/// Breaks a text into lines of at most so many letters, at spaces.
fn wrapped(text: &str, letters: usize) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_whitespace() {
        match lines.last_mut() {
            Some(line) if line.chars().count() + 1 + word.chars().count() <= letters => {
                line.push(' ');
                line.push_str(word);
            }
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

//! Measured curves: points or CSV text, checked point by point, and the line of the experiment that they belong to.

use roost_api::Fault;
use roost_api::measurements::{MeasuredCurve, MeasuredPoint};
use roost_solver::experiments::{Outputs, definition};
use roost_solver::observable::{Line, Observable, lines};
use roost_solver::scenario::{Experiment, Scenario};
use serde_json::{Value, json};

use super::replicates::{ReplicateStatistics, checked_deviation};
use super::{SMALLER, Target, too_large, unit_conversion};
use crate::document::{MAX_FAULTS, fault};

/// Maximum number of points of a curve.
const MAX_POINTS: usize = 1000;
/// Maximum number of characters that a fault shows of a line.
const MAX_SHOWN: usize = 100;
const LINE_BREAKS: [char; 2] = ['\r', '\n'];
/// Columns of a table.
const COLUMNS: [&str; 4] = ["x", "mean", "deviation", "n"];

/// A point with its place in the document.
struct Point {
    place: Place,
    point: MeasuredPoint,
}

/// Where a point stands.
#[derive(Clone, Copy)]
enum Place {
    /// In `points`, by index.
    Item(usize),
    /// In `table`, by line from 1.
    Line(u64),
}

impl Place {
    /// The fault of a number of the point.
    fn fault(self, at: &str, name: &str, value: Value, detail: &str, allowed: &str) -> Fault {
        match self {
            Self::Item(index) => fault(&format!("{at}/points/{index}/{name}"), value, detail, allowed),
            Self::Line(line) => fault(
                &format!("{at}/table"),
                value,
                &format!("line {line}, column `{name}`: {detail}"),
                allowed,
            ),
        }
    }
}

/// The targets of a curve, one for each point, or its first faults.
pub(super) fn read(
    at: &str,
    curve: &MeasuredCurve,
    scenario: &Scenario,
    outputs: &'static Outputs,
    faults: &mut Vec<Fault>,
) -> Vec<Target> {
    let mut found = Vec::new();
    let targets = read_all(at, curve, scenario, outputs, &mut found);
    found.truncate(MAX_FAULTS);
    faults.extend(found);
    targets
}

fn read_all(
    at: &str,
    curve: &MeasuredCurve,
    scenario: &Scenario,
    outputs: &'static Outputs,
    faults: &mut Vec<Fault>,
) -> Vec<Target> {
    let points = points(at, curve, faults);
    if faults.is_empty() && (points.is_empty() || points.len() > MAX_POINTS) {
        // The rest of a longer table was not read.
        let (pointer, number) = match curve.table {
            Some(_) if points.len() > MAX_POINTS => ("table", json!(format!("more than {MAX_POINTS}"))),
            Some(_) => ("table", json!(0)),
            None => ("points", json!(points.len())),
        };
        let allowed = format!("1 to {MAX_POINTS}");
        faults.push(fault(&format!("{at}/{pointer}"), number, "unsuitable number of points", &allowed));
    }
    let replicates: Vec<_> = points.iter().map(|point| replicates(at, point, faults)).collect();
    for pair in points.windows(2) {
        let (x, previous) = (pair[1].point.x, pair[0].point.x);
        if x.is_nan() || x <= previous {
            let detail = format!("the curve goes back: the point before is at {previous}");
            faults.push(pair[1].place.fault(at, "x", json!(x), &detail, &format!("more than {previous}")));
        }
    }
    let Some(line) = line(at, curve, outputs, faults) else { return Vec::new() };
    let x_unit = unit_conversion(&format!("{at}/x_unit"), curve.x_unit.as_deref(), line.along.unit, faults);
    let y_unit = unit_conversion(&format!("{at}/y_unit"), curve.y_unit.as_deref(), line.of.unit, faults);
    let (Some(x_unit), Some(y_unit)) = (x_unit, y_unit) else { return Vec::new() };
    let reach = reach(&line, scenario);
    let mut targets = Vec::new();
    for (point, replicates) in points.iter().zip(replicates) {
        let x = x_unit.of(point.point.x);
        if let Some((detail, allowed)) = x_fault(x, &line, reach) {
            faults.push(point.place.fault(at, "x", json!(point.point.x), &detail, &allowed));
            continue;
        }
        let Some(replicates) = replicates else { continue };
        let converted = replicates.converted(y_unit);
        if let Some(name) = converted.overflow() {
            let written = if name == "mean" { replicates.mean } else { replicates.deviation };
            faults.push(point.place.fault(at, name, json!(written), &too_large(line.of.unit), SMALLER));
            continue;
        }
        let ReplicateStatistics { mean, deviation, n } = converted;
        targets.push(Target { observable: Observable::Point { line, at: x }, mean, deviation, n });
    }
    targets
}

/// Why a place along a line is refused, and what is allowed.
fn x_fault(x: f64, line: &Line, reach: Option<(f64, &str)>) -> Option<(String, String)> {
    if !x.is_finite() {
        return Some((too_large(line.along.unit), SMALLER.to_owned()));
    }
    let (end, field) = reach?;
    let spaced = if line.along.unit.is_empty() { "" } else { " " };
    let end_text = format!("{end}{spaced}{}", line.along.unit);
    if x < 0.0 {
        Some(("the simulated test starts at 0".to_owned(), format!("0 to {end_text}")))
    } else if x > end {
        let detail = format!("the simulated test ends at {end_text}, by `{field}`");
        Some((detail, format!("0 to {end_text}, or another `{field}` in the scenario")))
    } else {
        None
    }
}

fn replicates(at: &str, point: &Point, faults: &mut Vec<Fault>) -> Option<ReplicateStatistics> {
    let &Point { place, point: MeasuredPoint { mean, deviation, n, .. } } = point;
    let report =
        |detail: &str, allowed: &str| place.fault(at, "deviation", json!(deviation), detail, allowed);
    let deviation = checked_deviation(deviation, n.into(), report, faults)?;
    Some(ReplicateStatistics { mean, deviation, n: n.into() })
}

/// The line of the experiment with both quantities of the curve.
fn line(at: &str, curve: &MeasuredCurve, outputs: &'static Outputs, faults: &mut Vec<Fault>) -> Option<Line> {
    let lines = lines(outputs);
    let found = lines.iter().find(|line| line.of.name == curve.y && line.along.name == curve.x);
    if found.is_none() {
        let of_y: Vec<&str> =
            lines.iter().filter(|line| line.of.name == curve.y).map(|line| line.along.name).collect();
        let (name, value, detail, mut allowed) = if of_y.is_empty() {
            let detail = "the experiment has no curve or series of this quantity";
            ("y", &curve.y, detail, lines.iter().map(|line| line.of.name).collect())
        } else {
            ("x", &curve.x, "the experiment does not have the quantity `y` along this one", of_y)
        };
        allowed.sort_unstable();
        allowed.dedup();
        faults.push(fault(&format!("{at}/{name}"), json!(value), detail, &allowed.join(", ")));
    }
    found.copied()
}

/// The last place of a line that a run can reach, and the field that sets it.
fn reach(line: &Line, scenario: &Scenario) -> Option<(f64, &'static str)> {
    match (line.along.name, &scenario.experiment) {
        ("strain", Experiment::Compress { compress }) => Some((compress.max_strain, "/compress/max_strain")),
        ("time", experiment) => {
            let definition = definition(experiment);
            let end_s = definition.duration_s(&scenario.numerics);
            Some((end_s, definition.duration_field(&scenario.numerics).0))
        }
        _ => None,
    }
}

/// The points of a curve.
fn points(at: &str, curve: &MeasuredCurve, faults: &mut Vec<Fault>) -> Vec<Point> {
    match (&curve.points, &curve.table) {
        (Some(points), None) => {
            let point = |(index, point): (usize, &MeasuredPoint)| Point {
                place: Place::Item(index),
                point: point.clone(),
            };
            points.iter().enumerate().map(point).collect()
        }
        (None, Some(table)) => points_of_table(at, table, faults),
        (points, _) => {
            let detail = "the curve has no points, or has them twice";
            let allowed = "either `points` or `table`; on the command line also `file`";
            faults.push(fault(at, json!(points.as_ref().map(Vec::len)), detail, allowed));
            Vec::new()
        }
    }
}

fn points_of_table(at: &str, table: &str, faults: &mut Vec<Fault>) -> Vec<Point> {
    let pointer = format!("{at}/table");
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(table.as_bytes());
    let headings: Vec<String> =
        reader.headers().map(|line| line.iter().map(str::to_owned).collect()).unwrap_or_default();
    // A first line of numbers has no headings: one fault is enough in place of one for each cell and column.
    if !headings.iter().any(|heading| COLUMNS.contains(&heading.as_str())) {
        let detail = "the first line has no headings";
        faults.push(fault(&pointer, json!(headings), detail, "x,mean,deviation,n"));
        return Vec::new();
    }
    for heading in headings.iter().filter(|heading| !COLUMNS.contains(&heading.as_str())).take(MAX_FAULTS) {
        faults.push(fault(&pointer, json!(heading), "unknown column", &COLUMNS.join(", ")));
    }
    for column in COLUMNS {
        match headings.iter().filter(|heading| *heading == column).count() {
            1 => {}
            0 => {
                let detail = format!("the first line has no column `{column}`");
                faults.push(fault(&pointer, json!(headings), &detail, "x,mean,deviation,n"));
            }
            _ => {
                let detail = format!("the column `{column}` is there twice");
                faults.push(fault(&pointer, json!(headings), &detail, "each column once"));
            }
        }
    }
    if !faults.is_empty() {
        return Vec::new();
    }
    let mut points = Vec::new();
    // The line of the byte `counted`, from 1. That of the reader lags behind after `\r\n` and blank lines.
    let (mut line, mut counted) = (1, 0);
    for record in reader.records().take(MAX_POINTS + 1) {
        if faults.len() >= MAX_FAULTS {
            break;
        }
        let position = match &record {
            Ok(record) => record.position(),
            Err(error) => error.position(),
        };
        let byte = position.map_or(counted, |position| position.byte() as usize);
        let rest = table.get(byte..).unwrap_or("").trim_start_matches(LINE_BREAKS);
        let start = table.len() - rest.len();
        line += table.get(counted..start).map_or(0, line_breaks);
        counted = start;
        let record = match record {
            Ok(record) => record,
            Err(error) => {
                let text: String =
                    rest.split(LINE_BREAKS).take(1).flat_map(str::chars).take(MAX_SHOWN).collect();
                let detail = format!("line {line}: {}", unreadable(&error));
                let allowed = "as many cells in each line as in the first";
                faults.push(fault(&pointer, json!(text), &detail, allowed));
                continue;
            }
        };
        let place = Place::Line(line);
        let cell = |name: &str| {
            headings
                .iter()
                .position(|heading| heading == name)
                .and_then(|column| record.get(column))
                .unwrap_or("")
        };
        let mut number = |name: &str| {
            let number = cell(name).parse().ok().filter(|number: &f64| number.is_finite());
            if number.is_none() {
                let allowed = "a number with a decimal point, such as 0.5";
                faults.push(place.fault(at, name, json!(cell(name)), "is no finite number", allowed));
            }
            number
        };
        let (x, mean) = (number("x"), number("mean"));
        let deviation = if cell("deviation").is_empty() { Some(None) } else { number("deviation").map(Some) };
        let n = cell("n").parse().ok().filter(|n: &u32| *n >= 1);
        if n.is_none() {
            let allowed = "a whole number, 1 or more";
            faults.push(place.fault(at, "n", json!(cell("n")), "is no number of replicates", allowed));
        }
        if let (Some(x), Some(mean), Some(deviation), Some(n)) = (x, mean, deviation, n) {
            points.push(Point { place, point: MeasuredPoint { x, mean, deviation, n } });
        }
    }
    points
}

/// The number of line breaks of a text that does not end within one.
fn line_breaks(text: &str) -> u64 {
    (text.matches(LINE_BREAKS).count() - text.matches("\r\n").count()) as u64
}

/// Why a record cannot be read.
fn unreadable(error: &csv::Error) -> String {
    match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} cells in place of {expected_len}")
        }
        _ => error.to_string(),
    }
}

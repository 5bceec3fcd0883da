//! The files of a result: `result.json`, `series.csv`, `curve.svg`.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result};
use roost_api::{RunResult, Series};
use roost_solver::experiments::outputs;
use roost_terminal::BadInput;
use roost_terminal::plot::{self, Curve, Panel};
use serde_json::json;

const FILES: [&str; 3] = ["result.json", "series.csv", "curve.svg"];

/// Creates the folder and checks that the files of a result can be written. Existing files stay unchanged.
pub(crate) fn check_writable(folder: &Path) -> Result<(), BadInput> {
    fs::create_dir_all(folder)
        .map_err(|error| BadInput(format!("cannot create the folder {}: {error}", folder.display())))?;
    for path in FILES.map(|name| folder.join(name)) {
        let is_new = !path.exists();
        let opened = fs::OpenOptions::new().append(true).create(true).open(&path);
        let checked = opened.and_then(|_| if is_new { fs::remove_file(&path) } else { Ok(()) });
        checked.map_err(|error| BadInput(format!("cannot write {}: {error}", path.display())))?;
    }
    Ok(())
}

/// Writes the files of a result into a folder. Returns their paths.
pub(crate) fn write(folder: &Path, result: &RunResult) -> Result<Vec<PathBuf>> {
    let [document, table, plot_file] = FILES.map(|name| folder.join(name));
    let mut json = serde_json::to_vec_pretty(result)?;
    json.push(b'\n');
    fs::write(&document, json).with_context(|| format!("cannot write {}", document.display()))?;
    let file = fs::File::create(&table).with_context(|| format!("cannot write {}", table.display()))?;
    series_csv(file, &result.series)?;
    plot::write_svg(&plot_file, &title(result), &panels(result))?;
    Ok(vec![document, table, plot_file])
}

/// The name of the experiment as a title.
fn title(result: &RunResult) -> String {
    let experiment = json!(result.scenario)["experiment"].as_str().unwrap_or_default().to_owned();
    let mut letters = experiment.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Writes all series as columns beside one column of times. A series without a sample at a time has an empty cell.
pub(crate) fn series_csv(writer: impl Write, series: &[Series]) -> Result<()> {
    let mut times: Vec<f64> = series.iter().flat_map(|series| series.t_s.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    times.dedup();
    let mut csv = csv::Writer::from_writer(writer);
    csv.write_record(["t_s".to_owned()].into_iter().chain(series.iter().map(column_name)))?;
    let mut next = vec![0; series.len()];
    for t in times {
        let cells = series.iter().zip(&mut next).map(|(series, next)| {
            if series.t_s.get(*next) != Some(&t) {
                return String::new();
            }
            *next += 1;
            series.values.get(*next - 1).map_or_else(String::new, f64::to_string)
        });
        // Rounding to nanoseconds removes the rounding errors of summed time steps.
        csv.write_record(
            [((t * 1e9).round() / 1e9).to_string()].into_iter().chain(cells.collect::<Vec<_>>()),
        )?;
    }
    csv.flush()?;
    Ok(())
}

/// The points of a series.
pub(crate) fn points(series: Option<&Series>) -> Vec<(f64, f64)> {
    series.map_or_else(Vec::new, |series| {
        series.t_s.iter().copied().zip(series.values.iter().copied()).collect()
    })
}

/// The name of a series with its unit last.
fn column_name(series: &Series) -> String {
    match series.unit.as_str() {
        "" | "1" => series.name.clone(),
        unit => format!("{}_{}", series.name, unit.to_lowercase().replace('/', "_")),
    }
}

/// Panels of the headline series and curves, in the order of the table of results.
fn panels(result: &RunResult) -> Vec<Panel> {
    let outputs = outputs(&result.scenario.experiment);
    let over_time = outputs.series.iter().filter(|row| row.headline).filter_map(|row| {
        let points = points(Some(result.series(row.name)?));
        Some(panel("time from t = 0 (s)".to_owned(), row.name, row.unit, points))
    });
    let over_else = outputs.curves.iter().filter(|row| row.headline).filter_map(|row| {
        let curve = result.curves.iter().find(|curve| curve.name == row.name)?;
        let points = curve.x.iter().copied().zip(curve.values.iter().copied()).collect();
        Some(panel(label(row.over, row.over_unit), row.name, row.unit, points))
    });
    over_time.chain(over_else).collect()
}

fn panel(x_label: String, name: &str, unit: &str, points: Vec<(f64, f64)>) -> Panel {
    let curve = Curve { points, ..Curve::default() };
    Panel { x_label, y_label: label(name, unit), curves: vec![curve], ..Panel::default() }
}

/// A quantity in words, with its unit.
fn label(name: &str, unit: &str) -> String {
    let words = name.replace('_', " ");
    if unit.is_empty() || unit == "1" { words } else { format!("{words} ({unit})") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn series_with_different_times_share_one_table() {
        let series = |name: &str, unit: &str, t_s: &[f64], values: &[f64]| Series {
            name: name.to_owned(),
            unit: unit.to_owned(),
            t_s: t_s.to_vec(),
            values: values.to_vec(),
        };
        let all = [
            series("mass_rate", "kg/s", &[0.0, 0.5, 1.0], &[0.0, 1.5, 2.5]),
            series("share", "1", &[0.5, 2.0], &[0.25, 1.0]),
        ];
        let mut text = Vec::new();
        series_csv(&mut text, &all).unwrap();
        let expected = "t_s,mass_rate_kg_s,share\n0,0,\n0.5,1.5,0.25\n1,2.5,\n2,,1\n";
        assert_eq!(String::from_utf8(text).unwrap(), expected);
    }
}

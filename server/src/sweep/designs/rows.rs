//! Listed points: rows of values, and CSV files of rows.

use roost_api::Fault;
use roost_solver::scenario::fields;
use serde_json::{Value, json};

use super::planned::PlannedFactor;
use super::{Addition, names};
use crate::document::fault;

/// Faults that are listed of rows: they tend to have the same reason.
const MAX_FAULTS: usize = 10;

/// The headings of a table: its factors.
pub(in crate::sweep) fn headings(table: &str) -> Vec<String> {
    let headings = reader(table).headers().cloned();
    headings.map(|line| line.iter().map(str::to_owned).collect()).unwrap_or_default()
}

/// Reads a CSV file with a column a factor, in any order, into rows in the order of the factors.
pub(super) fn of_table(
    at: &str,
    table: &str,
    factors: &[String],
    faults: &mut Vec<Fault>,
) -> Vec<Vec<Value>> {
    let headings = headings(table);
    let before = faults.len();
    for (column, heading) in headings.iter().enumerate() {
        if !factors.contains(heading) {
            let detail = format!("column {} is no factor", column + 1);
            faults.push(fault(
                at,
                json!(heading),
                &detail,
                &format!("a column for each of {}", factors.join(", ")),
            ));
        } else if headings[..column].contains(heading) {
            let detail = format!("column {} is there already", column + 1);
            faults.push(fault(at, json!(heading), &detail, "one column a factor"));
        }
    }
    for factor in factors.iter().filter(|factor| !headings.contains(factor)) {
        let detail = format!("the first line has no column `{factor}`");
        faults.push(fault(at, json!(headings), &detail, "the factors' names as headings"));
    }
    if faults.len() > before {
        return Vec::new();
    }
    let places: Vec<usize> =
        factors.iter().filter_map(|factor| headings.iter().position(|heading| heading == factor)).collect();
    let mut rows = Vec::new();
    for line in reader(table).records() {
        match line {
            Ok(line) => rows.push(
                places.iter().zip(factors).map(|(place, factor)| cell(&line[*place], factor)).collect(),
            ),
            Err(error) => {
                faults.push(fault(
                    at,
                    json!(table.len()),
                    &error.to_string(),
                    "as many cells in each line as in the first",
                ));
                break;
            }
        }
    }
    rows
}

fn reader(table: &str) -> csv::Reader<&[u8]> {
    csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(table.as_bytes())
}

/// A cell: JSON, else a number as spreadsheets write it, else text. An empty cell is null.
fn cell(text: &str, factor: &str) -> Value {
    use roost_solver::scenario::field::FieldKind;
    if text.is_empty() {
        return Value::Null;
    }
    // A field of text keeps text that looks like a number.
    if matches!(fields::find(factor).map(|field| field.kind), Some(FieldKind::Text | FieldKind::Choice(_))) {
        return json!(text.trim_matches('"'));
    }
    let number = || text.parse::<f64>().ok().filter(|number| number.is_finite()).map(|number| json!(number));
    serde_json::from_str(text).ok().or_else(number).unwrap_or_else(|| json!(text))
}

/// Finds rows with too few or too many values.
pub(super) fn check(at: &str, rows: &[Vec<Value>], factors: usize, faults: &mut Vec<Fault>) {
    if rows.is_empty() {
        faults.push(fault(at, json!([]), "the list has no row", "at least one row"));
    }
    let odd = rows.iter().enumerate().filter(|(_, row)| row.len() != factors);
    for (index, row) in odd.take(MAX_FAULTS) {
        let detail = format!("the row has {} values for {factors} factors", row.len());
        faults.push(fault(&format!("{at}/{index}"), json!(row), &detail, "a value a factor, in their order"));
    }
}

/// Finds rows that repeat an earlier row or an existing point.
pub(super) fn check_repeats(at: &str, rows: &[Vec<Value>], earlier: &[Vec<Value>], faults: &mut Vec<Fault>) {
    let mut seen: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
    for row in earlier {
        seen.entry(key(row)).or_insert(usize::MAX);
    }
    let mut repeats = 0;
    for (index, row) in rows.iter().enumerate() {
        match seen.entry(key(row)) {
            std::collections::hash_map::Entry::Vacant(entry) => drop(entry.insert(index)),
            std::collections::hash_map::Entry::Occupied(entry) if repeats < MAX_FAULTS => {
                let first = match *entry.get() {
                    usize::MAX => "is a point of the sweep already".to_owned(),
                    first => format!("is the same as row {first}"),
                };
                let detail =
                    format!("row {index} {first}; more runs of a point are what `replicates` is for");
                faults.push(fault(at, json!(row), &detail, "every point once"));
                repeats += 1;
            }
            std::collections::hash_map::Entry::Occupied(_) => {}
        }
    }
}

/// Equal for rows of the same values: numbers as numbers, so that 1 and 1.0 are one.
fn key(row: &[Value]) -> String {
    let plain = |value: &Value| match value.as_f64() {
        Some(number) => format!("{number:e}"),
        None => value.to_string(),
    };
    row.iter().map(plain).collect::<Vec<_>>().join("\u{1f}")
}

/// Fields of an extension.
pub(super) const EXTENSION_FIELDS: &[&str] = &["rows", "table"];

/// The rows that an extension adds.
pub(super) fn added(
    factors: &[PlannedFactor],
    addition: &Addition<'_>,
    faults: &mut Vec<Fault>,
) -> Vec<Vec<Value>> {
    let names = names(factors);
    let existing: Vec<Vec<Value>> = addition
        .points
        .iter()
        .map(|point| names.iter().map(|name| point.get(name).cloned().unwrap_or_default()).collect())
        .collect();
    let (at, added) = match (&addition.extension.rows, &addition.extension.table) {
        (Some(_), Some(table)) => {
            faults.push(fault("/table", json!(table.len()), "there are `rows` already", "one of the two"));
            return Vec::new();
        }
        (Some(rows), None) => ("/rows", rows.clone()),
        (None, Some(table)) => ("/table", of_table("/table", table, &names, faults)),
        (None, None) => return Vec::new(),
    };
    if faults.is_empty() {
        check(at, &added, names.len(), faults);
        check_repeats(at, &added, &existing, faults);
    }
    added
}

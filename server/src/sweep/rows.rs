//! Points that are given as rows: lists of values, and CSV files with the same.

use roost_api::Fault;
use roost_solver::scenario::fields;
use serde_json::{Value, json};

use super::levels::same;
use crate::document::fault;

/// The most faults told of rows: they tend to have the same reason.
const MAX_FAULTS: usize = 10;

/// The factors that a table names in its first line.
pub(super) fn headings(table: &str) -> Vec<String> {
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

/// A cell: JSON where it is, a number as spreadsheets write them, else text. Nothing is null.
fn cell(text: &str, factor: &str) -> Value {
    use roost_solver::scenario::field::FieldKind;
    if text.is_empty() {
        return Value::Null;
    }
    // A text that looks like a number stays a text where a text belongs.
    if matches!(fields::find(factor).map(|field| field.kind), Some(FieldKind::Text | FieldKind::Choice(_))) {
        return json!(text.trim_matches('"'));
    }
    let number = || text.parse::<f64>().ok().filter(|number| number.is_finite()).map(|number| json!(number));
    serde_json::from_str(text).ok().or_else(number).unwrap_or_else(|| json!(text))
}

/// Looks for rows that do not fit the factors, or stand there twice.
pub(super) fn check(at: &str, rows: &[Vec<Value>], factors: usize, faults: &mut Vec<Fault>) {
    if rows.is_empty() {
        faults.push(fault(at, json!([]), "there is no row", "at least one row"));
    }
    let odd = rows.iter().enumerate().filter(|(_, row)| row.len() != factors);
    for (index, row) in odd.take(MAX_FAULTS) {
        let detail = format!("the row has {} values for {factors} factors", row.len());
        faults.push(fault(&format!("{at}/{index}"), json!(row), &detail, "a value a factor, in their order"));
    }
}

/// Says which rows repeat an earlier one, or one of the points that are there already.
pub(super) fn repeats(at: &str, rows: &[Vec<Value>], earlier: &[Vec<Value>], faults: &mut Vec<Fault>) {
    let mut seen: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
    for row in earlier {
        seen.entry(key(row)).or_insert(usize::MAX);
    }
    let mut told = 0;
    for (index, row) in rows.iter().enumerate() {
        match seen.entry(key(row)) {
            std::collections::hash_map::Entry::Vacant(entry) => drop(entry.insert(index)),
            std::collections::hash_map::Entry::Occupied(entry) if told < MAX_FAULTS => {
                let first = match *entry.get() {
                    usize::MAX => "is a point of the sweep already".to_owned(),
                    first => format!("is the same as row {first}"),
                };
                let detail =
                    format!("row {index} {first}; more runs of a point are what `replicates` is for");
                faults.push(fault(at, json!(row), &detail, "every point once"));
                told += 1;
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

/// Whether a value is among others.
pub(super) fn place(value: &Value, among: &[Value]) -> Option<usize> {
    among.iter().position(|other| same(other, value))
}

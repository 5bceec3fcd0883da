//! Result tables as columns, for CSV, Parquet and Excel, with a row per trial or per design point.

use roost_api::table::{PointRow, Summary, TrialRow};
use serde_json::{Value, json};

/// A column, with null in rows without a value.
pub(crate) struct Column {
    pub(super) name: String,
    pub(super) kind: ColumnKind,
    pub(super) values: Vec<Value>,
}

/// The type of the values of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ColumnKind {
    Integer,
    Number,
    Flag,
    /// Words, and all other values as JSON.
    Text,
}

impl Column {
    fn new(name: &str, kind: ColumnKind, values: impl Iterator<Item = Value>) -> Self {
        Self { name: name.to_owned(), kind, values: values.collect() }
    }

    /// A column whose type follows from its values. A column without values has numbers.
    fn of(name: &str, values: impl Iterator<Item = Value>) -> Self {
        let values: Vec<Value> = values.collect();
        let all = |is: &dyn Fn(&Value) -> bool| values.iter().all(|value| value.is_null() || is(value));
        let kind = if values.iter().all(Value::is_null) {
            ColumnKind::Number
        } else if all(&Value::is_i64) {
            ColumnKind::Integer
        } else if all(&Value::is_number) {
            ColumnKind::Number
        } else if all(&Value::is_boolean) {
            ColumnKind::Flag
        } else {
            ColumnKind::Text
        };
        Self { name: name.to_owned(), kind, values }
    }

    /// Its name: a pointer of a field, or the name of a response, a statistic or a property of the job.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Its values, one for each row; null where there is none.
    pub(crate) fn values(&self) -> &[Value] {
        &self.values
    }

    /// The same column under another name.
    pub(crate) fn renamed(self, name: String) -> Self {
        Self { name, ..self }
    }

    /// Appends the same column of further rows. The result equals a column of all rows.
    pub(crate) fn extend(&mut self, more: Self) {
        let is_blank = |column: &Self| column.values.iter().all(Value::is_null);
        self.kind = match (self.kind, more.kind) {
            (kind, _) if is_blank(&more) => kind,
            (_, kind) if is_blank(self) => kind,
            (kind, other) if kind == other => kind,
            (ColumnKind::Integer | ColumnKind::Number, ColumnKind::Integer | ColumnKind::Number) => {
                ColumnKind::Number
            }
            _ => ColumnKind::Text,
        };
        self.values.extend(more.values);
    }
}

/// The types of values of a response in a sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct SweepResponse {
    /// Its name.
    pub(crate) name: String,
    /// Whether some values are numbers.
    pub(crate) has_numbers: bool,
    /// Whether some values are words.
    pub(crate) has_words: bool,
}

/// One row per trial: identifiers, factors in the order of the sweep, parameters drawn from a posterior, outcome, responses.
pub(crate) fn of_trials(
    factors: &[String],
    parameters: &[String],
    responses: &[SweepResponse],
    trials: &[TrialRow],
) -> Vec<Column> {
    let each = |of: fn(&TrialRow) -> Value| trials.iter().map(of);
    let mut columns = vec![
        Column::new("job_id", ColumnKind::Text, each(|trial| json!(trial.job_id))),
        Column::new("point", ColumnKind::Integer, each(|trial| json!(trial.point))),
        Column::new("replicate", ColumnKind::Integer, each(|trial| json!(trial.replicate))),
        Column::new("seed", ColumnKind::Integer, each(|trial| json!(trial.seed))),
    ];
    columns.extend(factors.iter().map(|name| {
        Column::of(name, trials.iter().map(|trial| trial.factors.get(name).cloned().unwrap_or_default()))
    }));
    columns.extend(parameters.iter().map(|name| {
        Column::of(name, trials.iter().map(|trial| trial.parameters.get(name).cloned().unwrap_or_default()))
    }));
    columns.extend([
        Column::new("state", ColumnKind::Text, each(|trial| json!(trial.state))),
        Column::new("failure_class", ColumnKind::Text, each(|trial| json!(trial.failure_class))),
        Column::new("backend", ColumnKind::Text, each(|trial| json!(trial.backend))),
        Column::new("solver_revision", ColumnKind::Integer, each(|trial| json!(trial.solver_revision))),
    ]);
    columns.extend(responses.iter().map(|SweepResponse { name, .. }| {
        Column::of(name, trials.iter().map(|trial| trial.responses.get(name).cloned().unwrap_or_default()))
    }));
    columns
}

/// The suffix of a column's name, and its value of a summary.
type SummaryColumn = (&'static str, fn(&Summary) -> Value);

const SUMMARY: [SummaryColumn; 5] = [
    ("n", |summary| json!(summary.n)),
    ("mean", |summary| json!(summary.mean)),
    ("standard_deviation", |summary| json!(summary.standard_deviation)),
    ("low_95", |summary| json!(summary.low_95)),
    ("high_95", |summary| json!(summary.high_95)),
];

/// Columns of sweeps whose replicates drew parameters from a posterior.
const INPUT: [SummaryColumn; 2] = [
    ("input_deviation", |summary| json!(summary.input_deviation)),
    ("chance_deviation", |summary| json!(summary.chance_deviation)),
];

/// One row per design point: point, factors, numbers of trials, and for each response `name.n`, `name.mean` and so on; for words
/// `name.words`, as JSON. If parameters were drawn from a posterior, `name.input_deviation` and `name.chance_deviation`.
pub(crate) fn of_points(
    factors: &[String],
    responses: &[SweepResponse],
    points: &[PointRow],
    is_drawn: bool,
) -> Vec<Column> {
    let each = |of: fn(&PointRow) -> Value| points.iter().map(of);
    let mut columns = vec![Column::new("point", ColumnKind::Integer, each(|row| json!(row.point)))];
    columns.extend(factors.iter().map(|name| {
        Column::of(name, points.iter().map(|row| row.factors.get(name).cloned().unwrap_or_default()))
    }));
    columns.extend([
        Column::new("trials", ColumnKind::Integer, each(|row| json!(row.counts.total()))),
        Column::new("succeeded", ColumnKind::Integer, each(|row| json!(row.counts.succeeded))),
        Column::new("failed", ColumnKind::Integer, each(|row| json!(row.counts.failed))),
        Column::new("unstable", ColumnKind::Integer, each(|row| json!(row.unstable))),
    ]);
    for SweepResponse { name, has_numbers, has_words } in responses {
        let (has_numbers, has_words) = (*has_numbers, *has_words);
        let summaries = || points.iter().map(|row| row.responses.get(name));
        for (end, value) in SUMMARY.into_iter().take(if has_numbers || !has_words { 5 } else { 1 }) {
            let kind = if end == "n" { ColumnKind::Integer } else { ColumnKind::Number };
            let values = summaries().map(|summary| summary.map(value).unwrap_or_default());
            columns.push(Column::new(&format!("{name}.{end}"), kind, values));
        }
        if is_drawn && (has_numbers || !has_words) {
            for (end, value) in INPUT {
                let values = summaries().map(|summary| summary.map(value).unwrap_or_default());
                columns.push(Column::new(&format!("{name}.{end}"), ColumnKind::Number, values));
            }
        }
        if has_words {
            let words =
                |summary: &Summary| summary.words.as_ref().map(|words| json!(words)).unwrap_or_default();
            let values = summaries().map(|summary| summary.map(words).unwrap_or_default());
            columns.push(Column::new(&format!("{name}.words"), ColumnKind::Text, values));
        }
    }
    columns
}

/// Lines of text as CSV, then columns as CSV. Null is an empty cell.
pub(crate) fn csv(head: &[Vec<String>], columns: &[Column]) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    for line in head {
        writer.write_record(line)?;
    }
    for row in 0..columns.first().map_or(0, |column| column.values.len()) {
        writer.write_record(columns.iter().map(|column| text(&column.values[row]).unwrap_or_default()))?;
    }
    writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
}

/// Text as it is, other values as JSON; none for null.
pub(crate) fn text(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()),
        value => Some(value.to_string()),
    }
}

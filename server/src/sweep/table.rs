//! Result tables as columns, for CSV and Parquet: a row a trial, or a row a design point.

use roost_api::table::{PointRow, Summary, TrialRow};
use serde_json::{Value, json};

/// A column: its name, and a value a row, null where there is none.
pub(crate) struct Column {
    pub(super) name: String,
    pub(super) kind: Kind,
    pub(super) values: Vec<Value>,
}

/// What a column holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    Integer,
    Number,
    Flag,
    /// Words, and as JSON whatever else there is.
    Text,
}

impl Column {
    fn new(name: &str, kind: Kind, values: impl Iterator<Item = Value>) -> Self {
        Self { name: name.to_owned(), kind, values: values.collect() }
    }

    /// A column of whatever the values are; nothing at all counts as numbers.
    fn of(name: &str, values: impl Iterator<Item = Value>) -> Self {
        let values: Vec<Value> = values.collect();
        let all = |is: &dyn Fn(&Value) -> bool| values.iter().all(|value| value.is_null() || is(value));
        let kind = if values.iter().all(Value::is_null) {
            Kind::Number
        } else if all(&Value::is_i64) {
            Kind::Integer
        } else if all(&Value::is_number) {
            Kind::Number
        } else if all(&Value::is_boolean) {
            Kind::Flag
        } else {
            Kind::Text
        };
        Self { name: name.to_owned(), kind, values }
    }

    /// Adds the same column of the rows that come next. It is then what it would be of all rows at once.
    pub(crate) fn extend(&mut self, more: Self) {
        let is_blank = |column: &Self| column.values.iter().all(Value::is_null);
        self.kind = match (self.kind, more.kind) {
            (kind, _) if is_blank(&more) => kind,
            (_, kind) if is_blank(self) => kind,
            (kind, other) if kind == other => kind,
            (Kind::Integer | Kind::Number, Kind::Integer | Kind::Number) => Kind::Number,
            _ => Kind::Text,
        };
        self.values.extend(more.values);
    }
}

/// What there is of a response in a sweep.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Response {
    /// Its name.
    pub(crate) name: String,
    /// Whether it has been a number.
    pub(crate) has_numbers: bool,
    /// Whether it has been a word.
    pub(crate) has_words: bool,
}

/// One row a trial: trial, factors in the order of the sweep, outcome, responses.
pub(crate) fn of_trials(factors: &[String], responses: &[Response], trials: &[TrialRow]) -> Vec<Column> {
    let each = |of: fn(&TrialRow) -> Value| trials.iter().map(of);
    let mut columns = vec![
        Column::new("job_id", Kind::Text, each(|trial| json!(trial.job_id))),
        Column::new("point", Kind::Integer, each(|trial| json!(trial.point))),
        Column::new("replicate", Kind::Integer, each(|trial| json!(trial.replicate))),
        Column::new("seed", Kind::Integer, each(|trial| json!(trial.seed))),
    ];
    columns.extend(factors.iter().map(|name| {
        Column::of(name, trials.iter().map(|trial| trial.factors.get(name).cloned().unwrap_or_default()))
    }));
    columns.extend([
        Column::new("state", Kind::Text, each(|trial| json!(trial.state))),
        Column::new("failure_class", Kind::Text, each(|trial| json!(trial.failure_class))),
        Column::new("backend", Kind::Text, each(|trial| json!(trial.backend))),
        Column::new("solver_revision", Kind::Integer, each(|trial| json!(trial.solver_revision))),
    ]);
    columns.extend(responses.iter().map(|Response { name, .. }| {
        Column::of(name, trials.iter().map(|trial| trial.responses.get(name).cloned().unwrap_or_default()))
    }));
    columns
}

/// The end of a column's name, and what it holds of a summary.
type Part = (&'static str, fn(&Summary) -> Value);

const SUMMARY: [Part; 5] = [
    ("n", |summary| json!(summary.n)),
    ("mean", |summary| json!(summary.mean)),
    ("standard_deviation", |summary| json!(summary.standard_deviation)),
    ("low_95", |summary| json!(summary.low_95)),
    ("high_95", |summary| json!(summary.high_95)),
];

/// One row a design point: point, factors, its trials, and of each response `name.n`, `name.mean` and so on; of words
/// `name.words`, as JSON.
pub(crate) fn of_points(factors: &[String], responses: &[Response], points: &[PointRow]) -> Vec<Column> {
    let each = |of: fn(&PointRow) -> Value| points.iter().map(of);
    let mut columns = vec![Column::new("point", Kind::Integer, each(|row| json!(row.point)))];
    columns.extend(factors.iter().map(|name| {
        Column::of(name, points.iter().map(|row| row.factors.get(name).cloned().unwrap_or_default()))
    }));
    columns.extend([
        Column::new("trials", Kind::Integer, each(|row| json!(row.counts.total()))),
        Column::new("succeeded", Kind::Integer, each(|row| json!(row.counts.succeeded))),
        Column::new("failed", Kind::Integer, each(|row| json!(row.counts.failed))),
        Column::new("unstable", Kind::Integer, each(|row| json!(row.unstable))),
    ]);
    for Response { name, has_numbers, has_words } in responses {
        let (has_numbers, has_words) = (*has_numbers, *has_words);
        let summaries = || points.iter().map(|row| row.responses.get(name));
        for (end, value) in SUMMARY.into_iter().take(if has_numbers || !has_words { 5 } else { 1 }) {
            let kind = if end == "n" { Kind::Integer } else { Kind::Number };
            let values = summaries().map(|summary| summary.map(value).unwrap_or_default());
            columns.push(Column::new(&format!("{name}.{end}"), kind, values));
        }
        if has_words {
            let words =
                |summary: &Summary| summary.words.as_ref().map(|words| json!(words)).unwrap_or_default();
            let values = summaries().map(|summary| summary.map(words).unwrap_or_default());
            columns.push(Column::new(&format!("{name}.words"), Kind::Text, values));
        }
    }
    columns
}

/// Writes columns as CSV, with a header line before the first; null is nothing.
pub(crate) fn csv(columns: &[Column], with_header: bool) -> Result<Vec<u8>, csv::Error> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    if with_header {
        writer.write_record(columns.iter().map(|column| &column.name))?;
    }
    for row in 0..columns.first().map_or(0, |column| column.values.len()) {
        writer.write_record(columns.iter().map(|column| text(&column.values[row]).unwrap_or_default()))?;
    }
    writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))
}

/// Text as it is, the rest as JSON; nothing for null.
pub(super) fn text(value: &Value) -> Option<String> {
    match value {
        Value::Null => None,
        Value::String(text) => Some(text.clone()),
        value => Some(value.to_string()),
    }
}

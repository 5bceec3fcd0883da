//! The query of a result table: format, meaning of rows, names of columns, selection, page.

use serde::Deserialize;
use utoipa::openapi::schema::Object;
use utoipa::{IntoParams, ToSchema};

use super::page::rows_schema;
use super::problem::{ApiError, ProblemKind};

/// Maximum number of rows of a page.
pub(super) const MAX_ROWS: u32 = 5000;

/// The format of a result table.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum TableFormat {
    /// JSON.
    #[default]
    Json,
    /// Comma-separated values with a header line.
    Csv,
    /// Apache Parquet.
    Parquet,
    /// A workbook of Excel.
    Xlsx,
}

impl TableFormat {
    /// The media type of the answer.
    pub(super) fn media_type(self) -> &'static str {
        match self {
            Self::Json => "application/json",
            Self::Csv => "text/csv; charset=utf-8",
            Self::Parquet => "application/vnd.apache.parquet",
            Self::Xlsx => "application/vnd.openxmlformats-officedocument.spreadsheetml.sheet",
        }
    }
}

/// The meaning of a row of the result table.
#[derive(Clone, Copy, Default, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum By {
    /// A trial.
    #[default]
    Trial,
    /// A design point: statistics over its replicates.
    Point,
}

/// The names of columns of fields.
#[derive(Clone, Copy, PartialEq, Eq, Deserialize, ToSchema)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Names {
    /// JSON pointers: `/equipment/gate_opening_m`.
    Pointer,
    /// As few last parts of the pointers as are unique: `gate_opening_m`.
    Short,
}

/// Query of a result table.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct TableQuery {
    /// Format; the default is `json`.
    #[serde(default)]
    #[param(inline)]
    pub(super) format: TableFormat,
    /// Meaning of a row; the default is `trial`. `xlsx` has a sheet for each.
    #[serde(default)]
    #[param(inline)]
    pub(super) by: By,
    /// Names of the columns of fields; the default is `short` for `xlsx`, and `pointer` otherwise. Not for `json`.
    #[param(inline)]
    names: Option<Names>,
    /// Whether a second header line has the units; for `csv` only.
    #[serde(default)]
    pub(super) units: bool,
    /// Only these responses: names separated by commas.
    pub(super) responses: Option<String>,
    /// `next_cursor` of the previous page; not for `xlsx`.
    pub(super) cursor: Option<String>,
    /// Maximum of rows of the page; the default is all rows. Not for `xlsx`.
    #[param(schema_with = all_schema)]
    pub(super) limit: Option<u32>,
}

fn all_schema() -> Object {
    rows_schema(MAX_ROWS, None)
}

impl TableQuery {
    /// Refuses parameters that the format does not have.
    pub(super) fn check(&self) -> Result<(), ApiError> {
        let detail = match self.format {
            TableFormat::Json if self.names == Some(Names::Short) => {
                "names=short is for csv, parquet and xlsx: rows of json have factors by their pointers"
            }
            TableFormat::Xlsx if self.cursor.is_some() || self.limit.is_some() => {
                "a workbook has all rows: leave out cursor and limit, or use format=csv"
            }
            format if self.units && format != TableFormat::Csv => {
                "units=true is for csv: xlsx has a sheet of units, parquet has them in its metadata, and names end in their units"
            }
            _ => return Ok(()),
        };
        Err(ApiError::new(ProblemKind::InvalidQuery, detail))
    }

    /// Whether columns of fields have short names.
    pub(super) fn has_short_names(&self) -> bool {
        self.names.map_or(self.format == TableFormat::Xlsx, |names| names == Names::Short)
    }

    /// Whether the table states the units of its columns.
    pub(super) fn has_units(&self) -> bool {
        self.units || matches!(self.format, TableFormat::Parquet | TableFormat::Xlsx)
    }

    /// The selected responses; none selects all.
    pub(super) fn selected(&self) -> Option<Vec<String>> {
        self.responses
            .as_ref()
            .map(|names| names.split(',').filter(|name| !name.is_empty()).map(str::to_owned).collect())
    }
}

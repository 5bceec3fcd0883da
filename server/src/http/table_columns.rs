//! The columns of a result table: their names and units, and their values in some rows.

use roost_api::short_names::short_names;
use roost_api::table::{PointRow, TrialRow};

use super::problem::{ApiError, ProblemKind};
use crate::sweep::{self, unit_of};

/// Some rows of the table.
pub(super) enum Chunk {
    Trials(Vec<TrialRow>),
    Points(Vec<PointRow>),
}

impl Chunk {
    pub(super) fn none(by_point: bool) -> Self {
        if by_point { Self::Points(Vec::new()) } else { Self::Trials(Vec::new()) }
    }
}

/// The columns of a table.
pub(super) struct TableColumns {
    pub(super) factors: Vec<String>,
    /// Pointers of the parameters that trials drew from a posterior.
    pub(super) parameters: Vec<String>,
    pub(super) responses: Vec<sweep::SweepResponse>,
    /// Names of the selected responses; none selects all.
    pub(super) selected: Option<Vec<String>>,
    /// Whether parameters were drawn from a posterior.
    pub(super) is_drawn: bool,
    /// Whether columns of fields have short names.
    pub(super) has_short_names: bool,
    /// The experiment of the sweep, if all its jobs have the same.
    pub(super) experiment: Option<String>,
}

impl TableColumns {
    /// The columns with the values of some rows. Their names are long.
    pub(super) fn of(&self, chunk: &Chunk) -> Vec<sweep::Column> {
        match chunk {
            Chunk::Trials(trials) => {
                sweep::of_trials(&self.factors, &self.parameters, &self.responses, trials)
            }
            Chunk::Points(points) => sweep::of_points(&self.factors, &self.responses, points, self.is_drawn),
        }
    }

    /// The names of columns, as users see them.
    pub(super) fn names(&self, columns: &[sweep::Column]) -> Vec<String> {
        let names: Vec<&str> = columns.iter().map(sweep::Column::name).collect();
        if self.has_short_names {
            short_names(&names)
        } else {
            names.into_iter().map(str::to_owned).collect()
        }
    }

    /// The units of columns, empty without one.
    pub(super) fn units(&self, columns: &[sweep::Column]) -> Vec<String> {
        columns.iter().map(|column| unit_of(column.name(), self.experiment.as_deref()).unit).collect()
    }

    /// The header of a table as CSV, with a second line for units if asked.
    pub(super) fn csv_head(&self, by_point: bool, with_units: bool) -> Result<Vec<u8>, ApiError> {
        let columns = self.of(&Chunk::none(by_point));
        let mut head = vec![self.names(&columns)];
        if with_units {
            head.push(self.units(&columns));
        }
        sweep::csv(&head, &[]).map_err(|error| unwritten(&error))
    }

    /// Rows as CSV, without a header.
    pub(super) fn csv(&self, chunk: &Chunk) -> Result<Vec<u8>, ApiError> {
        sweep::csv(&[], &self.of(chunk)).map_err(|error| unwritten(&error))
    }

    /// Removes responses that were not selected.
    pub(super) fn select(&self, chunk: &mut Chunk) {
        let Some(selected) = &self.selected else { return };
        match chunk {
            Chunk::Trials(trials) => {
                trials.iter_mut().for_each(|trial| trial.responses.retain(|name, _| selected.contains(name)));
            }
            Chunk::Points(points) => {
                points.iter_mut().for_each(|point| point.responses.retain(|name, _| selected.contains(name)));
            }
        }
    }
}

/// A table that could not be written.
pub(super) fn unwritten(error: &dyn std::fmt::Display) -> ApiError {
    ApiError::new(ProblemKind::Internal, format!("the table cannot be written: {error}"))
}

//! The rows of a result table, read in chunks.

use roost_api::ids::SweepId;
use roost_api::sweep::SweepView;
use roost_api::table::TrialRow;

use super::blocking::run_blocking;
use super::page::RowRange;
use super::problem::ApiError;
use super::table_columns::Chunk;
use super::table_query::MAX_ROWS;
use crate::state::App;
use crate::store::TrialPlace;
use crate::sweep::{self, Posterior};

/// Maximum of trials in memory.
const CHUNK: u32 = 500;

/// The rows of a table that are still to be read.
pub(super) struct TableRows {
    pub(super) app: App,
    pub(super) id: SweepId,
    pub(super) by_point: bool,
    pub(super) replicates: u32,
    /// Replicates in a row that have the same parameters, if these come from a posterior.
    pub(super) runs_per_sample: Option<u32>,
    /// The samples that trials drew, for rows of trials.
    pub(super) posterior: Option<Posterior>,
    pub(super) range: RowRange,
}

impl TableRows {
    /// Every design point of a sweep.
    pub(super) fn of_points(app: App, sweep: &SweepView) -> Result<Self, ApiError> {
        let range = RowRange::new(sweep.points, 1, None, None, MAX_ROWS)?;
        let (replicates, runs_per_sample) = (sweep.replicates, sweep.runs_per_sample);
        Ok(Self { app, id: sweep.id, by_point: true, replicates, runs_per_sample, posterior: None, range })
    }

    /// All trials of the next chunk of design points; none after the last.
    pub(super) async fn next_points(&mut self) -> Result<Option<Vec<TrialRow>>, ApiError> {
        let Some((TrialPlace { from: (first, _), .. }, points)) =
            self.range.take((CHUNK / self.replicates.max(1)).max(1))
        else {
            return Ok(None);
        };
        let trials = self.app.store.trials_of(self.id, first..first + points).await?;
        Ok(Some(self.with_parameters(trials)))
    }

    /// Adds what each trial drew from the posterior.
    fn with_parameters(&self, mut trials: Vec<TrialRow>) -> Vec<TrialRow> {
        if let Some(posterior) = &self.posterior {
            trials.iter_mut().for_each(|trial| trial.parameters = posterior.drawn(trial.replicate));
        }
        trials
    }

    /// The next chunk; none after the last.
    pub(super) async fn next(&mut self) -> Result<Option<Chunk>, ApiError> {
        if self.by_point {
            let Some(trials) = self.next_points().await? else { return Ok(None) };
            let drawn = self.runs_per_sample;
            return run_blocking(move || Some(Chunk::Points(sweep::by_point(&trials, drawn)))).await;
        }
        let Some((place, rows)) = self.range.take(CHUNK) else { return Ok(None) };
        let trials = self.app.store.trials_from(self.id, place, rows).await?;
        Ok(Some(Chunk::Trials(self.with_parameters(trials))))
    }
}

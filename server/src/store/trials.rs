//! The trials of a sweep: its jobs by point and replicate, with what they came to.

use roost_api::ids::{JobId, SweepId};
use roost_api::table::TrialRow;

use super::rows::Columns;
use super::{Store, StoreError};

impl Store {
    /// Every trial, by point and replicate.
    pub(crate) async fn trials(&self, id: SweepId) -> Result<Vec<TrialRow>, StoreError> {
        let rows = sqlx::query(
            "SELECT j.id, j.point, j.replicate, j.seed, j.state, j.failure_class, p.levels,
                    r.backend, r.solver_revision, r.responses
             FROM jobs j
             JOIN points p ON p.sweep_id = j.sweep_id AND p.idx = j.point
             LEFT JOIN results r ON r.job_id = j.id
             WHERE j.sweep_id = ? ORDER BY j.point, j.replicate",
        )
        .bind(id.to_string())
        .fetch_all(&self.readers)
        .await?;
        rows.iter()
            .map(|row| {
                Ok(TrialRow {
                    job_id: row.parsed("id")?,
                    point: row.number("point")?,
                    replicate: row.number("replicate")?,
                    seed: row.number("seed")?,
                    factors: row.json("levels")?,
                    state: row.parsed("state")?,
                    failure_class: row.parsed_opt("failure_class")?,
                    backend: row.column("backend")?,
                    solver_revision: row.number_opt("solver_revision")?,
                    responses: row.json("responses")?,
                })
            })
            .collect()
    }

    /// The running jobs of a sweep.
    pub(crate) async fn running_jobs(&self, id: SweepId) -> Result<Vec<JobId>, StoreError> {
        let rows = sqlx::query("SELECT id FROM jobs WHERE sweep_id = ? AND state = 'running'")
            .bind(id.to_string())
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(|row| row.parsed("id")).collect()
    }
}

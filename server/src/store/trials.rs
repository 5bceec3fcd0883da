//! The trials of a sweep: its jobs by point and replicate, with their results. They are read in batches.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::JobState;
use roost_api::table::TrialRow;

use super::columns::Columns;
use super::database::{AssertSqlSafe, Row, query};
use super::{Store, StoreError};
use crate::sweep::SweepResponse;

/// Design point and replicate of a trial.
pub(crate) type TrialIndex = (u32, u32);

/// A place among the trials of a sweep: those from an index on, without the first `skip` of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TrialPlace {
    pub(crate) from: TrialIndex,
    pub(crate) skip: u32,
}

/// Result documents in memory at a time.
pub(crate) const MAX_DOCUMENTS: u32 = 16;

/// A trial with its result document.
pub(crate) struct TrialDocument {
    pub(crate) job_id: JobId,
    pub(crate) place: TrialIndex,
    pub(crate) state: JobState,
    /// Its result, or the partial result of its newest attempt, as JSON text.
    pub(crate) document: Option<String>,
}

const COLUMNS: &str = "SELECT j.id, j.point, j.replicate, j.seed, j.state, j.failure_class, p.levels,
        r.backend, r.solver_revision, r.responses
    FROM jobs j
    JOIN design_points p ON p.sweep_id = j.sweep_id AND p.point = j.point
    LEFT JOIN results r ON r.job_id = j.id";

/// Trials in the order of an index, without sorting.
pub(super) const FROM: &str = "WHERE j.sweep_id = ? AND (j.point, j.replicate) >= (?, ?)
    ORDER BY j.point, j.replicate LIMIT ? OFFSET ?";

impl Store {
    /// At most `limit` trials from a place on.
    pub(crate) async fn trials_from(
        &self,
        id: SweepId,
        TrialPlace { from: (point, replicate), skip }: TrialPlace,
        limit: u32,
    ) -> Result<Vec<TrialRow>, StoreError> {
        let rows = query(AssertSqlSafe(format!("{COLUMNS} {FROM}")))
            .bind(id.to_string())
            .bind(point)
            .bind(replicate)
            .bind(limit)
            .bind(skip)
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(trial).collect()
    }

    /// Every trial of a range of points.
    pub(crate) async fn trials_of(
        &self,
        id: SweepId,
        points: std::ops::Range<u32>,
    ) -> Result<Vec<TrialRow>, StoreError> {
        let sql = format!(
            "{COLUMNS} WHERE j.sweep_id = ? AND j.point >= ? AND j.point < ? ORDER BY j.point, j.replicate"
        );
        let rows = query(AssertSqlSafe(sql))
            .bind(id.to_string())
            .bind(points.start)
            .bind(points.end)
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(trial).collect()
    }

    /// A few trials with their result documents, from a place on.
    pub(crate) async fn documents_from(
        &self,
        id: SweepId,
        TrialPlace { from: (point, replicate), skip }: TrialPlace,
        limit: u32,
    ) -> Result<Vec<TrialDocument>, StoreError> {
        let sql = format!(
            "SELECT j.id, j.point, j.replicate, j.state, d.body FROM jobs j
             LEFT JOIN results r ON r.job_id = j.id
             LEFT JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt
                                  AND j.state IN ('failed', 'cancelled')
             LEFT JOIN documents d ON d.digest = coalesce(r.document_digest, a.partial_digest) {FROM}"
        );
        let rows = query(AssertSqlSafe(sql))
            .bind(id.to_string())
            .bind(point)
            .bind(replicate)
            .bind(limit.min(MAX_DOCUMENTS))
            .bind(skip)
            .fetch_all(&self.readers)
            .await?;
        rows.iter()
            .map(|row| {
                Ok(TrialDocument {
                    job_id: row.parsed("id")?,
                    place: (row.number("point")?, row.number("replicate")?),
                    state: row.parsed("state")?,
                    document: row.column("body")?,
                })
            })
            .collect()
    }

    /// The responses in the results of a sweep, by name.
    pub(crate) async fn responses(&self, id: SweepId) -> Result<Vec<SweepResponse>, StoreError> {
        let rows = query(
            "SELECT e.key, max(CASE WHEN e.type IN ('integer', 'real') THEN 1 ELSE 0 END) AS numbers,
                    max(CASE WHEN e.type IN ('text', 'true', 'false') THEN 1 ELSE 0 END) AS words
             FROM jobs j JOIN results r ON r.job_id = j.id, json_each(r.responses) e
             WHERE j.sweep_id = ? GROUP BY e.key",
        )
        .bind(id.to_string())
        .fetch_all(&self.readers)
        .await?;
        let response = |row: &Row| {
            Ok(SweepResponse {
                name: row.column("key")?,
                has_numbers: row.column("numbers")?,
                has_words: row.column("words")?,
            })
        };
        let mut responses: Vec<SweepResponse> =
            rows.iter().map(response).collect::<Result<_, StoreError>>()?;
        // Not by the database, whose order depends on its locale.
        responses.sort_by(|a, b| a.name.cmp(&b.name));
        Ok(responses)
    }

    /// The running jobs of a sweep.
    pub(crate) async fn running_jobs(&self, id: SweepId) -> Result<Vec<JobId>, StoreError> {
        let rows = query("SELECT id FROM jobs WHERE sweep_id = ? AND state = 'running'")
            .bind(id.to_string())
            .fetch_all(&self.readers)
            .await?;
        rows.iter().map(|row| row.parsed("id")).collect()
    }
}

fn trial(row: &Row) -> Result<TrialRow, StoreError> {
    Ok(TrialRow {
        job_id: row.parsed("id")?,
        point: row.number("point")?,
        replicate: row.number("replicate")?,
        seed: row.number("seed")?,
        factors: row.json("levels")?,
        parameters: serde_json::Map::new(),
        state: row.parsed("state")?,
        failure_class: row.parsed_opt("failure_class")?,
        backend: row.column("backend")?,
        solver_revision: row.number_opt("solver_revision")?,
        responses: row.json("responses")?,
    })
}

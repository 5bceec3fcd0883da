//! Requests for runs of a study: a repeat with the same key is given the same runs.

use roost_api::ids::{JobId, SweepId};
use roost_api::time::Timestamp;
use uuid::Uuid;

use super::columns::{Columns, to_json};
use super::database::{Connection, query};
use super::observations::{HandedOutRun, handed_out_run};
use super::{Store, StoreError};
use crate::study::HandOut;

/// A request of a client for runs.
pub(crate) struct AskedRuns {
    /// The identifier of its request, if a repeat must be given the same.
    pub(crate) request: Option<Uuid>,
    /// Runs to hand out.
    pub(crate) runs: Vec<HandOut>,
    /// When they may be handed out again.
    pub(crate) expires_at: Timestamp,
}

/// The runs of a decision.
pub(crate) struct MadeRuns {
    /// Its jobs.
    pub(crate) jobs: Vec<JobId>,
    /// Its runs for a client.
    pub(crate) runs: Vec<HandedOutRun>,
}

impl Store {
    /// The runs of an earlier request with the same identifier; none if there was no such request.
    pub(crate) async fn answered_ask(
        &self,
        id: SweepId,
        request: Uuid,
    ) -> Result<Option<MadeRuns>, StoreError> {
        let sql = "SELECT numbers, jobs FROM asks WHERE request_id = ? AND study_id = ?";
        let asked = query(sql).bind(request.to_string()).bind(id.to_string());
        let Some(row) = asked.fetch_optional(&self.readers).await? else { return Ok(None) };
        let sql = "SELECT number, levels, replicate, seed, expires_at FROM observations
                   WHERE study_id = ? AND number IN (SELECT CAST(atom AS BIGINT) FROM json_each(?)) ORDER BY number";
        let numbers: String = row.column("numbers")?;
        let runs = query(sql).bind(id.to_string()).bind(numbers).fetch_all(&self.readers).await?;
        let runs = runs.iter().map(handed_out_run).collect::<Result<_, _>>()?;
        Ok(Some(MadeRuns { jobs: row.json("jobs")?, runs }))
    }
}

/// Notes what a request for runs is given.
pub(super) async fn answer_ask(
    tx: &mut Connection,
    id: SweepId,
    request: Uuid,
    made: &MadeRuns,
) -> Result<(), StoreError> {
    let numbers: Vec<u64> = made.runs.iter().map(|run| run.number).collect();
    let sql = "INSERT INTO asks (request_id, study_id, numbers, jobs) VALUES (?, ?, ?, ?)";
    query(sql)
        .bind(request.to_string())
        .bind(id.to_string())
        .bind(to_json("numbers", &numbers)?)
        .bind(to_json("jobs", &made.jobs)?)
        .execute(&mut *tx)
        .await?;
    Ok(())
}

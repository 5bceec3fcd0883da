//! Extending a sweep.

use roost_api::design::Factor;
use roost_api::ids::SweepId;
use roost_api::time::Timestamp;
use roost_solver::scenario::{self, Scenario};
use serde_json::Value;
use uuid::Uuid;

use super::columns::{Columns, corrupt, from_json};
use super::database::{Connection, query, query_scalar};
use super::job_rows::{JobBatches, JobOptions, queue_start};
use super::submit::queue_jobs;
use super::{Store, StoreError};
use crate::sweep::{AddedPoints, Posterior, StoredSweep, Trial, factors, replicate};

/// An extension about to be stored.
pub(crate) struct NewExtension {
    id: SweepId,
    /// Identifier of the extension, which is made once.
    extension: Uuid,
    body: String,
    /// Points and replicates before the extension.
    before: (u32, u32),
    /// Points and replicates after it.
    after: (u32, u32),
    batches: JobBatches,
    options: JobOptions,
}

impl NewExtension {
    /// Encodes the first batch of new jobs. A token submitted the extension as `body`. `firsts` are the scenarios of the points that get
    /// more replicates.
    pub(crate) fn new(
        id: SweepId,
        (extension, body): (Uuid, &Value),
        token: String,
        stored: &StoredSweep,
        added: AddedPoints,
        firsts: Vec<(u32, Scenario)>,
    ) -> Result<Self, StoreError> {
        let replicates = added.replicates;
        let (old_points, new_points) = (stored.points.len() as u32, added.points.len() as u32);
        let more = stored.replicates..replicates;
        let jobs = firsts.len() as u64 * more.len() as u64 + u64::from(new_points) * u64::from(replicates);
        let posterior = stored.spec.posterior.as_ref().and_then(Posterior::of);
        let repeated = firsts.into_iter().flat_map(move |(point, first)| {
            let posterior = posterior.clone();
            let trial = move |number| Trial {
                point,
                replicate: number,
                scenario: replicate(&first, number, posterior.as_ref()),
                levels: None,
            };
            more.clone().map(trial)
        });
        Ok(Self {
            id,
            extension,
            body: body.to_string(),
            before: (old_points, stored.replicates),
            after: (old_points + new_points, replicates),
            batches: JobBatches::start(id, jobs, move |encoder| {
                encoder.encode(repeated.chain(added.points.trials(old_points, replicates)))
            }),
            options: JobOptions::of(&stored.spec, token)?,
        })
    }
}

impl Store {
    /// The stored state of a sweep that is to be extended.
    pub(crate) async fn stored_sweep(&self, id: SweepId) -> Result<Option<StoredSweep>, StoreError> {
        let row = query("SELECT spec, replicates FROM sweeps WHERE id = ? AND state = 'ready'")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let points = query("SELECT levels FROM design_points WHERE sweep_id = ? ORDER BY point")
            .bind(id.to_string())
            .fetch_all(&self.readers)
            .await?;
        let text: String = row.column("spec")?;
        Ok(Some(StoredSweep {
            spec: from_json("spec", &text)?,
            replicates: row.number("replicates")?,
            points: points.iter().map(|row| row.json("levels")).collect::<Result<_, _>>()?,
        }))
    }

    /// Whether an extension is stored.
    pub(crate) async fn is_extended(&self, extension: Uuid) -> Result<bool, StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM extensions WHERE id = ?)";
        Ok(query_scalar(sql).bind(extension.to_string()).fetch_one(&self.readers).await?)
    }

    /// The factors of a sweep, as submitted.
    pub(crate) async fn factors(&self, id: SweepId) -> Result<Option<Vec<Factor>>, StoreError> {
        let spec: Option<String> = query_scalar("SELECT spec FROM sweeps WHERE id = ? AND state = 'ready'")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        spec.map(|text| from_json("spec", &text).map(|spec| factors(&spec))).transpose()
    }

    /// Adds points and replicates to a sweep. Returns false, and changes nothing, when another extension came first.
    pub(crate) async fn extend_sweep(&self, more: NewExtension, now: Timestamp) -> Result<bool, StoreError> {
        let is_large = more.batches.is_large();
        self.writer.write_as(is_large, move |tx| Box::pin(extend_sweep(tx, more, now))).await
    }

    /// The scenario of each point's first replicate, as it was queued.
    pub(crate) async fn first_scenarios(&self, id: SweepId) -> Result<Vec<(u32, Scenario)>, StoreError> {
        let rows = query(
            "SELECT j.point, s.body FROM jobs j JOIN scenarios s ON s.digest = j.scenario_digest
             WHERE j.sweep_id = ? AND j.replicate = 0 ORDER BY j.point",
        )
        .bind(id.to_string())
        .fetch_all(&self.readers)
        .await?;
        rows.iter()
            .map(|row| {
                let text: String = row.column("body")?;
                let scenario = scenario::parse(&text).map_err(|error| corrupt("scenario", error))?;
                Ok((row.number("point")?, scenario))
            })
            .collect()
    }
}

async fn extend_sweep(tx: &mut Connection, more: NewExtension, now: Timestamp) -> Result<bool, StoreError> {
    let NewExtension { id, extension, body, before, after, mut batches, options } = more;
    let grown = query(
        "UPDATE sweeps SET points = ?, replicates = ?
         WHERE id = ? AND points = ? AND replicates = ? AND state = 'ready'",
    )
    .bind(after.0)
    .bind(after.1)
    .bind(id.to_string())
    .bind(before.0)
    .bind(before.1)
    .execute(&mut *tx)
    .await?
    .rows_affected();
    if grown == 0 {
        return Ok(false);
    }
    query(
        "INSERT INTO extensions (id, sweep_id, body, points_before, replicates_before, extended_at)
         VALUES (?, ?, ?, ?, ?, ?)",
    )
    .bind(extension.to_string())
    .bind(id.to_string())
    .bind(body)
    .bind(before.0)
    .bind(before.1)
    .bind(now.0)
    .execute(&mut *tx)
    .await?;
    let mut start = queue_start(tx, &options).await?;
    while let Some(batch) = batches.next().await? {
        queue_jobs(tx, &batch, &options, start, now).await?;
        start.position += batch.len() as i64;
    }
    Ok(true)
}

//! Extending a sweep: what is there of it, and what is added.

use roost_api::design::Factor;
use roost_api::ids::SweepId;
use roost_api::time::Timestamp;
use roost_solver::scenario::Scenario;
use serde_json::Value;
use uuid::Uuid;

use super::rows::{Columns, from_json};
use super::submit::{Draft, Shared, drafts, insert, insert_points, levels};
use super::{Store, StoreError};
use crate::sweep::{Growth, Stored, factors, replicate};

/// What is about to be added to a sweep.
pub(crate) struct MoreOfSweep {
    id: SweepId,
    /// Of the extension: it is made once.
    extension: Uuid,
    body: String,
    /// Points and replicates that it is added to.
    before: (u32, u32),
    /// The same afterwards.
    after: (u32, u32),
    levels: Vec<String>,
    drafts: Vec<Draft>,
    shared: Shared,
}

impl MoreOfSweep {
    /// Writes the growth of a sweep out, which `body` asked for; `firsts` are the scenarios of its points, where they get more replicates.
    pub(crate) fn new(
        id: SweepId,
        (extension, body): (Uuid, &Value),
        stored: &Stored,
        growth: &Growth,
        firsts: &[(u32, Scenario)],
    ) -> Result<Self, StoreError> {
        let there = stored.matrix.len() as u32;
        let repeated = firsts.iter().flat_map(|(point, first)| {
            (stored.replicates..growth.replicates).map(|number| (*point, number, replicate(first, number)))
        });
        let added = (there..).zip(&growth.points).flat_map(|(point, added)| {
            (0..growth.replicates).map(move |number| (point, number, replicate(&added.scenario, number)))
        });
        Ok(Self {
            id,
            extension,
            body: body.to_string(),
            before: (there, stored.replicates),
            after: (there + growth.points.len() as u32, growth.replicates),
            levels: levels(&growth.points)?,
            drafts: drafts(id, repeated.chain(added).collect())?,
            shared: Shared::of(&stored.spec)?,
        })
    }
}

impl Store {
    /// What an extension of a sweep goes on from.
    pub(crate) async fn stored_sweep(&self, id: SweepId) -> Result<Option<Stored>, StoreError> {
        let row = sqlx::query("SELECT spec, replicates FROM sweeps WHERE id = ? AND deleting = 0")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        let Some(row) = row else { return Ok(None) };
        let points = sqlx::query("SELECT levels FROM points WHERE sweep_id = ? ORDER BY idx")
            .bind(id.to_string())
            .fetch_all(&self.readers)
            .await?;
        let text: String = row.column("spec")?;
        Ok(Some(Stored {
            spec: from_json("spec", &text)?,
            replicates: row.number("replicates")?,
            matrix: points.iter().map(|row| row.json("levels")).collect::<Result<_, _>>()?,
        }))
    }

    /// Whether an extension has been made.
    pub(crate) async fn is_extended(&self, extension: Uuid) -> Result<bool, StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM extensions WHERE id = ?)";
        Ok(sqlx::query_scalar(sql).bind(extension.to_string()).fetch_one(&self.readers).await?)
    }

    /// The factors of a sweep, as submitted.
    pub(crate) async fn factors(&self, id: SweepId) -> Result<Option<Vec<Factor>>, StoreError> {
        let spec: Option<String> =
            sqlx::query_scalar("SELECT spec FROM sweeps WHERE id = ? AND deleting = 0")
                .bind(id.to_string())
                .fetch_optional(&self.readers)
                .await?;
        spec.map(|text| from_json("spec", &text).map(|spec| factors(&spec))).transpose()
    }

    /// Adds points and replicates to a sweep. False when it has grown meanwhile: then nothing is changed.
    pub(crate) async fn extend_sweep(&self, more: MoreOfSweep, now: Timestamp) -> Result<bool, StoreError> {
        let MoreOfSweep { id, extension, body, before, after, levels, drafts, shared } = more;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let grown = sqlx::query(
                        "UPDATE sweeps SET points = ?, replicates = ?
                         WHERE id = ? AND points = ? AND replicates = ? AND deleting = 0",
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
                    sqlx::query(
                        "INSERT INTO extensions (id, sweep_id, body, points, replicates, extended_at)
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
                    insert_points(tx, id, before.0 as usize, &levels).await?;
                    insert(tx, &drafts, &shared, now).await?;
                    Ok(true)
                })
            })
            .await
    }

    /// The scenario of each point's first replicate, as it was queued.
    pub(crate) async fn first_scenarios(&self, id: SweepId) -> Result<Vec<(u32, Scenario)>, StoreError> {
        let rows = sqlx::query(
            "SELECT j.point, s.body FROM jobs j JOIN scenarios s ON s.digest = j.digest
             WHERE j.sweep_id = ? AND j.replicate = 0 ORDER BY j.point",
        )
        .bind(id.to_string())
        .fetch_all(&self.readers)
        .await?;
        rows.iter()
            .map(|row| {
                let text: String = row.column("body")?;
                Ok((row.number("point")?, from_json("scenario", &text)?))
            })
            .collect()
    }
}

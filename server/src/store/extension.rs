//! Extending a sweep: what is there of it, and what is added.

use roost_api::design::Factor;
use roost_api::ids::{JobId, SweepId};
use roost_api::time::Timestamp;
use roost_solver::scenario::Scenario;

use super::rows::{Columns, from_json};
use super::submit::{Draft, Shared, insert, insert_points, levels};
use super::{Store, StoreError};
use crate::sweep::{Growth, Stored, factors, replicate};

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
    pub(crate) async fn extend_sweep(
        &self,
        id: SweepId,
        stored: &Stored,
        growth: &Growth,
        now: Timestamp,
    ) -> Result<bool, StoreError> {
        let there = stored.matrix.len();
        let mut drafts = Vec::new();
        if growth.replicates > stored.replicates {
            for (point, first) in self.first_scenarios(id).await? {
                for number in stored.replicates..growth.replicates {
                    drafts.push(Draft::new(
                        &replicate(&first, number),
                        Some((id, point, number)),
                        JobId::new(),
                    )?);
                }
            }
        }
        for (index, point) in growth.points.iter().enumerate() {
            for number in 0..growth.replicates {
                let place = Some((id, (there + index) as u32, number));
                drafts.push(Draft::new(&replicate(&point.scenario, number), place, JobId::new())?);
            }
        }
        let shared = Shared::of(&stored.spec)?;
        let levels = levels(&growth.points)?;
        let (points, replicates) = ((there + levels.len()) as i64, growth.replicates);
        let (points_before, replicates_before) = (there as i64, stored.replicates);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let grown = sqlx::query(
                        "UPDATE sweeps SET points = ?, replicates = ?
                         WHERE id = ? AND points = ? AND replicates = ? AND deleting = 0",
                    )
                    .bind(points)
                    .bind(replicates)
                    .bind(id.to_string())
                    .bind(points_before)
                    .bind(replicates_before)
                    .execute(&mut *tx)
                    .await?
                    .rows_affected();
                    if grown == 0 {
                        return Ok(false);
                    }
                    insert_points(tx, id, there, &levels).await?;
                    insert(tx, &drafts, &shared, now).await?;
                    Ok(true)
                })
            })
            .await
    }

    /// The scenario of each point's first replicate, as it was queued.
    async fn first_scenarios(&self, id: SweepId) -> Result<Vec<(u32, Scenario)>, StoreError> {
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

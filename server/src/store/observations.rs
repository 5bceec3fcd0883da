//! Observations: the runs of a study that are no jobs of its own.

use roost_api::ids::SweepId;
use roost_api::time::Timestamp;
use roost_design::Outcome;
use serde_json::Value;
use sqlx::sqlite::SqliteRow;
use sqlx::{QueryBuilder, Sqlite, SqliteConnection};

use super::columns::{Columns, corrupt, from_json, to_json};
use super::writer::SLICE;
use super::{Store, StoreError};
use crate::study::{Observation, Source, SweepRun};

impl Store {
    /// The observations of a study that are evidence.
    pub(crate) async fn observations(&self, id: SweepId) -> Result<Vec<Observation>, StoreError> {
        let sql = "SELECT source, state, origin, levels, replicate, seed, responses FROM observations
                   WHERE study_id = ? AND state IN ('handed_out', 'done', 'failed') ORDER BY number";
        let rows = sqlx::query(sql).bind(id.to_string()).fetch_all(&self.readers).await?;
        rows.iter().map(observation).collect()
    }

    /// Number of ended runs of a study that its budget does not count.
    pub(crate) async fn runs_outside_budget(&self, id: SweepId) -> Result<u64, StoreError> {
        let sql = "SELECT count(*) AS runs FROM observations WHERE study_id = ? AND source = 'sweep'";
        sqlx::query(sql).bind(id.to_string()).fetch_one(&self.readers).await?.number("runs")
    }

    /// The runs of a sweep that have a result, for a study that begins with them.
    pub(crate) async fn finished_runs(&self, id: SweepId) -> Result<Vec<SweepRun>, StoreError> {
        let sql = "SELECT s.body, r.solver_revision, r.responses FROM jobs j
                   JOIN scenarios s ON s.digest = j.scenario_digest JOIN results r ON r.job_id = j.id
                   WHERE j.sweep_id = ? AND j.state = 'succeeded' ORDER BY j.point, j.replicate";
        let rows = sqlx::query(sql).bind(id.to_string()).fetch_all(&self.readers).await?;
        let run = |row: &SqliteRow| {
            Ok(SweepRun {
                scenario: from_json::<Value>("scenario", &row.column::<String>("body")?)?,
                solver_revision: row.number("solver_revision")?,
                responses: row.json("responses")?,
            })
        };
        rows.iter().map(run).collect()
    }
}

fn observation(row: &SqliteRow) -> Result<Observation, StoreError> {
    let source: String = row.column("source")?;
    let source = match source.as_str() {
        "sweep" => Source::Sweep(row.parsed("origin")?),
        other => return Err(corrupt("source", format!("unknown word {other}"))),
    };
    let state: String = row.column("state")?;
    let outcome = match state.as_str() {
        "handed_out" => Outcome::Pending,
        "failed" => Outcome::Failed,
        _ => Outcome::Responses(row.json("responses")?),
    };
    Ok(Observation {
        source,
        levels: row.json("levels")?,
        replicate: row.number("replicate")?,
        seed: row.number("seed")?,
        outcome,
    })
}

/// Stores the copied runs of a new study.
pub(super) async fn insert_copies(
    tx: &mut SqliteConnection,
    id: SweepId,
    copies: &[Observation],
    now: Timestamp,
) -> Result<(), StoreError> {
    let row = |copy: &Observation| {
        let Source::Sweep(origin) = copy.source;
        let Outcome::Responses(responses) = &copy.outcome else {
            return Err(corrupt("outcome", "no result"));
        };
        let (levels, responses) = (to_json("levels", &copy.levels)?, to_json("responses", responses)?);
        Ok((origin.to_string(), levels, copy.replicate, copy.seed as i64, responses))
    };
    let rows = copies.iter().map(row).collect::<Result<Vec<_>, StoreError>>()?;
    for (slice, rows) in rows.chunks(SLICE).enumerate() {
        let mut query = QueryBuilder::<Sqlite>::new(
            "INSERT INTO observations (study_id, number, source, state, origin, levels, replicate, seed, responses, recorded_at) ",
        );
        let numbers = (slice * SLICE + 1) as i64..;
        query.push_values(rows.iter().zip(numbers), |mut values, (row, number)| {
            let (origin, levels, replicate, seed, responses) = row;
            values
                .push_bind(id.to_string())
                .push_bind(number)
                .push_bind("sweep")
                .push_bind("done")
                .push_bind(origin)
                .push_bind(levels)
                .push_bind(replicate)
                .push_bind(seed)
                .push_bind(responses)
                .push_bind(now.0);
        });
        query.build().execute(&mut *tx).await?;
    }
    Ok(())
}

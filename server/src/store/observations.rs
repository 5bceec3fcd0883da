//! Observations: the runs of a study that are no jobs of its own.

use std::collections::BTreeSet;

use roost_api::ids::SweepId;
use roost_api::time::Timestamp;
use roost_design::Outcome;
use serde_json::Value;

use super::columns::{Columns, corrupt, from_json, to_json};
use super::database::{Builder, Connection, Row, query, query_scalar};
use super::writer::SLICE;
use super::{Store, StoreError};
use crate::study::{HandOut, Observation, Source, SweepRun};

/// Maximum number of runs in the list of those that were handed out.
const MAX_LISTED: u32 = 1000;

/// The numbers that triggers keep: a view of a study costs the same, however many observations it has.
pub(super) const OBSERVED: &str =
    "SELECT done, failed, handed_out, outside_budget FROM observation_counts WHERE study_id = ?";

/// The first free number of a study.
pub(super) const NEXT_NUMBER: &str =
    "SELECT coalesce(max(number), 0) + 1 FROM observations WHERE study_id = ?";

/// Numbers of the observations of a study.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Observed {
    /// Runs that were handed out and have responses.
    pub(crate) done: u64,
    /// Runs that were handed out and have failed.
    pub(crate) failed: u64,
    /// Runs that await their outcome.
    pub(crate) handed_out: u64,
    /// Runs that the budget does not count.
    pub(crate) outside_budget: u64,
}

/// A run that was handed out.
pub(crate) struct HandedOutRun {
    /// Its number within the study.
    pub(crate) number: u64,
    /// The run.
    pub(crate) run: HandOut,
    /// When it may be handed out again.
    pub(crate) expires_at: Timestamp,
}

impl Store {
    /// The observations of a study that are evidence.
    pub(crate) async fn observations(&self, id: SweepId) -> Result<Vec<Observation>, StoreError> {
        let sql = "SELECT source, state, origin, levels, replicate, seed, responses FROM observations
                   WHERE study_id = ? AND state IN ('handed_out', 'done', 'failed') ORDER BY number";
        let rows = query(sql).bind(id.to_string()).fetch_all(&self.readers).await?;
        rows.iter().map(observation).collect()
    }

    /// Numbers of the observations of a study.
    pub(crate) async fn observed(&self, id: SweepId) -> Result<Observed, StoreError> {
        let row = query(OBSERVED).bind(id.to_string()).fetch_optional(&self.readers).await?;
        let Some(row) = row else { return Ok(Observed::default()) };
        Ok(Observed {
            done: row.number("done")?,
            failed: row.number("failed")?,
            handed_out: row.number("handed_out")?,
            outside_budget: row.number("outside_budget")?,
        })
    }

    /// The runs of a study that were handed out and await their outcome, at most [`MAX_LISTED`].
    pub(crate) async fn handed_out_runs(&self, id: SweepId) -> Result<Vec<HandedOutRun>, StoreError> {
        let sql = "SELECT number, levels, replicate, seed, expires_at FROM observations
                   WHERE study_id = ? AND state = 'handed_out' ORDER BY number LIMIT ?";
        let rows = query(sql).bind(id.to_string()).bind(MAX_LISTED).fetch_all(&self.readers).await?;
        rows.iter().map(handed_out_run).collect()
    }

    /// The numbers of all runs of a study that were ever handed out.
    pub(crate) async fn numbers_handed_out(&self, id: SweepId) -> Result<BTreeSet<u64>, StoreError> {
        let sql = "SELECT number FROM observations WHERE study_id = ? AND source = 'asked'";
        let rows = query(sql).bind(id.to_string()).fetch_all(&self.readers).await?;
        rows.iter().map(|row| row.number("number")).collect()
    }

    /// Marks the runs that have waited for their outcome for too long: they are no evidence, and may be handed out again.
    pub(crate) async fn expire_handed_out(&self, now: Timestamp) -> Result<(), StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM observations WHERE state = 'handed_out' AND expires_at <= ?)";
        if !query_scalar::<bool>(sql).bind(now.0).fetch_one(&self.readers).await? {
            return Ok(());
        }
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE studies SET news = news + 1, changes = changes + 1 WHERE sweep_id IN
                                   (SELECT study_id FROM observations WHERE state = 'handed_out' AND expires_at <= ?)";
                    query(sql).bind(now.0).execute(&mut *tx).await?;
                    let sql = "UPDATE observations SET state = 'expired' WHERE state = 'handed_out' AND expires_at <= ?";
                    query(sql).bind(now.0).execute(&mut *tx).await?;
                    Ok(())
                })
            })
            .await
    }

    /// The runs of a sweep that have a result, for a study that begins with them.
    pub(crate) async fn runs_to_copy(&self, id: SweepId) -> Result<Vec<SweepRun>, StoreError> {
        let sql = "SELECT s.body, r.solver_revision, r.responses FROM jobs j
                   JOIN scenarios s ON s.digest = j.scenario_digest JOIN results r ON r.job_id = j.id
                   WHERE j.sweep_id = ? AND j.state = 'succeeded' ORDER BY j.point, j.replicate";
        let rows = query(sql).bind(id.to_string()).fetch_all(&self.readers).await?;
        let run = |row: &Row| {
            Ok(SweepRun {
                scenario: from_json::<Value>("scenario", &row.column::<String>("body")?)?,
                solver_revision: row.number("solver_revision")?,
                responses: row.json("responses")?,
            })
        };
        rows.iter().map(run).collect()
    }
}

fn observation(row: &Row) -> Result<Observation, StoreError> {
    let source: String = row.column("source")?;
    let source = match source.as_str() {
        "sweep" => Source::Sweep(row.parsed("origin")?),
        "asked" => Source::Asked,
        "client" => Source::Client,
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

pub(super) fn handed_out_run(row: &Row) -> Result<HandedOutRun, StoreError> {
    let (levels, replicate, seed) = (row.json("levels")?, row.number("replicate")?, row.number("seed")?);
    let run = HandOut { levels, replicate, seed };
    Ok(HandedOutRun { number: row.number("number")?, run, expires_at: row.moment("expires_at")? })
}

/// The first free number of a study. By the primary key it is found in one step.
pub(super) async fn next_number(tx: &mut Connection, id: SweepId) -> Result<i64, StoreError> {
    Ok(query_scalar(NEXT_NUMBER).bind(id.to_string()).fetch_one(&mut *tx).await?)
}

/// Hands out runs of a study.
pub(super) async fn hand_out(
    tx: &mut Connection,
    id: SweepId,
    runs: Vec<HandOut>,
    (now, expires_at): (Timestamp, Timestamp),
) -> Result<Vec<HandedOutRun>, StoreError> {
    let mut handed_out = Vec::with_capacity(runs.len());
    for run in runs {
        let number = next_number(tx, id).await?;
        let sql = "INSERT INTO observations
                       (study_id, number, source, state, levels, replicate, seed, handed_out_at, expires_at)
                   VALUES (?, ?, 'asked', 'handed_out', ?, ?, ?, ?, ?)";
        query(sql)
            .bind(id.to_string())
            .bind(number)
            .bind(to_json("levels", &run.levels)?)
            .bind(run.replicate)
            .bind(run.seed as i64)
            .bind(now.0)
            .bind(expires_at.0)
            .execute(&mut *tx)
            .await?;
        handed_out.push(HandedOutRun { number: number as u64, run, expires_at });
    }
    Ok(handed_out)
}

/// Stores the copied runs of a new study.
pub(super) async fn insert_copies(
    tx: &mut Connection,
    id: SweepId,
    copies: &[Observation],
    now: Timestamp,
) -> Result<(), StoreError> {
    let row = |copy: &Observation| {
        let Source::Sweep(origin) = copy.source else {
            return Err(corrupt("source", "no copy of a run"));
        };
        let Outcome::Responses(responses) = &copy.outcome else {
            return Err(corrupt("outcome", "no result"));
        };
        let (levels, responses) = (to_json("levels", &copy.levels)?, to_json("responses", responses)?);
        Ok((origin.to_string(), levels, copy.replicate, copy.seed as i64, responses))
    };
    let rows = copies.iter().map(row).collect::<Result<Vec<_>, StoreError>>()?;
    for (slice, rows) in rows.chunks(SLICE).enumerate() {
        let mut query = Builder::new(
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

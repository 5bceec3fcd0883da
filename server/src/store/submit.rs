//! Taking in jobs and sweeps.

use std::collections::BTreeMap;

use rayon::prelude::*;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{Cache, Needs};
use roost_api::sweep::SweepSpec;
use roost_api::time::Timestamp;
use roost_solver::SOLVER_REVISION;
use roost_solver::scenario::Scenario;
use serde_json::Value;
use sqlx::{AssertSqlSafe, QueryBuilder, Sqlite, SqliteConnection};

use super::rows::to_json;
use super::{Store, StoreError};
use crate::sweep::{Expansion, Point};

/// A job about to be stored.
pub(crate) struct NewJob {
    /// Its identifier.
    pub id: JobId,
    /// The complete scenario.
    pub scenario: Scenario,
    /// Higher is claimed first.
    pub priority: i32,
    /// Free labels.
    pub labels: BTreeMap<String, String>,
    /// What it needs of a worker.
    pub needs: Needs,
    /// Longest wall time, in seconds.
    pub max_wall_s: Option<f64>,
    /// Simulated time from frame to frame, in seconds; none without it.
    pub frame_interval_s: Option<f64>,
    /// Whether the result may come from the store.
    pub cache: Cache,
}

/// A sweep about to be stored: everything is written out, which of a large one takes a while.
pub(crate) struct NewSweep {
    id: SweepId,
    spec: SweepSpec,
    text: String,
    factors: String,
    replicates: u32,
    levels: Vec<String>,
    drafts: Vec<Draft>,
    shared: Shared,
}

impl NewSweep {
    /// Writes a sweep out, and it itself as it was submitted.
    pub(crate) fn new(
        id: SweepId,
        submitted: &Value,
        spec: SweepSpec,
        expansion: &Expansion,
    ) -> Result<Self, StoreError> {
        Ok(Self {
            id,
            text: to_json("sweep", submitted)?,
            factors: to_json("factors", &expansion.factors)?,
            replicates: expansion.replicates,
            levels: levels(&expansion.points)?,
            drafts: drafts(id, expansion.trials().collect())?,
            shared: Shared::of(&spec)?,
            spec,
        })
    }
}

/// The jobs of trials: point, replicate and scenario.
pub(super) fn drafts(id: SweepId, trials: Vec<(u32, u32, Scenario)>) -> Result<Vec<Draft>, StoreError> {
    let draft = |(point, replicate, scenario): (u32, u32, Scenario)| {
        Draft::new(&scenario, Some((id, point, replicate)), JobId::new())
    };
    trials.into_par_iter().map(draft).collect()
}

/// A row of `jobs` before it has a state.
pub(super) struct Draft {
    id: JobId,
    digest: String,
    body: String,
    seed: i64,
    place: Option<(SweepId, u32, u32)>,
}

/// What the jobs of one submission share.
pub(super) struct Shared {
    priority: i32,
    labels: String,
    needs: Needs,
    max_wall_s: Option<f64>,
    frame_interval_s: Option<f64>,
    cache: Cache,
}

/// Rows of one `INSERT`: SQLite takes 32,766 parameters.
const ROWS: usize = 500;

impl Shared {
    /// What the jobs of a sweep share.
    pub(super) fn of(spec: &SweepSpec) -> Result<Self, StoreError> {
        Ok(Self {
            priority: spec.priority,
            labels: to_json("labels", &spec.labels)?,
            needs: spec.needs.clone(),
            max_wall_s: spec.max_wall_s,
            frame_interval_s: spec.frame_interval_s,
            cache: spec.cache,
        })
    }
}

impl Draft {
    pub(super) fn new(
        scenario: &Scenario,
        place: Option<(SweepId, u32, u32)>,
        id: JobId,
    ) -> Result<Self, StoreError> {
        let seed = scenario.seed as i64; // at most 2^53 - 1
        Ok(Self { id, digest: scenario.digest(), body: to_json("scenario", scenario)?, seed, place })
    }
}

impl Store {
    /// Stores a job that is not there yet, answered from the store where that is allowed.
    pub(crate) async fn insert_job(&self, job: NewJob, now: Timestamp) -> Result<(), StoreError> {
        let draft = Draft::new(&job.scenario, None, job.id)?;
        let shared = Shared {
            priority: job.priority,
            labels: to_json("labels", &job.labels)?,
            needs: job.needs,
            max_wall_s: job.max_wall_s,
            frame_interval_s: job.frame_interval_s,
            cache: job.cache,
        };
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if is_there(tx, "SELECT EXISTS (SELECT 1 FROM jobs WHERE id = ?)", job.id.to_string())
                        .await?
                    {
                        return Ok(());
                    }
                    insert(tx, &[draft], &shared, now).await
                })
            })
            .await
    }

    /// Stores a sweep that is not there yet, its design points and its jobs, all or nothing.
    pub(crate) async fn insert_sweep(&self, sweep: NewSweep, now: Timestamp) -> Result<(), StoreError> {
        let NewSweep { id, spec, text, factors, replicates, levels, drafts, shared } = sweep;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if is_there(tx, "SELECT EXISTS (SELECT 1 FROM sweeps WHERE id = ?)", id.to_string()).await? {
                        return Ok(());
                    }
                    sqlx::query(
                        "INSERT INTO sweeps (id, name, spec, design, factors, labels, points, replicates, submitted_at)
                         VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)",
                    )
                    .bind(id.to_string())
                    .bind(spec.name)
                    .bind(text)
                    .bind(spec.design.kind.as_str())
                    .bind(factors)
                    .bind(&shared.labels)
                    .bind(levels.len() as i64)
                    .bind(replicates)
                    .bind(now.0)
                    .execute(&mut *tx)
                    .await?;
                    insert_points(tx, id, 0, &levels).await?;
                    insert(tx, &drafts, &shared, now).await
                })
            })
            .await
    }
}

/// The levels of each point, as they are kept.
pub(super) fn levels(points: &[Point]) -> Result<Vec<String>, StoreError> {
    points.iter().map(|point| to_json("levels", &point.levels)).collect()
}

/// Whether a repeat of the same submission has made it.
async fn is_there(tx: &mut SqliteConnection, sql: &'static str, id: String) -> Result<bool, StoreError> {
    Ok(sqlx::query_scalar(sql).bind(id).fetch_one(&mut *tx).await?)
}

/// Adds design points, the first with the index `first`.
pub(super) async fn insert_points(
    tx: &mut SqliteConnection,
    id: SweepId,
    first: usize,
    levels: &[String],
) -> Result<(), StoreError> {
    for (chunk, rows) in levels.chunks(ROWS).enumerate() {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO points (sweep_id, idx, levels) ");
        query.push_values(rows.iter().enumerate(), |mut row, (index, levels)| {
            row.push_bind(id.to_string()).push_bind((first + chunk * ROWS + index) as i64).push_bind(levels);
        });
        query.build().execute(&mut *tx).await?;
    }
    Ok(())
}

/// Queues jobs, answered from the store where that is allowed.
pub(super) async fn insert(
    tx: &mut SqliteConnection,
    drafts: &[Draft],
    shared: &Shared,
    now: Timestamp,
) -> Result<(), StoreError> {
    let newest: i64 =
        sqlx::query_scalar("SELECT coalesce(max(seq), 0) FROM jobs").fetch_one(&mut *tx).await?;
    let first_turn: i64 =
        sqlx::query_scalar("SELECT coalesce((SELECT turn FROM turns WHERE priority = ?), 0)")
            .bind(shared.priority)
            .fetch_one(&mut *tx)
            .await?;
    for (chunk, rows) in drafts.chunks(ROWS).enumerate() {
        let mut query = QueryBuilder::<Sqlite>::new("INSERT INTO scenarios (digest, body) ");
        query.push_values(rows, |mut row, draft| {
            row.push_bind(&draft.digest).push_bind(&draft.body);
        });
        query.push(" ON CONFLICT (digest) DO NOTHING").build().execute(&mut *tx).await?;

        let mut query = QueryBuilder::<Sqlite>::new(
            "INSERT INTO jobs (id, sweep_id, point, replicate, digest, seed, priority, turn, labels,
             needs_backend, needs_memory_mib, max_wall_s, frame_interval_s, cache, submitted_at) ",
        );
        query.push_values(rows.iter().enumerate(), |mut row, (index, draft)| {
            row.push_bind(draft.id.to_string())
                .push_bind(draft.place.map(|(sweep, _, _)| sweep.to_string()))
                .push_bind(draft.place.map(|(_, point, _)| point))
                .push_bind(draft.place.map(|(_, _, replicate)| replicate))
                .push_bind(&draft.digest)
                .push_bind(draft.seed)
                .push_bind(shared.priority)
                .push_bind(first_turn + (chunk * ROWS + index) as i64)
                .push_bind(&shared.labels)
                .push_bind(&shared.needs.backend)
                .push_bind(shared.needs.memory_mib)
                .push_bind(shared.max_wall_s)
                .push_bind(shared.frame_interval_s)
                .push_bind(shared.cache.as_str())
                .push_bind(now.0);
        });
        query.build().execute(&mut *tx).await?;
    }
    if shared.cache == Cache::Use { answer_from_cache(tx, newest, now).await } else { Ok(()) }
}

/// The frames of a result, where they are as far apart as a job asks.
const FRAMES_AS_ASKED: &str = "frames f JOIN jobs recorded ON recorded.id = f.job_id
    WHERE f.job_id = results.job_id AND f.attempt = results.attempt AND recorded.frame_interval_s = jobs.frame_interval_s";

/// Settles the queued jobs after `newest` whose scenario this solver revision has run before; where frames are asked for, that run
/// must have recorded them as far apart, and these are theirs.
async fn answer_from_cache(tx: &mut SqliteConnection, newest: i64, now: Timestamp) -> Result<(), StoreError> {
    let answered = sqlx::query(AssertSqlSafe(format!(
        "INSERT INTO results
         SELECT jobs.id, 0, old.digest, old.solver_revision, old.backend, old.responses, old.document, ?
         FROM jobs JOIN results AS old ON old.job_id =
             (SELECT job_id FROM results WHERE digest = jobs.digest AND solver_revision = ?
              AND (jobs.frame_interval_s IS NULL OR EXISTS (SELECT 1 FROM {FRAMES_AS_ASKED}))
              LIMIT 1)
         WHERE jobs.seq > ?"
    )))
    .bind(now.0)
    .bind(SOLVER_REVISION)
    .bind(newest)
    .execute(&mut *tx)
    .await?
    .rows_affected();
    if answered > 0 {
        sqlx::query(
            "UPDATE jobs SET state = 'succeeded', from_cache = 1, ended_at = ?
             WHERE seq > ? AND EXISTS (SELECT 1 FROM results WHERE job_id = jobs.id)",
        )
        .bind(now.0)
        .bind(newest)
        .execute(&mut *tx)
        .await?;
        sqlx::query(AssertSqlSafe(format!(
            "INSERT INTO frames
             SELECT jobs.id, 0, old.object, old.bytes, old.count, old.stopped, ?
             FROM jobs JOIN frames AS old ON old.job_id =
                 (SELECT job_id FROM results WHERE digest = jobs.digest AND solver_revision = ?
                  AND EXISTS (SELECT 1 FROM {FRAMES_AS_ASKED}) LIMIT 1)
             WHERE jobs.seq > ? AND jobs.from_cache = 1"
        )))
        .bind(now.0)
        .bind(SOLVER_REVISION)
        .bind(newest)
        .execute(&mut *tx)
        .await?;
    }
    Ok(())
}

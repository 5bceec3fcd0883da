//! Studies: the question and newest answer beside the sweep that they grow.

use roost_api::ids::SweepId;
use roost_api::job::JobState;
use roost_api::study::{Driver, SeedingSweep, StudyEnd, StudySpec, StudyState};
use roost_api::sweep::{StateCounts, SweepSpec};
use roost_api::time::Timestamp;
use roost_design::goals::FIRST_CONFIRMATION;
use serde_json::Value;

use super::asks::{AskedRuns, MadeRuns, answer_ask};
use super::columns::{Columns, corrupt, from_json, to_json};
use super::database::{AssertSqlSafe, Connection, Row, query, query_scalar};
use super::job_rows::{JobOptions, JobRow, queue_start};
use super::observations::{hand_out, insert_copies};
use super::submit::{insert_study_sweep, queue_jobs};
use super::writer::SLICE;
use super::{Store, StoreError};
use crate::study::{Decided, Observation, Present, Ranges, impossible_points};

/// Maximum number of runs that one decision proposes: they are one transaction.
pub(crate) const MAX_PROPOSALS: usize = SLICE;

/// A study in the store.
#[derive(Clone, Debug)]
pub(crate) struct StoredStudy {
    /// Its identifier.
    pub(crate) id: SweepId,
    /// As submitted, as JSON text.
    pub(crate) spec: String,
    /// The question in words.
    pub(crate) question: String,
    /// Its budget now.
    pub(crate) max_runs: u32,
    /// Its state.
    pub(crate) state: StudyState,
    /// Why the server has paused it.
    pub(crate) reason: Option<String>,
    /// Why it is finished.
    pub(crate) finished: Option<StudyEnd>,
    /// Number of decisions so far.
    pub(crate) decisions: i64,
    /// Numbers of the newest answer.
    pub(crate) answer: Option<Value>,
    /// The newest answer in words.
    pub(crate) sentences: Vec<String>,
    /// When it was submitted.
    pub(crate) submitted_at: Timestamp,
    /// When the newest answer was computed.
    pub(crate) answered_at: Option<Timestamp>,
    /// Its ranges now; none as submitted.
    ranges: Option<Ranges>,
    /// Number of attempts at a confirmation before the ranges grew.
    past_attempts: u32,
    /// Number of changes of its ranges and observations, and of retries of its jobs.
    pub(crate) news: i64,
    /// The party that runs its proposals.
    pub(crate) driver: Driver,
    /// The sweeps that it began with.
    pub(crate) seeding: Vec<SeedingSweep>,
    /// Row of its sweep: listings go from the newest to the oldest.
    pub(crate) seq: i64,
    /// The token that submitted its jobs.
    token: String,
}

/// A study about to be stored.
pub(crate) struct NewStudy {
    /// Its identifier.
    pub(crate) id: SweepId,
    /// As submitted.
    pub(crate) spec: StudySpec,
    /// Its question in words.
    pub(crate) question: String,
    /// The specification of its sweep.
    pub(crate) sweep: SweepSpec,
    /// Names of its factors.
    pub(crate) factors: Vec<String>,
    /// The sweeps that it begins with, and their runs.
    pub(crate) seeding: (Vec<SeedingSweep>, Vec<Observation>),
    /// The token that submitted it; empty without one.
    pub(crate) token: String,
}

/// The jobs of a decision about a study.
fn rows(decided: &Decided, id: SweepId) -> Result<Vec<JobRow>, StoreError> {
    decided.trials.iter().map(|trial| JobRow::of(trial, id)).collect()
}

const COLUMNS: &str = "SELECT w.seq, w.submitted_at, s.sweep_id, s.spec, s.question, s.max_runs, s.state, s.reason, s.finished, s.decisions, s.answer,
        s.sentences, s.answered_at, s.token_id, s.seeding, s.ranges, s.past_attempts, s.news, s.driver
    FROM studies s JOIN sweeps w ON w.id = s.sweep_id AND w.state = 'ready'";

impl StoredStudy {
    /// Whether its goal is `calibrate`.
    pub(crate) fn is_calibration(&self) -> bool {
        self.answer.as_ref().is_some_and(|answer| answer.pointer("/finding/calibrate").is_some())
    }

    /// The study as it is now.
    pub(crate) fn present(&self) -> Result<Present, StoreError> {
        Ok(Present {
            submitted: from_json("study", &self.spec)?,
            max_runs: self.max_runs,
            ranges: self.ranges.clone(),
            past_attempts: self.past_attempts,
            seeding: self.seeding.clone(),
            impossible: impossible_points(self.answer.as_ref()).map_err(|error| corrupt("answer", error))?,
        })
    }
}

impl Store {
    /// Stores a new study with its sweep and its first runs. A repeat changes nothing.
    pub(crate) async fn insert_study(
        &self,
        study: NewStudy,
        first: Decided,
        now: Timestamp,
    ) -> Result<(), StoreError> {
        let NewStudy { id, spec, question, sweep, factors, seeding: (seeding, copies), token } = study;
        let options = JobOptions::of(&sweep, token.clone())?;
        let (text, seeding) = (to_json("study", &spec)?, to_json("seeding", &seeding)?);
        let (answer, sentences) =
            (to_json("answer", &first.answer)?, to_json("sentences", &first.sentences)?);
        let rows = rows(&first, id)?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    if !insert_study_sweep(tx, id, &sweep, (&factors, first.points), now).await? {
                        return Ok(());
                    }
                    let sql = "INSERT INTO studies (sweep_id, spec, question, max_runs, token_id, decisions, answer, sentences, answered_at, seeding, driver)
                               VALUES (?, ?, ?, ?, ?, 1, ?, ?, ?, ?, ?)";
                    query(sql)
                        .bind(id.to_string())
                        .bind(text)
                        .bind(question)
                        .bind(spec.budget.max_runs)
                        .bind(token)
                        .bind(answer)
                        .bind(sentences)
                        .bind(now.0)
                        .bind(seeding)
                        .bind(spec.driver.as_str())
                        .execute(&mut *tx)
                        .await?;
                    insert_copies(tx, id, &copies, now).await?;
                    add_runs(tx, id, (&rows, first.points, first.replicates), &options, now).await
                })
            })
            .await
    }

    /// One study.
    pub(crate) async fn study(&self, id: SweepId) -> Result<Option<StoredStudy>, StoreError> {
        let sql = format!("{COLUMNS} WHERE s.sweep_id = ?");
        let row = query(AssertSqlSafe(sql)).bind(id.to_string()).fetch_optional(&self.readers).await?;
        row.as_ref().map(stored).transpose()
    }

    /// Studies, newest first, and the row that the next page starts before.
    pub(crate) async fn studies(
        &self,
        before: Option<i64>,
        limit: u32,
    ) -> Result<(Vec<StoredStudy>, Option<i64>), StoreError> {
        let sql = format!("{COLUMNS} WHERE w.seq < ? ORDER BY w.seq DESC LIMIT ?");
        let rows = query(AssertSqlSafe(sql))
            .bind(before.unwrap_or(i64::MAX))
            .bind(i64::from(limit) + 1)
            .fetch_all(&self.readers)
            .await?;
        let mut studies = rows.iter().map(stored).collect::<Result<Vec<_>, _>>()?;
        let more = studies.len() > limit as usize;
        studies.truncate(limit as usize);
        let next = studies.last().filter(|_| more).map(|last| last.seq);
        Ok((studies, next))
    }

    /// Whether a sweep belongs to a study.
    pub(crate) async fn is_study(&self, id: SweepId) -> Result<bool, StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM studies WHERE sweep_id = ?)";
        Ok(query_scalar(sql).bind(id.to_string()).fetch_one(&self.readers).await?)
    }

    /// Studies that the server decides about.
    pub(crate) async fn running_studies(&self) -> Result<Vec<SweepId>, StoreError> {
        let sql = "SELECT sweep_id FROM studies WHERE state = 'running' ORDER BY sweep_id";
        let rows = query(sql).fetch_all(&self.readers).await?;
        rows.iter().map(|row| row.parsed("sweep_id")).collect()
    }

    /// Number of jobs of a study by state, and of its queued jobs that are not paused.
    pub(crate) async fn study_counts(&self, id: SweepId) -> Result<(StateCounts, u64), StoreError> {
        let sql = "SELECT state, count(*) AS jobs, count(*) FILTER (WHERE paused = 0) AS unpaused FROM jobs WHERE sweep_id = ? GROUP BY state";
        let (mut counts, mut waiting) = (StateCounts::default(), 0);
        for row in query(sql).bind(id.to_string()).fetch_all(&self.readers).await? {
            let state = row.parsed("state")?;
            *counts.of(state) = row.number("jobs")?;
            if state == JobState::Queued {
                waiting = row.number("unpaused")?;
            }
        }
        Ok((counts, waiting))
    }

    /// Stores a decision about a study: its runs become jobs, and others are handed out until a time. Returns none, and changes nothing,
    /// when the study has changed since.
    pub(crate) async fn store_decision(
        &self,
        study: &StoredStudy,
        sweep: &SweepSpec,
        decision: Decided,
        asked: AskedRuns,
        now: Timestamp,
    ) -> Result<Option<MadeRuns>, StoreError> {
        let (id, decisions, max_runs, news) = (study.id, study.decisions, study.max_runs, study.news);
        let options = JobOptions::of(sweep, study.token.clone())?;
        let rows =
            decision.trials.iter().map(|trial| JobRow::of(trial, id)).collect::<Result<Vec<_>, _>>()?;
        let (answer, sentences) =
            (to_json("answer", &decision.answer)?, to_json("sentences", &decision.sentences)?);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE studies SET decisions = decisions + 1, changes = changes + 1, answer = ?, sentences = ?, answered_at = ?, finished = ?,
                                   state = CASE WHEN ? IS NULL THEN state ELSE 'finished' END
                               WHERE sweep_id = ? AND decisions = ? AND max_runs = ? AND news = ? AND state = 'running'
                                   AND EXISTS (SELECT 1 FROM sweeps WHERE id = sweep_id AND state = 'ready')";
                    let end = decision.finished.map(StudyEnd::as_str);
                    let stored = query(sql)
                        .bind(answer)
                        .bind(sentences)
                        .bind(now.0)
                        .bind(end)
                        .bind(end)
                        .bind(id.to_string())
                        .bind(decisions)
                        .bind(max_runs)
                        .bind(news)
                        .execute(&mut *tx)
                        .await?
                        .rows_affected();
                    if stored == 0 {
                        return Ok(None);
                    }
                    add_runs(tx, id, (&rows, decision.points, decision.replicates), &options, now).await?;
                    let runs = hand_out(tx, id, asked.runs, (now, asked.expires_at)).await?;
                    let made = MadeRuns { jobs: rows.iter().map(|row| row.id).collect(), runs };
                    if let Some(request) = asked.request {
                        answer_ask(tx, id, request, &made).await?;
                    }
                    Ok(Some(made))
                })
            })
            .await
    }

    /// Moves a study to another state, if it is in one of some states. The server gives a `reason` when it pauses one.
    pub(crate) async fn change_study(
        &self,
        id: SweepId,
        from: &'static [StudyState],
        to: StudyState,
        reason: Option<String>,
    ) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let words: Vec<&str> = from.iter().map(|state| state.as_str()).collect();
                    let sql = "UPDATE studies SET state = ?, reason = ?, changes = changes + 1
                               WHERE sweep_id = ? AND state IN (SELECT atom FROM json_each(?))";
                    query(sql)
                        .bind(to.as_str())
                        .bind(reason)
                        .bind(id.to_string())
                        .bind(to_json("states", &words)?)
                        .execute(&mut *tx)
                        .await?;
                    Ok(())
                })
            })
            .await
    }

    /// Raises the budget of a study. A finished study goes on. Returns false, and changes nothing, when the budget would not grow or
    /// the study is cancelled.
    pub(crate) async fn raise_budget(&self, id: SweepId, max_runs: u32) -> Result<bool, StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let sql = "UPDATE studies SET max_runs = ?1, finished = NULL, changes = changes + 1,
                                   state = CASE state WHEN 'finished' THEN 'running' ELSE state END
                               WHERE sweep_id = ?2 AND max_runs < ?1 AND state <> 'cancelled'";
                    let changed = query(sql).bind(max_runs).bind(id.to_string()).execute(&mut *tx).await?;
                    Ok(changed.rows_affected() == 1)
                })
            })
            .await
    }
}

impl Store {
    /// Widens the ranges of a study, whose question is then another one. A finished study goes on. Returns false, and changes nothing, when
    /// the study has changed since or is cancelled.
    pub(crate) async fn widen(
        &self,
        study: &StoredStudy,
        ranges: &Ranges,
        question: String,
    ) -> Result<bool, StoreError> {
        let (id, news, ranges) = (study.id, study.news, to_json("ranges", ranges)?);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    // A decision that is being made has other ranges: the number of decisions refuses it.
                    let sql = "UPDATE studies SET ranges = ?1, question = ?2, finished = NULL, news = news + 1, decisions = decisions + 1,
                                   changes = changes + 1, state = CASE state WHEN 'finished' THEN 'running' ELSE state END,
                                   past_attempts = (SELECT coalesce(max(replicate), 0) FROM
                                       (SELECT replicate FROM jobs WHERE sweep_id = ?3
                                        UNION ALL SELECT replicate FROM observations WHERE study_id = ?3) AS runs) / ?5
                               WHERE sweep_id = ?3 AND news = ?4 AND state <> 'cancelled'";
                    let changed = query(sql)
                        .bind(ranges)
                        .bind(question)
                        .bind(id.to_string())
                        .bind(news)
                        .bind(FIRST_CONFIRMATION)
                        .execute(&mut *tx)
                        .await?;
                    Ok(changed.rows_affected() == 1)
                })
            })
            .await
    }
}

/// Queues the runs of a decision. The replicates of the sweep are those of the point that has most.
async fn add_runs(
    tx: &mut Connection,
    id: SweepId,
    (rows, points, replicates): (&[JobRow], u32, u32),
    options: &JobOptions,
    now: Timestamp,
) -> Result<(), StoreError> {
    if rows.is_empty() {
        return Ok(());
    }
    let start = queue_start(tx, options).await?;
    queue_jobs(tx, rows, options, start, now).await?;
    let sql = "UPDATE sweeps SET points = ?1, replicates = CASE WHEN ?2 > replicates THEN ?2 ELSE replicates END WHERE id = ?3";
    query(sql).bind(points).bind(replicates).bind(id.to_string()).execute(&mut *tx).await?;
    Ok(())
}

fn stored(row: &Row) -> Result<StoredStudy, StoreError> {
    let answer: Option<String> = row.column("answer")?;
    Ok(StoredStudy {
        id: row.parsed("sweep_id")?,
        spec: row.column("spec")?,
        question: row.column("question")?,
        max_runs: row.number("max_runs")?,
        state: row.parsed("state")?,
        reason: row.column("reason")?,
        finished: row.parsed_opt("finished")?,
        decisions: row.column("decisions")?,
        answer: answer.map(|text| from_json("answer", &text)).transpose()?,
        sentences: row.json("sentences")?,
        submitted_at: row.moment("submitted_at")?,
        answered_at: row.moment_opt("answered_at")?,
        ranges: row.json("ranges")?,
        past_attempts: row.number("past_attempts")?,
        news: row.column("news")?,
        driver: row.parsed("driver")?,
        seeding: row.json("seeding")?,
        seq: row.column("seq")?,
        token: row.column("token_id")?,
    })
}

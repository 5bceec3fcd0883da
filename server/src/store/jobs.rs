//! Queries of jobs.

use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobState, JobView};

use super::columns::Columns;
use super::database::{Builder, Row, query};
use super::frames::frames_view;
use super::job_checkpoints::{COLUMNS, checkpoint_view};
use super::{Store, StoreError};

/// Filter of a listing of jobs.
#[derive(Clone, Debug, Default)]
pub(crate) struct JobFilter {
    /// Only of this sweep.
    pub sweep: Option<SweepId>,
    /// Only in this state.
    pub state: Option<JobState>,
    /// Only with this class of failure.
    pub failure: Option<FailureClass>,
    /// Only of this design point.
    pub point: Option<u32>,
    /// Only with this label, and with this value if given.
    pub label: Option<(String, Option<String>)>,
    /// Only older than this row.
    pub before: Option<i64>,
    /// Maximum number.
    pub limit: u32,
}

/// A query of views of jobs, up to its condition.
fn view() -> Builder {
    let mut query = Builder::new(VIEW);
    query.push(COLUMNS).push(FROM);
    query
}

const VIEW: &str = "SELECT j.*, coalesce(s.labels, j.labels) AS shown_labels, p.levels, r.responses, f.bytes AS frames_bytes, f.count AS frames_count, f.stop_reason AS frames_stop_reason,
    a.resumed_from_s, a.filled_by, pr.name AS project_name, nullif(t.user_name, '') AS user_name, ";
const FROM: &str = " FROM jobs j
    LEFT JOIN sweeps s ON s.id = j.sweep_id
    LEFT JOIN design_points p ON p.sweep_id = j.sweep_id AND p.point = j.point
    LEFT JOIN results r ON r.job_id = j.id
    LEFT JOIN frames f ON f.job_id = j.id AND f.attempt = j.attempt
    LEFT JOIN attempts a ON a.job_id = j.id AND a.number = j.attempt
    LEFT JOIN checkpoints c ON c.job_id = j.id
    LEFT JOIN owners o ON o.id = j.owner
    LEFT JOIN projects pr ON pr.id = o.project
    LEFT JOIN tokens t ON t.id = o.token_id ";

impl Store {
    /// One job, unless its sweep is hidden.
    pub(crate) async fn job(&self, id: JobId) -> Result<Option<JobView>, StoreError> {
        let row = view()
            .push("WHERE (s.state IS NULL OR s.state = 'ready') AND j.id = ")
            .push_bind(id.to_string())
            .build()
            .fetch_optional(&self.readers)
            .await?;
        row.as_ref().map(job_view).transpose()
    }

    /// The sweep of a job, if it has one.
    pub(crate) async fn sweep_of(&self, id: JobId) -> Result<Option<SweepId>, StoreError> {
        let row = query("SELECT sweep_id FROM jobs WHERE id = ?")
            .bind(id.to_string())
            .fetch_optional(&self.readers)
            .await?;
        row.map_or(Ok(None), |row| row.parsed_opt("sweep_id"))
    }

    /// Jobs, newest first, and the row that the next page starts before.
    pub(crate) async fn jobs(&self, filter: JobFilter) -> Result<(Vec<JobView>, Option<i64>), StoreError> {
        let mut query = view();
        // A point has few jobs: they are found by the point and then sorted. The `+` keeps SQLite from using the index of `seq`.
        let order = if filter.point.is_some() { "+j.seq" } else { "j.seq" };
        query.push(format!("WHERE {order} < ")).push_bind(filter.before.unwrap_or(i64::MAX));
        query.push(" AND j.queue NOT IN (SELECT seq FROM sweeps WHERE state <> 'ready')");
        if let Some(sweep) = filter.sweep {
            query.push(" AND j.sweep_id = ").push_bind(sweep.to_string());
        }
        if let Some(state) = filter.state {
            query.push(" AND j.state = ").push_bind(state.as_str());
            if state.is_ended() {
                query.push(" AND j.ended_at IS NOT NULL"); // redundant, but makes SQLite use the index `jobs_ended`
            }
        }
        if let Some(class) = filter.failure {
            query.push(" AND j.failure_class = ").push_bind(class.as_str());
        }
        if let Some(point) = filter.point {
            query.push(" AND j.point = ").push_bind(point);
        }
        if let Some((key, value)) = filter.label {
            // A job of a sweep has the labels of the sweep.
            query.push(" AND (");
            push_label(&mut query, "j.labels", &key, value.as_deref());
            query.push(" OR j.sweep_id IN (SELECT id FROM sweeps WHERE ");
            push_label(&mut query, "labels", &key, value.as_deref());
            query.push("))");
        }
        query.push(format!(" ORDER BY {order} DESC LIMIT ")).push_bind(i64::from(filter.limit) + 1);
        let mut rows = query.build().fetch_all(&self.readers).await?;
        let more = rows.len() > filter.limit as usize;
        rows.truncate(filter.limit as usize);
        let next = match rows.last() {
            Some(last) if more => Some(last.column("seq")?),
            _ => None,
        };
        Ok((rows.iter().map(job_view).collect::<Result<_, _>>()?, next))
    }
}

/// The condition that a row has a label.
pub(super) fn push_label(query: &mut Builder, column: &'static str, key: &str, value: Option<&str>) {
    query
        .push(format!("EXISTS (SELECT 1 FROM json_each({column}) l WHERE l.key = "))
        .push_bind(key.to_owned());
    if let Some(value) = value {
        query.push(" AND l.atom = ").push_bind(value.to_owned());
    }
    query.push(")");
}

fn job_view(row: &Row) -> Result<JobView, StoreError> {
    Ok(JobView {
        id: row.parsed("id")?,
        state: row.parsed("state")?,
        cancelling: row.column("cancelling")?,
        paused: row.column("paused")?,
        sweep_id: row.parsed_opt("sweep_id")?,
        point: row.number_opt("point")?,
        replicate: row.number_opt("replicate")?,
        factors: row.json("levels")?,
        seed: row.number("seed")?,
        scenario_digest: row.column("scenario_digest")?,
        priority: row.column("priority")?,
        user: row.column("user_name")?,
        project: row.column("project_name")?,
        labels: row.json("shown_labels")?,
        attempt: row.number("attempt")?,
        worker_id: row.parsed_opt("worker_id")?,
        resumed_from_s: row.column("resumed_from_s")?,
        checkpoint: checkpoint_view(row)?,
        shared_fill: row.column("shared_fill")?,
        filled_by: row.parsed_opt("filled_by")?,
        progress: None, // only in the server's memory
        waiting: None,  // depends on workers
        retry_at: row.moment_opt("not_before")?,
        alone: row.column("alone")?,
        failure_class: row.parsed_opt("failure_class")?,
        failure_message: row.column("failure_message")?,
        from_cache: row.column("from_cache")?,
        frames: frames_view(row)?,
        responses: row.json("responses")?,
        submitted_at: row.moment("submitted_at")?,
        started_at: row.moment_opt("started_at")?,
        ended_at: row.moment_opt("ended_at")?,
    })
}

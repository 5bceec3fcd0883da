//! Queries of sweeps.

use std::collections::HashMap;

use roost_api::ids::SweepId;
use roost_api::sweep::{FailureCounts, StateCounts, SweepView};

use super::columns::{Columns, to_json};
use super::database::{Builder, Row, query, query_as, query_scalar};
use super::jobs::push_label;
use super::{Store, StoreError};

/// Without the specification, which may be long, and without sweeps that are being submitted or deleted.
const VIEW: &str =
    "SELECT seq, id, name, design, points, replicates, runs_per_sample, factors, labels, submitted_at,
    EXISTS (SELECT 1 FROM studies WHERE sweep_id = sweeps.id) AS is_study FROM sweeps WHERE state = 'ready'";

/// Jobs of each sweep by state; a covering index serves it.
pub(super) const COUNTS: &str = "SELECT sweep_id, state, count(*) AS jobs FROM jobs
    WHERE sweep_id IN (SELECT atom FROM json_each(?)) GROUP BY sweep_id, state";
/// Paused jobs of each sweep; a partial index serves it.
pub(super) const PAUSED: &str = "SELECT sweep_id, count(*) AS jobs FROM jobs
    WHERE sweep_id IN (SELECT atom FROM json_each(?)) AND paused = 1 GROUP BY sweep_id";
/// Failed jobs of each sweep by class; a partial index serves it.
pub(super) const FAILURES: &str = "SELECT sweep_id, failure_class, count(*) AS jobs FROM jobs
    WHERE sweep_id IN (SELECT atom FROM json_each(?)) AND failure_class IS NOT NULL GROUP BY sweep_id, failure_class";

impl Store {
    /// One sweep.
    pub(crate) async fn sweep(&self, id: SweepId) -> Result<Option<SweepView>, StoreError> {
        let mut query = Builder::new(VIEW);
        let row =
            query.push(" AND id = ").push_bind(id.to_string()).build().fetch_optional(&self.readers).await?;
        let Some(row) = row else { return Ok(None) };
        Ok(self.with_counts(vec![sweep_view(&row)?]).await?.pop())
    }

    /// A sweep as it was submitted, as JSON text.
    pub(crate) async fn sweep_spec(&self, id: SweepId) -> Result<Option<String>, StoreError> {
        let sql = "SELECT spec FROM sweeps WHERE id = ? AND state = 'ready'";
        Ok(query_scalar(sql).bind(id.to_string()).fetch_optional(&self.readers).await?)
    }

    /// Points and replicates of a sweep; none once it is deleted.
    pub(crate) async fn sweep_size(&self, id: SweepId) -> Result<Option<(u32, u32)>, StoreError> {
        let sql = "SELECT points, replicates FROM sweeps WHERE id = ? AND state = 'ready'";
        Ok(query_as(sql).bind(id.to_string()).fetch_optional(&self.readers).await?)
    }

    /// Sweeps, newest first, and the row that the next page starts before.
    pub(crate) async fn sweeps(
        &self,
        label: Option<(String, Option<String>)>,
        before: Option<i64>,
        limit: u32,
    ) -> Result<(Vec<SweepView>, Option<i64>), StoreError> {
        let mut query = Builder::new(VIEW);
        query.push(" AND seq < ").push_bind(before.unwrap_or(i64::MAX));
        if let Some((key, value)) = label {
            query.push(" AND ");
            push_label(&mut query, "labels", &key, value.as_deref());
        }
        query.push(" ORDER BY seq DESC LIMIT ").push_bind(i64::from(limit) + 1);
        let mut rows = query.build().fetch_all(&self.readers).await?;
        let more = rows.len() > limit as usize;
        rows.truncate(limit as usize);
        let next = match rows.last() {
            Some(last) if more => Some(last.column("seq")?),
            _ => None,
        };
        let views = rows.iter().map(sweep_view).collect::<Result<Vec<_>, _>>()?;
        Ok((self.with_counts(views).await?, next))
    }

    /// Adds the counts, and the share of ended jobs. The caller adds the progress of running jobs.
    async fn with_counts(&self, mut views: Vec<SweepView>) -> Result<Vec<SweepView>, StoreError> {
        if views.is_empty() {
            return Ok(views);
        }
        let ids: Vec<_> = views.iter().map(|view| view.id).collect();
        let ids = to_json("ids", &ids)?;
        let mut counts: HashMap<SweepId, StateCounts> = HashMap::new();
        for row in query(COUNTS).bind(&ids).fetch_all(&self.readers).await? {
            let counts = counts.entry(row.parsed("sweep_id")?).or_default();
            *counts.of(row.parsed("state")?) = row.number("jobs")?;
        }
        let mut failures: HashMap<SweepId, FailureCounts> = HashMap::new();
        for row in query(FAILURES).bind(&ids).fetch_all(&self.readers).await? {
            let failures = failures.entry(row.parsed("sweep_id")?).or_default();
            *failures.of(row.parsed("failure_class")?) = row.number("jobs")?;
        }
        let mut paused: HashMap<SweepId, u64> = HashMap::new();
        for row in query(PAUSED).bind(&ids).fetch_all(&self.readers).await? {
            paused.insert(row.parsed("sweep_id")?, row.number("jobs")?);
        }
        for view in &mut views {
            view.paused = paused.get(&view.id).copied().unwrap_or_default();
            view.counts = counts.get(&view.id).copied().unwrap_or_default();
            view.failures = failures.get(&view.id).copied().unwrap_or_default();
            view.fraction = view.counts.ended() as f64 / view.counts.total().max(1) as f64;
        }
        Ok(views)
    }
}

fn sweep_view(row: &Row) -> Result<SweepView, StoreError> {
    Ok(SweepView {
        id: row.parsed("id")?,
        name: row.column("name")?,
        design: row.parsed("design")?,
        points: row.number("points")?,
        replicates: row.number("replicates")?,
        runs_per_sample: row.number_opt("runs_per_sample")?,
        factors: row.json("factors")?,
        counts: StateCounts::default(),
        paused: 0,
        failures: FailureCounts::default(),
        fraction: 0.0,
        submitted_at: row.moment("submitted_at")?,
        is_study: row.column("is_study")?,
    })
}

//! Projects: their shares, budgets and use. `roost project` writes them, with or without a running server.
//!
//! A trigger counts each attempt when it ends, as `queue` decides, so that no claim sums over attempts.

use std::collections::{BTreeMap, HashMap};

use roost_api::project::{MAX_BUDGET_CORE_HOURS, MAX_PROJECT_NAME, MAX_SHARE, ProjectView};

use super::columns::Columns;
use super::database::{Row, query, query_as};
use super::tokens::TokenFile;
use super::{Store, StoreError};
use crate::queue::{Owner, Project, SpentBudget};

const MS_PER_HOUR: f64 = 3_600_000.0;

/// Why a change of projects or tokens failed.
#[derive(Debug, thiserror::Error)]
pub enum ProjectError {
    /// The name of a project has other characters, or is too short or too long.
    #[error(
        "project name {0:?} is invalid: allowed are 1 to {MAX_PROJECT_NAME} of the characters a-z, A-Z, 0-9, `.`, `_` and `-`, and the first \
         one is a letter or digit"
    )]
    Name(String),
    /// The share is out of range.
    #[error("share {0} is out of range: allowed is 1 to {MAX_SHARE}")]
    Share(u32),
    /// The budget is out of range.
    #[error("budget of {0} core-hours is out of range: allowed is 0 to {MAX_BUDGET_CORE_HOURS:e}, or `none`")]
    Budget(f64),
    /// There is a project of this name.
    #[error("project {0} already exists: change it with `roost project set {0}`")]
    Exists(String),
    /// There is no project of this name.
    #[error(
        "project {0:?} does not exist: `roost project list` shows all projects, `roost project create` makes one"
    )]
    Unknown(String),
    /// The database cannot be used.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl From<sqlx::Error> for ProjectError {
    fn from(error: sqlx::Error) -> Self {
        Self::Store(error.into())
    }
}

/// New values of a project; none keeps the present one.
#[derive(Clone, Copy, Debug, Default)]
pub struct ProjectChange {
    /// Jobs of the project per round of claims.
    pub share: Option<u32>,
    /// Core-hours, or no limit.
    pub budget_core_hours: Option<Option<f64>>,
}

impl ProjectChange {
    /// Refuses values out of range. Returns the budget in milliseconds.
    fn checked(self) -> Result<Option<Option<i64>>, ProjectError> {
        if let Some(share) = self.share.filter(|share| !(1..=MAX_SHARE).contains(share)) {
            return Err(ProjectError::Share(share));
        }
        let in_ms = |hours: f64| {
            let is_allowed = (0.0..=MAX_BUDGET_CORE_HOURS).contains(&hours);
            is_allowed.then_some((hours * MS_PER_HOUR).round() as i64).ok_or(ProjectError::Budget(hours))
        };
        self.budget_core_hours.map(|budget| budget.map(in_ms).transpose()).transpose()
    }
}

/// Checks the name of a project.
fn checked_name(name: &str) -> Result<(), ProjectError> {
    let is_allowed = |letter: char| letter.is_ascii_alphanumeric() || "._-".contains(letter);
    let begins_well = name.starts_with(|first: char| first.is_ascii_alphanumeric());
    if begins_well && name.len() <= MAX_PROJECT_NAME && name.chars().all(is_allowed) {
        return Ok(());
    }
    Err(ProjectError::Name(name.to_owned()))
}

/// Queued and running jobs by project. It scans the part of the index of claims that has all queued jobs; the other parts read small
/// indexes. Jobs of hidden sweeps do not count.
pub(super) const COUNTS: &str = "
    SELECT o.project, counted.state, CAST(sum(counted.jobs) AS BIGINT) AS jobs FROM (
        SELECT owner, 'queued' AS state, count(*) AS jobs FROM jobs
        WHERE state = 'queued' AND not_before IS NULL AND paused = 0
          AND queue NOT IN (SELECT seq FROM sweeps WHERE state <> 'ready') GROUP BY owner
        UNION ALL SELECT owner, 'queued', count(*) FROM jobs WHERE not_before IS NOT NULL GROUP BY owner
        UNION ALL SELECT owner, 'queued', count(*) FROM jobs
                  WHERE paused = 1 AND state = 'queued' AND not_before IS NULL GROUP BY owner
        UNION ALL SELECT owner, 'running', count(*) FROM jobs WHERE state = 'running' AND lease_expires_at > 0 GROUP BY owner
    ) AS counted JOIN owners o ON o.id = counted.owner GROUP BY o.project, counted.state";

/// The values of a project, as a running server knows them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ProjectValues {
    /// Jobs of the project per round of claims.
    pub(crate) share: u32,
    /// Core-hours; none without a limit.
    pub(crate) budget_core_hours: Option<f64>,
    /// Whether its budget is used up.
    pub(crate) is_spent: bool,
}

impl ProjectValues {
    /// Whether jobs that waited because of the budget may be claimed now. A budget may be used up and raised between two looks.
    pub(crate) fn has_more_than(&self, before: &Self) -> bool {
        let budget = |values: &Self| values.budget_core_hours.unwrap_or(f64::INFINITY);
        budget(self) > budget(before) || (before.is_spent && !self.is_spent)
    }
}

impl Store {
    /// Counts the jobs of all projects. It takes longer with more queued jobs.
    pub(crate) async fn project_counts(&self) -> Result<ProjectCounts, StoreError> {
        counts(&query(COUNTS).fetch_all(&self.readers).await?)
    }

    /// Projects, newest first, and the row that the next page starts before.
    pub(crate) async fn projects(
        &self,
        before: Option<i64>,
        limit: u32,
        counts: &ProjectCounts,
    ) -> Result<(Vec<ProjectView>, Option<i64>), StoreError> {
        let sql = "SELECT * FROM projects WHERE id < ? ORDER BY id DESC LIMIT ?";
        let rows = query(sql)
            .bind(before.unwrap_or(i64::MAX))
            .bind(i64::from(limit) + 1)
            .fetch_all(&self.readers)
            .await?;
        let shown = &rows[..rows.len().min(limit as usize)];
        let next = match shown.last() {
            Some(last) if rows.len() > shown.len() => Some(last.column("id")?),
            _ => None,
        };
        Ok((views(shown, counts)?, next))
    }

    /// The project of an owner.
    pub(crate) async fn project_of(&self, owner: Owner) -> Result<Project, StoreError> {
        let sql = "SELECT p.id, p.share FROM owners o JOIN projects p ON p.id = o.project WHERE o.id = ?";
        let row = query(sql).bind(owner).fetch_one(&self.readers).await?;
        Ok(Project { id: row.column("id")?, share: row.number("share")? })
    }

    /// Why claims pass over the jobs of an owner; none while its project has budget left.
    pub(crate) async fn spent_budget(&self, owner: Owner) -> Result<Option<SpentBudget>, StoreError> {
        let sql = "SELECT p.* FROM owners o JOIN projects p ON p.id = o.project
                   WHERE o.id = ? AND p.budget_core_ms IS NOT NULL AND p.used_core_ms >= p.budget_core_ms";
        let row = query(sql).bind(owner).fetch_optional(&self.readers).await?;
        let spent = |row: Row| {
            let view = view(&row, &HashMap::new())?;
            let (used_core_hours, budget_core_hours) =
                (view.used_core_hours, view.budget_core_hours.unwrap_or_default());
            Ok(SpentBudget { project: view.name, used_core_hours, budget_core_hours })
        };
        row.map(spent).transpose()
    }

    /// The values of all projects by name.
    pub(crate) async fn project_values(&self) -> Result<BTreeMap<String, ProjectValues>, StoreError> {
        let rows = query("SELECT * FROM projects").fetch_all(&self.readers).await?;
        let values = |row: &Row| {
            let view = view(row, &HashMap::new())?;
            let (share, budget_core_hours, is_spent) =
                (view.share, view.budget_core_hours, view.is_used_up());
            Ok((view.name, ProjectValues { share, budget_core_hours, is_spent }))
        };
        rows.iter().map(values).collect()
    }
}

impl TokenFile {
    /// All projects, newest first.
    pub async fn projects(&mut self) -> Result<Vec<ProjectView>, StoreError> {
        let counts = counts(&query(COUNTS).fetch_all(&mut self.0).await?)?;
        views(&query("SELECT * FROM projects ORDER BY id DESC").fetch_all(&mut self.0).await?, &counts)
    }

    /// Creates a project. A share that is not given is 1, and without a budget there is no limit.
    pub async fn create_project(&mut self, name: &str, values: ProjectChange) -> Result<(), ProjectError> {
        checked_name(name)?;
        let budget = values.checked()?.flatten();
        let sql = "INSERT INTO projects (name, share, budget_core_ms) VALUES (?, ?, ?) ON CONFLICT (name) DO NOTHING";
        let done =
            query(sql).bind(name).bind(values.share.unwrap_or(1)).bind(budget).execute(&mut self.0).await?;
        if done.rows_affected() == 0 {
            return Err(ProjectError::Exists(name.to_owned()));
        }
        Ok(())
    }

    /// Changes a project. A running server follows within a second.
    pub async fn set_project(&mut self, name: &str, change: ProjectChange) -> Result<(), ProjectError> {
        let budget = change.checked()?;
        let id = self.project_id(name).await?;
        let sql = "UPDATE projects SET share = coalesce(?, share), budget_core_ms = CASE WHEN ? = 1 THEN ? ELSE budget_core_ms END
                   WHERE id = ?";
        query(sql)
            .bind(change.share)
            .bind(budget.is_some())
            .bind(budget.flatten())
            .bind(id)
            .execute(&mut self.0)
            .await?;
        Ok(())
    }

    /// One project, without the numbers of its jobs.
    pub async fn project(&mut self, name: &str) -> Result<ProjectView, ProjectError> {
        let sql = "SELECT * FROM projects WHERE name = ?";
        let found = query(sql).bind(name).fetch_optional(&mut self.0).await?;
        let row = found.ok_or_else(|| ProjectError::Unknown(name.to_owned()))?;
        Ok(view(&row, &HashMap::new())?)
    }

    /// The row of a project.
    pub(super) async fn project_id(&mut self, name: &str) -> Result<i64, ProjectError> {
        let row: Option<(i64,)> =
            query_as("SELECT id FROM projects WHERE name = ?").bind(name).fetch_optional(&mut self.0).await?;
        row.map(|(id,)| id).ok_or_else(|| ProjectError::Unknown(name.to_owned()))
    }
}

/// Number of jobs by project and state.
pub(crate) type ProjectCounts = HashMap<(i64, String), u64>;

fn counts(rows: &[Row]) -> Result<ProjectCounts, StoreError> {
    let count = |row: &Row| Ok(((row.column("project")?, row.column("state")?), row.number("jobs")?));
    rows.iter().map(count).collect()
}

fn views(rows: &[Row], counts: &ProjectCounts) -> Result<Vec<ProjectView>, StoreError> {
    rows.iter().map(|row| view(row, counts)).collect()
}

fn view(row: &Row, counts: &ProjectCounts) -> Result<ProjectView, StoreError> {
    let id: i64 = row.column("id")?;
    let jobs = |state: &str| counts.get(&(id, state.to_owned())).copied().unwrap_or(0);
    let hours = |ms: i64| ms as f64 / MS_PER_HOUR;
    Ok(ProjectView {
        name: row.column("name")?,
        share: row.number("share")?,
        budget_core_hours: row.column::<Option<i64>>("budget_core_ms")?.map(hours),
        used_core_hours: hours(row.column("used_core_ms")?),
        queued: jobs("queued"),
        running: jobs("running"),
    })
}

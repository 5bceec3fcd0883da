//! The predicted state of fills that jobs share, from the rules of `api.md` alone.

use std::collections::BTreeMap;

use roost_api::ids::JobId;
use roost_api::job::JobState;

use super::model::{Job, Model};

/// The scenarios with the same fill, and the backend of its workers.
pub(super) type FillKey = (usize, &'static str);

/// A fill that the server knows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fill {
    /// This attempt computes it.
    Computing(JobId, u32),
    /// It is stored.
    Stored,
    /// Jobs fill for themselves.
    Withdrawn,
}

pub(super) type Fills = BTreeMap<FillKey, Fill>;

impl Model {
    fn is_running(&self, (job, attempt): (JobId, u32)) -> bool {
        self.jobs.get(&job).is_some_and(|job| job.state == JobState::Running && job.newest() == attempt)
    }

    /// The fill of a job for workers of a backend; none if the job continues from a checkpoint.
    fn fill_of(job: &Job, backend: &'static str) -> Option<FillKey> {
        let resumes = job.checkpoint.is_some_and(|(.., of)| of == backend);
        job.fill.filter(|_| !resumes).map(|fill| (fill, backend))
    }

    /// Whether a running attempt computes the fill of a job.
    pub(super) fn waits(&self, job: &Job, backend: &'static str) -> bool {
        let fill = Self::fill_of(job, backend).and_then(|key| self.fills.get(&key));
        matches!(fill, Some(&Fill::Computing(job, attempt)) if self.is_running((job, attempt)))
    }

    /// The fill that an attempt of a job would compute.
    pub(super) fn computes(&self, job: &Job, backend: &'static str) -> Option<FillKey> {
        let known = |key: &FillKey| matches!(self.fills.get(key), Some(Fill::Stored | Fill::Withdrawn));
        Self::fill_of(job, backend).filter(|key| !known(key))
    }

    /// An attempt uploads the fill of its job; returns whether it is stored.
    pub(super) fn store_fill(&mut self, job: JobId, backend: &'static str) -> bool {
        let Some(fill) = self.jobs[&job].fill else { return false };
        self.fills.insert((fill, backend), Fill::Stored) != Some(Fill::Stored)
    }

    /// An attempt stores no fill, or cannot use the stored one; returns whether that withdraws it.
    pub(super) fn withdraw_fill(
        &mut self,
        (job, attempt): (JobId, u32),
        backend: &'static str,
        stored: bool,
    ) -> bool {
        let Some(fill) = self.jobs[&job].fill else { return false };
        let Some(known) = self.fills.get_mut(&(fill, backend)) else { return false };
        let may = *known == Fill::Computing(job, attempt) || stored && *known == Fill::Stored;
        if may {
            *known = Fill::Withdrawn;
        }
        may
    }

    /// Fills of attempts that have ended are forgotten.
    pub(super) fn forget_ended_fills(&mut self) {
        let fills = std::mem::take(&mut self.fills);
        let stays = |fill: &Fill| match *fill {
            Fill::Computing(job, attempt) => self.is_running((job, attempt)),
            Fill::Stored | Fill::Withdrawn => true,
        };
        self.fills = fills.into_iter().filter(|(_, fill)| stays(fill)).collect();
    }
}

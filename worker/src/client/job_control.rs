//! Cancel, pause, resume and retry of jobs and sweeps.

use reqwest::Method;
use roost_api::ids::{JobId, SweepId};
use roost_api::job::{FailureClass, JobView};
use roost_api::sweep::SweepView;
use serde::de::DeserializeOwned;

use super::{Client, ClientResult, SWEEP_TIMEOUT};

impl Client {
    /// Cancels a job.
    pub async fn cancel_job(&self, id: JobId) -> ClientResult<JobView> {
        self.change(&format!("jobs/{id}/cancel")).await
    }

    /// Cancels the queued and running jobs of a sweep.
    pub async fn cancel_sweep(&self, id: SweepId) -> ClientResult<SweepView> {
        self.change(&format!("sweeps/{id}/cancel")).await
    }

    /// Pauses a job that has not ended, or resumes it.
    pub async fn pause_job(&self, id: JobId, pause: bool) -> ClientResult<JobView> {
        self.change(&format!("jobs/{id}/{}", pause_or_resume(pause))).await
    }

    /// Pauses the jobs of a sweep that have not ended, or resumes them.
    pub async fn pause_sweep(&self, id: SweepId, pause: bool) -> ClientResult<SweepView> {
        self.change(&format!("sweeps/{id}/{}", pause_or_resume(pause))).await
    }

    /// Queues a failed or cancelled job again, if it failed with this class.
    pub async fn retry_job(&self, id: JobId, class: Option<FailureClass>) -> ClientResult<JobView> {
        self.retry(&format!("jobs/{id}/retry"), class).await
    }

    /// Queues the failed and cancelled jobs of a sweep again, or those that failed with this class.
    pub async fn retry_sweep(&self, id: SweepId, class: Option<FailureClass>) -> ClientResult<SweepView> {
        self.retry(&format!("sweeps/{id}/retry"), class).await
    }

    pub(super) async fn change<T: DeserializeOwned>(&self, route: &str) -> ClientResult<T> {
        self.fetch(self.request(Method::POST, route).timeout(SWEEP_TIMEOUT)).await
    }

    async fn retry<T: DeserializeOwned>(&self, route: &str, class: Option<FailureClass>) -> ClientResult<T> {
        let request = self.request(Method::POST, route);
        let request = request.query(&class.map(|class| [("class", class.as_str())]));
        self.fetch(request.timeout(SWEEP_TIMEOUT)).await
    }
}

pub(super) fn pause_or_resume(pause: bool) -> &'static str {
    if pause { "pause" } else { "resume" }
}

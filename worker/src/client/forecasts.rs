//! Forecasts of jobs, sweeps, studies, and of studies that are not submitted; the depth of the queue.

use reqwest::Method;
use roost_api::forecast::Forecast;
use roost_api::ids::{JobId, SweepId};
use roost_api::queue::QueueDepth;
use roost_api::validate::ValidationReport;
use serde_json::Value;

use super::{Client, ClientResult, SWEEP_TIMEOUT};

impl Client {
    /// When a job is expected to start and end, and why it waits.
    pub async fn job_forecast(&self, id: JobId) -> ClientResult<Forecast> {
        self.get(&format!("jobs/{id}/forecast")).await
    }

    /// The same of a sweep.
    pub async fn sweep_forecast(&self, id: SweepId) -> ClientResult<Forecast> {
        self.get(&format!("sweeps/{id}/forecast")).await
    }

    /// The same of a study.
    pub async fn study_forecast(&self, id: SweepId) -> ClientResult<Forecast> {
        self.get(&format!("studies/{id}/forecast")).await
    }

    /// The number of queued jobs by needs, beside the workers that could claim them.
    pub async fn queue_depth(&self) -> ClientResult<QueueDepth> {
        self.get("queue/depth").await
    }

    /// Checks a scenario, a sweep or a study, and forecasts its cost on the workers of the server.
    pub async fn validate(&self, document: &Value) -> ClientResult<ValidationReport> {
        let request = self.request(Method::POST, "validate");
        self.fetch(request.json(document).timeout(SWEEP_TIMEOUT)).await
    }
}

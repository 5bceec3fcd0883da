//! Studies: submit, show, answer, pause, resume, cancel, a larger budget, wider ranges, and runs that clients make.

use reqwest::Method;
use roost_api::ask::{Ask, Asked, Told};
use roost_api::ids::SweepId;
use roost_api::page::Page;
use roost_api::study::{BudgetChange, RangeChange, StudyAnswer, StudyView};
use serde_json::Value;

use super::job_control::pause_or_resume;
use super::{Client, ClientResult, SWEEP_TIMEOUT};

impl Client {
    /// Submits a study. A repeat with the same key within a day creates nothing and gets the first answer.
    pub async fn submit_study(&self, document: &Value, key: &str) -> ClientResult<StudyView> {
        let request = self.request(Method::POST, "studies").header("idempotency-key", key);
        self.fetch(request.json(document).timeout(SWEEP_TIMEOUT)).await
    }

    /// A page of studies, newest first.
    pub async fn studies(&self, cursor: Option<&str>, limit: u32) -> ClientResult<Page<StudyView>> {
        self.page("studies", None, cursor, limit).await
    }

    /// One study with its answer in words.
    pub async fn study(&self, id: SweepId) -> ClientResult<StudyView> {
        self.get(&format!("studies/{id}")).await
    }

    /// The answer of a study so far, as numbers with its evidence.
    pub async fn study_answer(&self, id: SweepId) -> ClientResult<StudyAnswer> {
        self.get(&format!("studies/{id}/answer")).await
    }

    /// Pauses a study and its jobs, or resumes them.
    pub async fn pause_study(&self, id: SweepId, pause: bool) -> ClientResult<StudyView> {
        self.change(&format!("studies/{id}/{}", pause_or_resume(pause))).await
    }

    /// Ends a study and cancels its jobs; its answer stays.
    pub async fn cancel_study(&self, id: SweepId) -> ClientResult<StudyView> {
        self.change(&format!("studies/{id}/cancel")).await
    }

    /// Sets the maximum number of runs of a study, which can only grow.
    pub async fn raise_study_budget(&self, id: SweepId, max_runs: u32) -> ClientResult<StudyView> {
        self.post(&format!("studies/{id}/budget"), &BudgetChange { max_runs }).await
    }

    /// Widens ranges of a study.
    pub async fn widen_study(&self, id: SweepId, change: &RangeChange) -> ClientResult<StudyView> {
        self.post(&format!("studies/{id}/ranges"), change).await
    }

    /// Asks a study for runs. A repeat with the same key within a day gets the same runs.
    pub async fn ask_study(&self, id: SweepId, ask: &Ask, key: &str) -> ClientResult<Asked> {
        let request = self.request(Method::POST, &format!("studies/{id}/ask")).header("idempotency-key", key);
        self.fetch(request.json(ask).timeout(SWEEP_TIMEOUT)).await
    }

    /// Tells a study outcomes of runs. A repeat changes nothing.
    pub async fn tell_study(&self, id: SweepId, document: &Value) -> ClientResult<Told> {
        let request = self.request(Method::POST, &format!("studies/{id}/tell"));
        self.fetch(request.json(document).timeout(SWEEP_TIMEOUT)).await
    }
}

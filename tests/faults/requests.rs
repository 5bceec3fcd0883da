//! Requests whose answers may be refusals, and a worker that only claims.

use std::collections::BTreeSet;

use roost_api::API_VERSION;
use roost_api::ids::WorkerId;
use roost_api::lease::ClaimRequest;
use roost_api::worker::WorkerRegistration;
use roost_solver::SOLVER_REVISION;
use serde_json::{Value, json};
use uuid::Uuid;

use crate::support::{Sandbox, hopper_scenario, wait_until};

/// Status and document of an answer.
pub(crate) type StatusAndJson = (u16, Value);

async fn read(request: reqwest::RequestBuilder) -> StatusAndJson {
    let answer = request.send().await.expect("an answer");
    (answer.status().as_u16(), answer.json().await.unwrap_or_default())
}

/// The answer to a GET.
pub(crate) fn get(sandbox: &Sandbox, path: &str) -> StatusAndJson {
    let url = format!("{}{path}", sandbox.address);
    sandbox.ask(|_| async move { read(reqwest::Client::new().get(url)).await })
}

/// The answer to a submission of a job.
pub(crate) fn submit(sandbox: &Sandbox, seed: u32) -> StatusAndJson {
    let mut scenario = hopper_scenario(0.2);
    scenario["seed"] = json!(seed);
    post(sandbox, &json!({"scenario": scenario}))
}

/// The answer to a submission of a document.
pub(crate) fn post(sandbox: &Sandbox, document: &Value) -> StatusAndJson {
    let request = reqwest::Client::new().post(format!("{}/v1/jobs", sandbox.address)).json(document);
    sandbox.ask(|_| async move { read(request).await })
}

/// The job of an accepted submission.
pub(crate) fn accepted((status, job): StatusAndJson) -> String {
    assert_eq!(status, 202, "{job}");
    job["id"].as_str().expect("an id").to_owned()
}

/// A refusal has a status and one sentence, with some words.
pub(crate) fn assert_refused((status, problem): StatusAndJson, expected: u16, words: &str) {
    let detail = problem["detail"].as_str().unwrap_or_default();
    assert_eq!(status, expected, "{problem}");
    assert!(detail.contains(words) && !detail.contains('\n'), "{words}: {problem}");
}

/// Waits until a server says that it is not ready, for a reason with these words.
pub(crate) fn wait_until_not_ready(sandbox: &Sandbox, words: &str) {
    wait_until("the server says why it is not ready", || {
        let (status, problem) = get(sandbox, "/readyz");
        (status == 503 && problem["detail"].as_str().is_some_and(|detail| detail.contains(words)))
            .then_some(())
    });
}

/// Waits until a server is ready.
pub(crate) fn wait_until_ready(sandbox: &Sandbox) {
    wait_until("the server is ready", || (get(sandbox, "/readyz").0 == 200).then_some(()));
}

/// A worker without a solver.
pub(crate) fn register(sandbox: &Sandbox) -> WorkerId {
    let worker_id = WorkerId::new();
    let worker = WorkerRegistration {
        worker_id,
        name: "a worker without a solver".to_owned(),
        api_version: API_VERSION.to_owned(),
        solver_revision: SOLVER_REVISION,
        backend: "cpu".to_owned(),
        device: "test".to_owned(),
        threads: 1,
        memory_mib: None,
    };
    sandbox.ask(|client| async move { client.register(&worker).await.expect("it is registered") });
    worker_id
}

/// A claim of a worker that waits for a job for some seconds.
pub(crate) fn claim_of(worker_id: WorkerId, wait_s: f64) -> ClaimRequest {
    ClaimRequest { request_id: Uuid::now_v7(), worker_id, max_jobs: 64, wait_s, shares_fills: false }
}

/// Each of these jobs is there and can be claimed, and no other one.
pub(crate) fn assert_claimable(sandbox: &Sandbox, jobs: &[String]) {
    let claim = claim_of(register(sandbox), 0.0);
    let reply = sandbox.ask(|client| async move { client.claim(&claim).await.expect("a reply") });
    let claimed: BTreeSet<String> = reply.attempts.iter().map(|attempt| attempt.job_id.to_string()).collect();
    assert_eq!(claimed, jobs.iter().cloned().collect());
}

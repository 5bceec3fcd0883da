//! A typed client of the HTTP API, for the worker and the `roost` command: one method for each route.
//!
//! It retries nothing; callers decide how long they wait.

mod checkpoints;
mod credentials;
mod error;
mod fills;
mod forecasts;
mod job_control;
mod reason;
mod recorded_frames;
mod studies;
#[cfg(test)]
pub(crate) mod tests;

use std::net::IpAddr;
use std::path::Path;
use std::time::Duration;

use reqwest::header::{CONTENT_LENGTH, CONTENT_TYPE, LOCATION};
use reqwest::redirect::Policy;
use reqwest::{Method, RequestBuilder, Url};
use roost_api::design::Extension;
use roost_api::frames;
use roost_api::ids::{JobId, SweepId, WorkerId};
use roost_api::job::{JobState, JobView};
use roost_api::lease::{
    ClaimReply, ClaimRequest, FailureReport, HeartbeatReply, HeartbeatRequest, ResultDelivery,
    ResultsDelivery, ResultsReply,
};
use roost_api::mesh::{self, MeshView};
use roost_api::page::Page;
use roost_api::prune::Pruning;
use roost_api::sweep::{Deletion, SweepView};
use roost_api::table::{SweepDifferences, SweepEffects, SweepPoints, SweepResults};
use roost_api::worker::{WorkerRegistration, WorkerView, WorkerWelcome};
use roost_api::{API_VERSION, RunResult};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::Value;
use tokio::io::AsyncWriteExt;

pub use checkpoints::EncodedCheckpoint;
pub(crate) use checkpoints::digest;
pub use credentials::{Credentials, prepare_tls};
pub use error::ClientError;
pub use recorded_frames::RecordedFrames;

/// The outcome of a call.
pub type ClientResult<T> = Result<T, ClientError>;

const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);
/// A connection that was idle for this long is not used again. The server closes it after twice that time, and a request at that moment
/// would be lost.
pub const MAX_IDLE: Duration = Duration::from_secs(5);
/// Timeout of a large file over a slow connection.
const FILE_TIMEOUT: Duration = Duration::from_secs(600);
/// Timeout of a change of a sweep: a million jobs take minutes.
const SWEEP_TIMEOUT: Duration = Duration::from_secs(3600);

/// A client of one server.
#[derive(Clone, Debug)]
pub struct Client {
    http: reqwest::Client,
    server: String,
}

impl Client {
    /// A client of the server at an address such as `http://127.0.0.1:7373`, without a token.
    pub fn new(server: &str) -> ClientResult<Self> {
        Self::with_credentials(server, &Credentials::default())
    }

    /// A client with credentials, for http or https.
    pub fn with_credentials(server: &str, credentials: &Credentials) -> ClientResult<Self> {
        let server = server.trim_end_matches('/').to_owned();
        let invalid = || ClientError::Address(server.clone());
        let url = Url::parse(&server).map_err(|_| invalid())?;
        let is_encrypted = url.scheme() == "https";
        let host = url.host_str().filter(|_| is_encrypted || url.scheme() == "http").ok_or_else(invalid)?;
        let mut builder = reqwest::Client::builder()
            .connect_timeout(CONNECT_TIMEOUT)
            .timeout(ANSWER_TIMEOUT)
            // A redirect would turn POST into GET, and its address might have an unchecked certificate.
            .redirect(Policy::none())
            .pool_idle_timeout(MAX_IDLE)
            .user_agent(concat!("roost/", env!("CARGO_PKG_VERSION")));
        // A proxy of the environment cannot reach loopback addresses.
        let ip = host.trim_matches(['[', ']']).parse::<IpAddr>();
        if host == "localhost" || ip.is_ok_and(|ip| ip.is_loopback()) {
            builder = builder.no_proxy();
        }
        let http = credentials.apply(builder, is_encrypted)?.build();
        let http = http.map_err(|error| credentials.error(&server, &error))?;
        Ok(Self { http, server })
    }

    /// The server's address.
    pub fn server(&self) -> &str {
        &self.server
    }

    // --- jobs -----------------------------------------------------------------------------------

    /// One job.
    pub async fn job(&self, id: JobId) -> ClientResult<JobView> {
        self.get(&format!("jobs/{id}")).await
    }

    /// A page of jobs, newest first, of all or one state.
    pub async fn jobs(
        &self,
        state: Option<JobState>,
        cursor: Option<&str>,
        limit: u32,
    ) -> ClientResult<Page<JobView>> {
        self.page("jobs", state, cursor, limit).await
    }

    /// The result of a job that has one; also one of an earlier version.
    pub async fn job_result(&self, id: JobId) -> ClientResult<RunResult> {
        let document = self.get(&format!("jobs/{id}/result")).await?;
        let unread = |reason| ClientError::Body { server: self.server.clone(), reason };
        RunResult::from_value(document).map_err(unread)
    }

    /// Downloads the frames of a job into a file.
    pub async fn download_frames(&self, id: JobId, into: &Path) -> ClientResult<()> {
        let unwritten =
            |error: std::io::Error| ClientError::File { path: into.to_owned(), reason: error.to_string() };
        let request = self.request(Method::GET, &format!("jobs/{id}/frames"));
        let mut response = self.send(request.timeout(FILE_TIMEOUT)).await?;
        let mut file = tokio::fs::File::create(into).await.map_err(unwritten)?;
        while let Some(chunk) =
            response.chunk().await.map_err(|error| ClientError::transport(&self.server, &error))?
        {
            file.write_all(&chunk).await.map_err(unwritten)?;
        }
        file.flush().await.map_err(unwritten)
    }

    // --- sweeps ---------------------------------------------------------------------------------

    /// Submits any document to `jobs` or `sweeps`; the server names its faults.
    pub async fn submit_document<T: DeserializeOwned>(
        &self,
        route: &str,
        document: &Value,
    ) -> ClientResult<T> {
        self.fetch(self.request(Method::POST, route).json(document).timeout(SWEEP_TIMEOUT)).await
    }

    /// A page of sweeps, newest first.
    pub async fn sweeps(&self, cursor: Option<&str>, limit: u32) -> ClientResult<Page<SweepView>> {
        self.page("sweeps", None, cursor, limit).await
    }

    /// One sweep with its progress.
    pub async fn sweep(&self, id: SweepId) -> ClientResult<SweepView> {
        self.get(&format!("sweeps/{id}")).await
    }

    /// A page of a sweep's jobs.
    pub async fn sweep_jobs(
        &self,
        id: SweepId,
        state: Option<JobState>,
        cursor: Option<&str>,
        limit: u32,
    ) -> ClientResult<Page<JobView>> {
        self.page(&format!("sweeps/{id}/jobs"), state, cursor, limit).await
    }

    /// The document of a sweep, as submitted.
    pub async fn sweep_spec(&self, id: SweepId) -> ClientResult<Value> {
        self.get(&format!("sweeps/{id}/spec")).await
    }

    /// The result table of a sweep.
    pub async fn sweep_results(&self, id: SweepId) -> ClientResult<SweepResults> {
        self.get(&format!("sweeps/{id}/results?format=json")).await
    }

    /// The results of a sweep by design point.
    pub async fn sweep_points(&self, id: SweepId) -> ClientResult<SweepPoints> {
        self.get(&format!("sweeps/{id}/results?by=point")).await
    }

    /// The result table of a sweep as a file. The query has at least the `format`: `csv`, `parquet` or `xlsx`.
    pub async fn sweep_table(&self, id: SweepId, query: &[(&str, &str)]) -> ClientResult<Vec<u8>> {
        let request = self.request(Method::GET, &format!("sweeps/{id}/results"));
        let request = request.query(query).timeout(FILE_TIMEOUT);
        let response = self.send(request).await?;
        let file = response.bytes().await.map_err(|error| ClientError::transport(&self.server, &error))?;
        Ok(file.into())
    }

    /// The effects of a sweep's factors on each response.
    pub async fn sweep_effects(&self, id: SweepId) -> ClientResult<SweepEffects> {
        self.get(&format!("sweeps/{id}/effects")).await
    }

    /// The difference of each response between two design points of a sweep.
    pub async fn sweep_differences(&self, id: SweepId, from: u32, to: u32) -> ClientResult<SweepDifferences> {
        self.get(&format!("sweeps/{id}/differences?from={from}&to={to}")).await
    }

    /// Adds points or replicates to a sweep.
    pub async fn extend_sweep(&self, id: SweepId, more: &Extension) -> ClientResult<SweepView> {
        let request = self.request(Method::POST, &format!("sweeps/{id}/extend"));
        self.fetch(request.json(more).timeout(SWEEP_TIMEOUT)).await
    }

    /// Deletes a sweep; a dry run only counts.
    pub async fn delete_sweep(&self, id: SweepId, dry_run: bool) -> ClientResult<Deletion> {
        let request = self.request(Method::DELETE, &format!("sweeps/{id}"));
        self.fetch(request.query(&[("dry_run", dry_run)]).timeout(SWEEP_TIMEOUT)).await
    }

    /// Deletes sweeps and jobs that ended longer ago than `age`; a dry run only lists them.
    pub async fn prune(&self, age: Duration, dry_run: bool) -> ClientResult<Pruning> {
        let request = self.request(Method::POST, "prune").query(&[("dry_run", dry_run)]);
        self.fetch(request.query(&[("older_than_s", age.as_secs_f64())]).timeout(FILE_TIMEOUT)).await
    }

    // --- meshes ---------------------------------------------------------------------------------

    /// The description of a mesh.
    pub async fn mesh(&self, digest: &str) -> ClientResult<MeshView> {
        self.get(&format!("meshes/{digest}")).await
    }

    /// Uploads an STL file; repeating it is safe.
    pub async fn upload_mesh(&self, file: Vec<u8>) -> ClientResult<MeshView> {
        let request = self.request(Method::POST, "meshes").header(CONTENT_TYPE, mesh::MEDIA_TYPE);
        self.fetch(request.body(file).timeout(FILE_TIMEOUT)).await
    }

    /// The STL file of a mesh; the caller checks its digest.
    pub async fn mesh_file(&self, digest: &str) -> ClientResult<Vec<u8>> {
        let request = self.request(Method::GET, &format!("meshes/{digest}/file"));
        let response = self.send(request.timeout(FILE_TIMEOUT)).await?;
        let file = response.bytes().await.map_err(|error| ClientError::transport(&self.server, &error))?;
        Ok(file.into())
    }

    // --- workers --------------------------------------------------------------------------------

    /// Registers a worker; repeating it is safe.
    pub async fn register(&self, worker: &WorkerRegistration) -> ClientResult<WorkerWelcome> {
        self.post("workers", worker).await
    }

    /// A page of workers, newest first.
    pub async fn workers(&self, cursor: Option<&str>, limit: u32) -> ClientResult<Page<WorkerView>> {
        self.page("workers", None, cursor, limit).await
    }

    /// Asks a worker to finish its jobs, claim no more, and exit.
    pub async fn drain(&self, worker: WorkerId) -> ClientResult<()> {
        self.send(self.request(Method::POST, &format!("workers/{worker}/drain"))).await.map(drop)
    }

    /// Claims jobs; the server waits for work as long as the request says.
    pub async fn claim(&self, claim: &ClaimRequest) -> ClientResult<ClaimReply> {
        let wait = Duration::try_from_secs_f64(claim.wait_s).unwrap_or_default();
        let request = self.request(Method::POST, "claims").json(claim).timeout(wait + CONNECT_TIMEOUT * 2);
        self.fetch(request).await
    }

    /// Sends the heartbeat of a worker.
    pub async fn heartbeat(
        &self,
        worker: WorkerId,
        beat: &HeartbeatRequest,
        timeout: Duration,
    ) -> ClientResult<HeartbeatReply> {
        let request = self.request(Method::POST, &format!("workers/{worker}/heartbeat")).json(beat);
        self.fetch(request.timeout(timeout)).await
    }

    /// Delivers a result; repeating it is safe.
    pub async fn deliver_result(&self, job: JobId, attempt: u32, body: &ResultDelivery) -> ClientResult<()> {
        let request = self.request(Method::POST, &format!("jobs/{job}/attempts/{attempt}/result"));
        self.send(request.json(body)).await.map(drop)
    }

    /// Delivers several results; repeating it is safe.
    pub async fn deliver_results(&self, body: &ResultsDelivery) -> ClientResult<ResultsReply> {
        self.post("results", body).await
    }

    /// Uploads the frames of an attempt, from a file; repeating it is safe.
    pub async fn upload_frames(
        &self,
        job: JobId,
        attempt: u32,
        worker: WorkerId,
        recorded: &RecordedFrames,
        stream: &Path,
    ) -> ClientResult<()> {
        let unread =
            |error: std::io::Error| ClientError::File { path: stream.to_owned(), reason: error.to_string() };
        let file = tokio::fs::File::open(stream).await.map_err(unread)?;
        let bytes = file.metadata().await.map_err(unread)?.len();
        let request = self.request(Method::PUT, &format!("jobs/{job}/attempts/{attempt}/frames"));
        let request = request
            .query(&[("worker_id", worker.to_string()), ("count", recorded.count.to_string())])
            .query(&recorded.stopped.as_ref().map(|why| [("stopped", why)]))
            .header(CONTENT_TYPE, frames::MEDIA_TYPE)
            .header(CONTENT_LENGTH, bytes);
        self.send(request.body(file).timeout(FILE_TIMEOUT)).await.map(drop)
    }

    /// Whether a server answers at the address.
    pub async fn is_reachable(&self) -> bool {
        let answer = self.http.get(format!("{}/healthz", self.server)).timeout(CONNECT_TIMEOUT).send().await;
        answer.is_ok_and(|response| response.status().is_success())
    }

    /// Reports an attempt that ended without the job's result; repeating it is safe.
    pub async fn report_failure(&self, job: JobId, attempt: u32, body: &FailureReport) -> ClientResult<()> {
        let request = self.request(Method::POST, &format!("jobs/{job}/attempts/{attempt}/failure"));
        self.send(request.json(body)).await.map(drop)
    }

    // --- requests---------------------------------------------------------------------------------

    async fn get<T: DeserializeOwned>(&self, route: &str) -> ClientResult<T> {
        self.fetch(self.request(Method::GET, route)).await
    }

    async fn post<T: DeserializeOwned>(&self, route: &str, body: &impl Serialize) -> ClientResult<T> {
        self.fetch(self.request(Method::POST, route).json(body)).await
    }

    async fn page<T: DeserializeOwned>(
        &self,
        route: &str,
        state: Option<JobState>,
        cursor: Option<&str>,
        limit: u32,
    ) -> ClientResult<Page<T>> {
        let mut request = self.request(Method::GET, route).query(&[("limit", limit)]);
        if let Some(state) = state {
            request = request.query(&[("state", state.as_str())]);
        }
        if let Some(cursor) = cursor {
            request = request.query(&[("cursor", cursor)]);
        }
        self.fetch(request).await
    }

    fn request(&self, method: Method, route: &str) -> RequestBuilder {
        self.http.request(method, format!("{}/{API_VERSION}/{route}", self.server))
    }

    async fn fetch<T: DeserializeOwned>(&self, request: RequestBuilder) -> ClientResult<T> {
        let response = self.send(request).await?;
        response.json().await.map_err(|error| ClientError::transport(&self.server, &error))
    }

    /// Sends a request; turns every error answer into an error.
    async fn send(&self, request: RequestBuilder) -> ClientResult<reqwest::Response> {
        let transport = |error: reqwest::Error| ClientError::transport(&self.server, &error);
        let response = request.send().await.map_err(transport)?;
        let status = response.status();
        if status.is_success() {
            return Ok(response);
        }
        if let Some(location) = response.headers().get(LOCATION).filter(|_| status.is_redirection()) {
            let location = String::from_utf8_lossy(location.as_bytes()).into_owned();
            return Err(ClientError::Redirected { server: self.server.clone(), location });
        }
        let body = response.text().await.map_err(transport)?;
        Err(match serde_json::from_str(&body) {
            Ok(problem) => ClientError::Problem(Box::new(problem)),
            Err(_) => ClientError::Foreign {
                server: self.server.clone(),
                status: status.as_u16(),
                body: body.chars().take(200).collect(),
            },
        })
    }
}

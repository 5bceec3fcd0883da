//! Sweeps: submit, look, cancel, retry, extend, delete.

use std::time::Duration;

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderName, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use roost_api::design::Extension;
use roost_api::ids::SweepId;
use roost_api::job::JobView;
use roost_api::page::Page;
use roost_api::problem::Problem;
use roost_api::sweep::{Deletion, SCHEMA, SweepSpec, SweepView};
use serde::Deserialize;
use serde_json::{Value, json};
use utoipa::IntoParams;
use uuid::Uuid;

use super::access::Caller;
use super::aside::{aside, to_its_end};
use super::at_hand::at_hand;
use super::audit::DryRun;
use super::extract::{Document, Params, Segments};
use super::jobs::{JobQuery, RetryQuery, list_filtered};
use super::page::{cursor, label, limit, limit_schema, page};
use super::priority;
use super::problem::{ApiError, Kind};
use super::submissions::Reserved;
use crate::app::App;
use crate::queue::Refusal;
use crate::store::{JobFilter, MoreOfSweep, NewSweep, Subject};
use crate::sweep::{self, SweepLimits};

/// Submits a sweep: base × design × replicates, all or nothing.
#[utoipa::path(post, path = "/v1/sweeps", tag = "sweeps", operation_id = "submit_sweep",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "Sent again with the same key, it is made once")),
    request_body = SweepSpec,
    responses((status = 201, description = "Expanded and queued", body = SweepView),
              (status = 422, description = "Every fault", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn submit(
    State(app): State<App>,
    axum::Extension(caller): axum::Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<SweepView>), ApiError> {
    let (id, to_make) = (SweepId(reserved.id()), app.clone());
    to_its_end(async move { make(&to_make, id, caller, document).await }).await??;
    let location = [(header::LOCATION, format!("/v1/sweeps/{id}"))];
    Ok((StatusCode::CREATED, location, Json(view(&app, id).await?)))
}

/// Expands and queues a sweep, whose meshes stay meanwhile. Many points take a while.
async fn make(app: &App, id: SweepId, caller: Caller, document: Value) -> Result<(), ApiError> {
    let limits = limits(app);
    let _open = app.mesh_gate.read().await;
    let meshes = at_hand(app, &document).await?;
    let sweep = aside(move || {
        let mut submitted = document.clone();
        let (spec, expansion) = sweep::read(document, &meshes, limits).map_err(ApiError::faults)?;
        priority::allow(&caller, "/priority", spec.priority)?;
        submitted["schema"] = json!(SCHEMA);
        let token = caller.0.as_ref().to_owned();
        NewSweep::new(id, token, &submitted, spec, expansion).map_err(ApiError::from)
    });
    app.store.insert_sweep(sweep.await??, app.clock.now()).await?;
    app.work.notify_waiters();
    Ok(())
}

fn limits(app: &App) -> SweepLimits {
    SweepLimits { max_jobs: app.config.max_jobs_per_sweep, scenario: app.config.limits }
}

/// Which sweeps to list.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct SweepQuery {
    /// Only sweeps with this label: `key` or `key=value`.
    #[serde(default, deserialize_with = "label")]
    #[param(value_type = Option<String>)]
    label: Option<(String, Option<String>)>,
    /// `next_cursor` of the page before.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

/// Lists sweeps, newest first.
#[utoipa::path(get, path = "/v1/sweeps", tag = "sweeps", operation_id = "list_sweeps", params(SweepQuery),
    responses((status = 200, description = "A page of sweeps", body = Page<SweepView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<SweepQuery>,
) -> Result<Response, ApiError> {
    let (mut sweeps, next) =
        app.store.sweeps(query.label, cursor(query.cursor)?, limit(query.limit)?).await?;
    for sweep in &mut sweeps {
        add_running(&app, sweep).await?;
    }
    Ok(page(&uri, sweeps, next))
}

/// One sweep with its counts.
#[utoipa::path(get, path = "/v1/sweeps/{id}", tag = "sweeps", operation_id = "show_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The sweep", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn show(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepView>, ApiError> {
    view(&app, id).await.map(Json)
}

/// The sweep as it was submitted: to be changed and submitted anew.
#[utoipa::path(get, path = "/v1/sweeps/{id}/spec", tag = "sweeps", operation_id = "sweep_spec",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The document `roost.sweep/1`", body = SweepSpec),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn spec(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Response, ApiError> {
    let text = app.store.sweep_spec(id).await?.ok_or(Refusal::NoSweep)?;
    Ok(([(header::CONTENT_TYPE, "application/json")], text).into_response())
}

/// The sweep as it is now. Its jobs are counted once for all who ask while nothing happens to them.
pub(super) async fn view(app: &App, id: SweepId) -> Result<SweepView, ApiError> {
    let version = version(app, id).await?;
    if let Some(view) = app.views.get(id, &version) {
        return Ok(view);
    }
    let mut sweep = app.store.sweep(id).await?.ok_or(Refusal::NoSweep)?;
    add_running(app, &mut sweep).await?;
    app.views.put(id, version, sweep.clone());
    Ok(sweep)
}

/// The sweep as it was at most so long ago, and whether it still is.
pub(super) async fn lately(app: &App, id: SweepId, age: Duration) -> Result<(SweepView, bool), ApiError> {
    let newest = app.views.get(id, &version(app, id).await?);
    if let (None, Some(view)) = (&newest, app.views.within(id, age)) {
        return Ok((view, false));
    }
    Ok((view(app, id).await?, true))
}

/// Another one whenever a view of the sweep may have changed.
pub(super) async fn version(app: &App, id: SweepId) -> Result<String, ApiError> {
    let subject = Subject::Sweep(id);
    let stored = app.store.version(subject).await?.ok_or(Refusal::NoSweep)?;
    Ok(format!("{stored}.{}", app.progress.version(subject)))
}

/// Adds what the running jobs have done to the share that is done.
async fn add_running(app: &App, sweep: &mut SweepView) -> Result<(), ApiError> {
    if sweep.counts.running > 0 {
        let running = app.store.running_jobs(sweep.id).await?;
        let share = app.progress.done(&running) / sweep.counts.total() as f64;
        sweep.fraction = (sweep.fraction + share).min(1.0);
    }
    Ok(())
}

/// Lists the jobs of a sweep, newest first.
#[utoipa::path(get, path = "/v1/sweeps/{id}/jobs", tag = "sweeps", operation_id = "list_sweep_jobs",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), JobQuery),
    responses((status = 200, description = "A page of jobs", body = Page<JobView>),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn jobs(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    uri: Uri,
    Params(query): Params<JobQuery>,
) -> Result<Response, ApiError> {
    app.store.sweep_size(id).await?.ok_or(Refusal::NoSweep)?;
    list_filtered(&app, &uri, JobFilter { sweep: Some(id), ..query.filter()? }).await
}

/// Cancels what of a sweep has not ended.
#[utoipa::path(post, path = "/v1/sweeps/{id}/cancel", tag = "sweeps", operation_id = "cancel_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The sweep as it is now", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn cancel(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepView>, ApiError> {
    app.store.cancel_sweep(id, app.clock.now()).await??;
    view(&app, id).await.map(Json)
}

/// Queues the failed and cancelled jobs of a sweep again, or only those that failed as `class`.
#[utoipa::path(post, path = "/v1/sweeps/{id}/retry", tag = "sweeps", operation_id = "retry_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), RetryQuery),
    responses((status = 200, description = "The sweep as it is now", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn retry(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<RetryQuery>,
) -> Result<Json<SweepView>, ApiError> {
    if app.store.retry_sweep(id, query.class).await?? > 0 {
        app.work.notify_waiters();
    }
    view(&app, id).await.map(Json)
}

/// Extensions of one sweep that are asked for at once take turns so many times.
const EXTEND_TRIES: u32 = 8;

/// Adds points of the same design, or replicates of every point, to a sweep; what is there stays as it is.
#[utoipa::path(post, path = "/v1/sweeps/{id}/extend", tag = "sweeps", operation_id = "extend_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"),
           ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "Sent again with the same key, it is made once")),
    request_body = Extension,
    responses((status = 200, description = "The sweep as it is now", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "Every fault, or why such a design cannot grow", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn extend(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    axum::Extension(caller): axum::Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<Json<SweepView>, ApiError> {
    // A repeat under the same key goes on with the same one.
    let (extension, to_grow) = (reserved.id(), app.clone());
    to_its_end(async move { grow(&to_grow, id, extension, &caller, document).await }).await??;
    view(&app, id).await.map(Json)
}

/// Adds to a sweep and queues what is new; the meshes stay meanwhile.
async fn grow(
    app: &App,
    id: SweepId,
    extension: Uuid,
    caller: &Caller,
    document: Value,
) -> Result<(), ApiError> {
    let _open = app.mesh_gate.read().await;
    for _ in 0..EXTEND_TRIES {
        if app.store.is_extended(extension).await? {
            return Ok(());
        }
        let stored = app.store.stored_sweep(id).await?.ok_or(Refusal::NoSweep)?;
        // The new jobs have the priority of the sweep, which may be one that only an admin may ask for.
        priority::allow(caller, "", stored.spec.priority)?;
        let meshes = at_hand(app, &json!([stored.spec.base, document])).await?;
        let (limits, asked, body) = (limits(app), document.clone(), document.clone());
        let grown =
            aside(move || sweep::extend(&stored, asked, &meshes, limits).map(|growth| (stored, growth)));
        let (stored, growth) = grown.await?.map_err(ApiError::faults)?;
        let has_more_replicates = growth.replicates > stored.replicates;
        let firsts = if has_more_replicates { app.store.first_scenarios(id).await? } else { Vec::new() };
        let token = caller.0.as_ref().to_owned();
        let more = aside(move || MoreOfSweep::new(id, (extension, &body), token, &stored, growth, firsts));
        let more = more.await??;
        if app.store.extend_sweep(more, app.clock.now()).await? {
            app.work.notify_waiters();
            return Ok(());
        }
    }
    Err(ApiError::new(Kind::Unavailable, "the sweep is being extended by others; try again"))
}

/// Whether to delete.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct DeleteQuery {
    /// Only say what would go.
    #[serde(default)]
    dry_run: bool,
}

/// Deletes a sweep with its points, jobs and results, or says what that would take away.
#[utoipa::path(delete, path = "/v1/sweeps/{id}", tag = "sweeps", operation_id = "delete_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), DeleteQuery),
    responses((status = 200, description = "What is gone, or would be", body = Deletion),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "Some of its jobs have not ended", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn delete(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<DeleteQuery>,
) -> Result<(Option<axum::Extension<DryRun>>, Json<Deletion>), ApiError> {
    let deletion = app.store.deletion(id).await?.ok_or(Refusal::NoSweep)?;
    let delete = || {
        let app = app.clone();
        to_its_end(async move { app.store.delete_sweep(id, app.clock.now()).await })
    };
    if !query.dry_run && !delete().await?? {
        let unended = deletion.unended;
        let detail = format!(
            "{unended} of its jobs have not ended: cancel the sweep first, and wait for those that run"
        );
        return Err(ApiError::new(Kind::WrongState, detail));
    }
    let dry_run = query.dry_run.then_some(axum::Extension(DryRun));
    Ok((dry_run, Json(Deletion { dry_run: query.dry_run, ..deletion })))
}

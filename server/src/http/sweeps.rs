//! Sweeps: submit, list, show, cancel, retry, pause, resume, extend, delete.

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

use super::audit::DryRun;
use super::blocking::{run_blocking, run_detached};
use super::extract::{Document, Params, Segments};
use super::jobs::{JobQuery, RetryQuery, list_filtered};
use super::page::{cursor, label, limit, limit_schema, page};
use super::posteriors;
use super::priority::check_priority;
use super::problem::{ApiError, ProblemKind};
use super::submissions::Reserved;
use crate::queue::Refusal;
use crate::state::{App, Caller};
use crate::store::{JobFilter, NewExtension, NewSweep, Subject};
use crate::sweep::{self, SweepLimits};

/// Submits a sweep: base × design × replicates. Either all of its jobs are queued or none.
#[utoipa::path(post, path = "/v1/sweeps", tag = "sweeps", operation_id = "submit_sweep",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "A repeat with the same key creates nothing new")),
    request_body = SweepSpec,
    responses((status = 201, description = "Expanded and queued", body = SweepView),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn submit(
    State(app): State<App>,
    axum::Extension(caller): axum::Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<SweepView>), ApiError> {
    let (id, state) = (SweepId(reserved.id()), app.clone());
    run_detached(async move { create(&state, id, caller, document).await }).await??;
    let location = [(header::LOCATION, format!("/v1/sweeps/{id}"))];
    Ok((StatusCode::CREATED, location, Json(view(&app, id).await?)))
}

/// Expands and queues a sweep, unless another request with the same key has done it. The lock prevents the deletion of its meshes meanwhile.
async fn create(app: &App, id: SweepId, caller: Caller, mut document: Value) -> Result<(), ApiError> {
    let _turn = app.submission_turns.wait(id).await;
    if app.store.sweep_size(id).await?.is_some() {
        return Ok(());
    }
    posteriors::fill_in(app, &mut document).await?;
    let limits = limits(app);
    let mesh_lock = app.mesh_gate.read().await;
    let meshes = app.mesh_cache.meshes_of(&document, &app.store).await?;
    let sweep = run_blocking(move || {
        let text = with_schema(&document);
        let (spec, expansion) = sweep::read(document, &meshes, limits).map_err(ApiError::faults)?;
        check_priority(&caller, "/priority", spec.priority)?;
        let token = caller.token.to_string();
        NewSweep::new(id, token, text, spec, expansion).map_err(ApiError::from)
    });
    app.store.insert_sweep(sweep.await??, app.clock.now(), mesh_lock).await?;
    app.work.notify_waiters();
    Ok(())
}

/// A submitted document with its schema, as JSON text. A long document is not copied a third time for its check.
fn with_schema(document: &Value) -> String {
    let mut document = document.clone();
    if let Some(fields) = document.as_object_mut() {
        fields.insert("schema".to_owned(), json!(SCHEMA));
    }
    document.to_string()
}

/// Limits of sweeps and studies.
pub(super) fn limits(app: &App) -> SweepLimits {
    SweepLimits { max_jobs: app.config.max_jobs_per_sweep, scenario: app.config.limits }
}

/// Query of a list of sweeps.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct SweepQuery {
    /// Only sweeps with this label: `key` or `key=value`.
    #[serde(default, deserialize_with = "label")]
    #[param(value_type = Option<String>)]
    label: Option<(String, Option<String>)>,
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Maximum of rows of the page.
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

/// Shows a sweep with its job counts.
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

/// Shows the document of a sweep as it was submitted.
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

/// The current view of a sweep. Its jobs are counted once per version.
pub(super) async fn view(app: &App, id: SweepId) -> Result<SweepView, ApiError> {
    let version = version(app, id).await?;
    if let Some(view) = app.sweep_views.get(id, &version) {
        return Ok(view);
    }
    let mut sweep = app.store.sweep(id).await?.ok_or(Refusal::NoSweep)?;
    add_running(app, &mut sweep).await?;
    app.sweep_views.insert(id, version, sweep.clone());
    Ok(sweep)
}

/// A view that is at most this old, and whether it is the newest.
pub(super) async fn recent_view(
    app: &App,
    id: SweepId,
    age: Duration,
) -> Result<(SweepView, bool), ApiError> {
    let newest = app.sweep_views.get(id, &version(app, id).await?);
    if let (None, Some(view)) = (&newest, app.sweep_views.get_recent(id, age)) {
        return Ok((view, false));
    }
    Ok((view(app, id).await?, true))
}

/// The version of a sweep: it changes whenever the view may have changed.
pub(super) async fn version(app: &App, id: SweepId) -> Result<String, ApiError> {
    let subject = Subject::Sweep(id);
    let stored = app.store.version(subject).await?.ok_or(Refusal::NoSweep)?;
    Ok(format!("{stored}.{}", app.progress.version(subject)))
}

/// Adds the progress of running jobs to the completed fraction.
async fn add_running(app: &App, sweep: &mut SweepView) -> Result<(), ApiError> {
    if sweep.counts.running > 0 {
        let running = app.store.running_jobs(sweep.id).await?;
        let share = app.progress.completed(&running) / sweep.counts.total() as f64;
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

/// Cancels the jobs of a sweep that have not ended.
#[utoipa::path(post, path = "/v1/sweeps/{id}/cancel", tag = "sweeps", operation_id = "cancel_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The sweep after the change", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn cancel(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepView>, ApiError> {
    let state = app.clone();
    run_detached(async move { state.store.cancel_sweep(id, state.clock.now()).await }).await???;
    view(&app, id).await.map(Json)
}

/// Queues the failed and cancelled jobs of a sweep again, or only those of the failure class `class`.
#[utoipa::path(post, path = "/v1/sweeps/{id}/retry", tag = "sweeps", operation_id = "retry_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), RetryQuery),
    responses((status = 200, description = "The sweep after the change", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn retry(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<RetryQuery>,
) -> Result<Json<SweepView>, ApiError> {
    let state = app.clone();
    let retry = async move {
        let retried = state.store.retry_sweep(id, query.class).await;
        // Also after a failure: some of its jobs may be queued.
        state.work.notify_waiters();
        retried
    };
    run_detached(retry).await???;
    view(&app, id).await.map(Json)
}

/// Pauses the jobs of a sweep that have not ended. Jobs that are added later are not paused.
#[utoipa::path(post, path = "/v1/sweeps/{id}/pause", tag = "sweeps", operation_id = "pause_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The sweep after the change", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn pause(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepView>, ApiError> {
    let state = app.clone();
    run_detached(async move { state.store.pause_sweep(id, true).await }).await???;
    view(&app, id).await.map(Json)
}

/// Resumes the paused jobs of a sweep.
#[utoipa::path(post, path = "/v1/sweeps/{id}/resume", tag = "sweeps", operation_id = "resume_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep")),
    responses((status = 200, description = "The sweep after the change", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn resume(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<SweepView>, ApiError> {
    let state = app.clone();
    let resume = async move {
        let resumed = state.store.pause_sweep(id, false).await;
        state.work.notify_waiters();
        resumed
    };
    run_detached(resume).await???;
    view(&app, id).await.map(Json)
}

/// Maximum of attempts while other extensions of the same sweep are committed.
const MAX_EXTEND_ATTEMPTS: u32 = 8;

/// Adds design points or replicates to a sweep. Existing jobs do not change.
#[utoipa::path(post, path = "/v1/sweeps/{id}/extend", tag = "sweeps", operation_id = "extend_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"),
           ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "A repeat with the same key creates nothing new")),
    request_body = Extension,
    responses((status = 200, description = "The sweep after the change", body = SweepView),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The sweep belongs to a study", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The document has faults, or the design cannot be extended; `errors` lists all faults", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn extend(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    axum::Extension(caller): axum::Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<Json<SweepView>, ApiError> {
    // A repeat with the same key uses the same identifier.
    let (extension, state) = (reserved.id(), app.clone());
    run_detached(async move { extend_once(&state, id, extension, &caller, document).await }).await??;
    view(&app, id).await.map(Json)
}

/// Extends a sweep and queues the new jobs. The lock prevents the deletion of its meshes meanwhile.
async fn extend_once(
    app: &App,
    id: SweepId,
    extension: Uuid,
    caller: &Caller,
    document: Value,
) -> Result<(), ApiError> {
    if app.store.is_study(id).await? {
        let detail = "a study adds the points of this sweep itself: raise the budget of the study, or submit a sweep of its own";
        return Err(ApiError::new(ProblemKind::WrongState, detail));
    }
    let _mesh_lock = app.mesh_gate.read().await;
    for _ in 0..MAX_EXTEND_ATTEMPTS {
        if app.store.is_extended(extension).await? {
            return Ok(());
        }
        let stored = app.store.stored_sweep(id).await?.ok_or(Refusal::NoSweep)?;
        // The new jobs get the priority of the sweep, which may be above the range of this token.
        check_priority(caller, "", stored.spec.priority)?;
        let meshes = app.mesh_cache.meshes_of(&json!([stored.spec.base, document]), &app.store).await?;
        let (limits, request, body) = (limits(app), document.clone(), document.clone());
        let extended = run_blocking(move || {
            sweep::extend(&stored, request, &meshes, limits).map(|growth| (stored, growth))
        });
        let (stored, growth) = extended.await?.map_err(ApiError::faults)?;
        let has_more_replicates = growth.replicates > stored.replicates;
        let firsts = if has_more_replicates { app.store.first_scenarios(id).await? } else { Vec::new() };
        let checked = run_blocking(move || {
            sweep::check_samples(&stored, growth.replicates, &firsts)?;
            Ok((stored, growth, firsts))
        });
        let (stored, growth, firsts) = checked.await?.map_err(ApiError::faults)?;
        let token = caller.token.to_string();
        let more =
            run_blocking(move || NewExtension::new(id, (extension, &body), token, &stored, growth, firsts));
        let more = more.await??;
        if app.store.extend_sweep(more, app.clock.now()).await? {
            app.work.notify_waiters();
            return Ok(());
        }
    }
    Err(ApiError::new(ProblemKind::Unavailable, "other requests are extending this sweep: try again"))
}

/// Query of a deletion.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct DeleteQuery {
    /// Only report what would be deleted.
    #[serde(default)]
    dry_run: bool,
}

/// Deletes a sweep with its points, jobs and results. With `dry_run`, only reports what would be deleted.
#[utoipa::path(delete, path = "/v1/sweeps/{id}", tag = "sweeps", operation_id = "delete_sweep",
    params(("id" = uuid::Uuid, Path, description = "The sweep"), DeleteQuery),
    responses((status = 200, description = "The deleted objects, or with `dry_run` those that would be", body = Deletion),
              (status = 404, description = "No such sweep", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "Some of its jobs have not ended, or its study goes on", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn delete(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Params(query): Params<DeleteQuery>,
) -> Result<(Option<axum::Extension<DryRun>>, Json<Deletion>), ApiError> {
    let deletion = app.store.deletion(id).await?.ok_or(Refusal::NoSweep)?;
    let delete = || {
        let app = app.clone();
        run_detached(async move { app.store.delete_sweep(id, app.clock.now()).await })
    };
    if !query.dry_run && !delete().await?? {
        // Another request may have deleted the sweep meanwhile.
        let unended = app.store.deletion(id).await?.ok_or(Refusal::NoSweep)?.unended;
        let detail = match unended {
            0 => "its study goes on: cancel the study first".to_owned(),
            _ => format!(
                "{unended} of its jobs have not ended: cancel the sweep and wait until running jobs have stopped"
            ),
        };
        return Err(ApiError::new(ProblemKind::WrongState, detail));
    }
    let dry_run = query.dry_run.then_some(axum::Extension(DryRun));
    Ok((dry_run, Json(Deletion { dry_run: query.dry_run, ..deletion })))
}

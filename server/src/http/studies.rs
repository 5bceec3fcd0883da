//! Studies: submit, list, show, answer, pause, resume, cancel, change budget and ranges.

use axum::Json;
use axum::extract::State;
use axum::http::{HeaderName, StatusCode, Uri, header};
use axum::response::Response;
use roost_api::ids::SweepId;
use roost_api::page::Page;
use roost_api::problem::Problem;
use roost_api::study::{
    BudgetChange, Driver, RangeChange, StudyAnswer, StudyRuns, StudySpec, StudyState, StudyView,
};
use serde::Deserialize;
use serde_json::{Value, json};
use utoipa::IntoParams;

use super::blocking::{run_blocking, run_detached};
use super::extract::{Document, Params, Segments};
use super::page::{cursor, limit, limit_schema, page};
use super::posteriors;
use super::priority::check_priority;
use super::problem::{ApiError, ProblemKind};
use super::seeding;
use super::submissions::Reserved;
use super::sweeps::limits;
use crate::decider::MIN_QUEUED;
use crate::document::{fault, prefixed, read_document};
use crate::queue::Refusal;
use crate::state::{App, Caller};
use crate::store::{NewStudy, StoredStudy};
use crate::study::{self, sentences};

/// Submits a study: a base scenario, factors with ranges, a goal and a budget. The server then proposes runs until it has the answer.
#[utoipa::path(post, path = "/v1/studies", tag = "studies", operation_id = "submit_study",
    params(("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "A repeat with the same key creates nothing new")),
    request_body = StudySpec,
    responses((status = 201, description = "Accepted; the first runs follow at once", body = StudyView),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn submit(
    State(app): State<App>,
    axum::Extension(caller): axum::Extension<Caller>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<(StatusCode, [(HeaderName, String); 1], Json<StudyView>), ApiError> {
    let (id, state) = (SweepId(reserved.id()), app.clone());
    run_detached(async move { create(&state, id, caller, document).await }).await??;
    let location = [(header::LOCATION, format!("/v1/studies/{id}"))];
    Ok((StatusCode::CREATED, location, Json(view_of(&app, id).await?)))
}

async fn create(app: &App, id: SweepId, caller: Caller, mut document: Value) -> Result<(), ApiError> {
    let _turn = app.submission_turns.wait(id).await;
    posteriors::fill_in(app, &mut document).await?;
    let limits = limits(app);
    let mesh_lock = app.mesh_gate.read().await;
    let meshes = app.mesh_cache.meshes_of(&document, &app.store).await?;
    let read = run_blocking(move || {
        let (study, _) = study::read(document, &meshes, limits).map_err(ApiError::faults)?;
        check_priority(&caller, "/priority", study.spec.priority)?;
        Ok::<_, ApiError>((study, caller.token.to_string()))
    });
    let (study, token) = read.await??;
    let runs = seeding::runs(app, &study.spec.seeded_by).await?;
    let decided = run_blocking(move || {
        let mut study = study;
        let wanted = if study.spec.driver == Driver::Client { 0 } else { MIN_QUEUED };
        let copies = seeding::copy(&mut study, runs).map_err(ApiError::faults)?;
        let first = study.decide(&[], &copies, wanted);
        let first = first.map_err(|faults| ApiError::faults(prefixed("/base", faults)))?;
        let (sweep, factors) = (study.sweep_spec(), study.factor_names());
        let question = study.question_sentence();
        let seeding = (study.seeding, copies);
        let study = NewStudy { id, spec: study.spec, question, sweep, factors, seeding, token };
        Ok::<_, ApiError>((study, first))
    });
    let (study, first) = decided.await??;
    app.store.insert_study(study, first, app.clock.now()).await?;
    drop(mesh_lock);
    app.work.notify_waiters();
    Ok(())
}

/// Query of a list of studies.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct StudyQuery {
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Maximum of rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

/// Lists studies, newest first.
#[utoipa::path(get, path = "/v1/studies", tag = "studies", operation_id = "list_studies", params(StudyQuery),
    responses((status = 200, description = "A page of studies", body = Page<StudyView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<StudyQuery>,
) -> Result<Response, ApiError> {
    let (studies, next) = app.store.studies(cursor(query.cursor)?, limit(query.limit)?).await?;
    let mut views = Vec::with_capacity(studies.len());
    for study in &studies {
        views.push(view(&app, study).await?);
    }
    Ok(page(&uri, views, next))
}

/// Shows a study with its answer in words.
#[utoipa::path(get, path = "/v1/studies/{id}", tag = "studies", operation_id = "show_study",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The study", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn show(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<StudyView>, ApiError> {
    view_of(&app, id).await.map(Json)
}

/// Shows the newest answer of a study as numbers, with its evidence.
#[utoipa::path(get, path = "/v1/studies/{id}/answer", tag = "studies", operation_id = "study_answer",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The answer so far", body = StudyAnswer),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn answer(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<StudyAnswer>, ApiError> {
    let stored = stored(&app, id).await?;
    let spec = stored.present()?.spec();
    Ok(Json(StudyAnswer {
        study: view(&app, &stored).await?,
        factors: spec.factors,
        goal: spec.goal,
        seeded_by: stored.seeding,
        answer: stored.answer.unwrap_or(Value::Null),
    }))
}

/// Pauses a study: nothing is proposed, and its jobs that have not ended are paused.
#[utoipa::path(post, path = "/v1/studies/{id}/pause", tag = "studies", operation_id = "pause_study",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The study after the change", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The study has ended", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn pause(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<StudyView>, ApiError> {
    set_paused(app, id, true).await
}

/// Resumes a paused study and its jobs.
#[utoipa::path(post, path = "/v1/studies/{id}/resume", tag = "studies", operation_id = "resume_study",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The study after the change", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The study has ended", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn resume(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<StudyView>, ApiError> {
    set_paused(app, id, false).await
}

async fn set_paused(app: App, id: SweepId, pause: bool) -> Result<Json<StudyView>, ApiError> {
    match stored(&app, id).await?.state {
        StudyState::Running | StudyState::Paused => {}
        StudyState::Cancelled => return Err(cancelled(id)),
        StudyState::Finished => {
            let detail = "the study is finished: a larger budget or wider ranges continue it";
            return Err(ApiError::new(ProblemKind::WrongState, detail));
        }
    }
    let shared = app.clone();
    let change = async move {
        let changed = shared.store.pause_sweep(id, pause).await;
        shared.work.notify_waiters();
        changed
    };
    run_detached(change).await???;
    view_of(&app, id).await.map(Json)
}

/// Ends a study, and cancels its jobs that have not ended. Its answer and its results stay.
#[utoipa::path(post, path = "/v1/studies/{id}/cancel", tag = "studies", operation_id = "cancel_study",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The study after the change", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn cancel(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<StudyView>, ApiError> {
    stored(&app, id).await?;
    let state = app.clone();
    run_detached(async move { state.store.cancel_sweep(id, state.clock.now()).await }).await???;
    view_of(&app, id).await.map(Json)
}

/// Raises the budget of a study. A study that had ended goes on.
#[utoipa::path(post, path = "/v1/studies/{id}/budget", tag = "studies", operation_id = "raise_study_budget",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    request_body = BudgetChange,
    responses((status = 200, description = "The study after the change", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The study is cancelled", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The budget is too small or too large", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn budget(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Document(document): Document,
) -> Result<Json<StudyView>, ApiError> {
    let change: BudgetChange = read_document(document).map_err(ApiError::faults)?;
    let study = stored(&app, id).await?;
    let (now, most) = (study.max_runs, app.config.max_jobs_per_sweep);
    if study.state == StudyState::Cancelled {
        return Err(cancelled(id));
    }
    // A smaller one would come too late: the runs are there.
    let is_raised = change.max_runs > now && u64::from(change.max_runs) <= most;
    if !is_raised || !app.store.raise_budget(id, change.max_runs).await? {
        let allowed = format!("more than {now} (the present budget), at most {most} (max_jobs_per_sweep)");
        let found = fault("/max_runs", json!(change.max_runs), "the budget can only grow", &allowed);
        return Err(ApiError::faults(vec![found]));
    }
    view_of(&app, id).await.map(Json)
}

/// Widens ranges of a study. All its runs are kept, and a study that had ended goes on.
#[utoipa::path(post, path = "/v1/studies/{id}/ranges", tag = "studies", operation_id = "widen_study_ranges",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    request_body = RangeChange,
    responses((status = 200, description = "The study after the change", body = StudyView),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The study is cancelled, or has changed meanwhile", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "A range would shrink, or its scenarios have faults", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn ranges(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Document(document): Document,
) -> Result<Json<StudyView>, ApiError> {
    let change: RangeChange = read_document(document).map_err(ApiError::faults)?;
    let study = stored(&app, id).await?;
    if study.state == StudyState::Cancelled {
        return Err(cancelled(id));
    }
    let (present, limits) = (study.present()?, limits(&app));
    let meshes = app.mesh_cache.meshes_of(&json!(present.submitted), &app.store).await?;
    let wider = run_blocking(move || study::widen(present, &change, &meshes, limits)).await?;
    if let Some((ranges, wider)) = wider.map_err(ApiError::faults)?
        && !app.store.widen(&study, &ranges, wider.question_sentence()).await?
    {
        let detail = "the study has changed meanwhile: look at it, and repeat the request";
        return Err(ApiError::new(ProblemKind::WrongState, detail));
    }
    view_of(&app, id).await.map(Json)
}

/// The refusal of a change of a cancelled study.
pub(super) fn cancelled(id: SweepId) -> ApiError {
    let detail =
        format!("the study is cancelled: POST /v1/sweeps/{id}/retry or `roost retry {id}` continues it");
    ApiError::new(ProblemKind::WrongState, detail)
}

pub(super) async fn stored(app: &App, id: SweepId) -> Result<StoredStudy, ApiError> {
    Ok(app.store.study(id).await?.ok_or(Refusal::NoStudy)?)
}

pub(super) async fn view_of(app: &App, id: SweepId) -> Result<StudyView, ApiError> {
    view(app, &stored(app, id).await?).await
}

async fn view(app: &App, stored: &StoredStudy) -> Result<StudyView, ApiError> {
    let sweep = app.store.sweep(stored.id).await?.ok_or(Refusal::NoStudy)?;
    let counts = sweep.counts;
    let mut answer = stored.sentences.clone();
    let state = (stored.state, stored.driver);
    answer.push(sentences::state(state, stored.finished, stored.max_runs, stored.reason.as_deref()));
    let observed = app.store.observed(stored.id).await?;
    Ok(StudyView {
        id: stored.id,
        name: sweep.name,
        state: stored.state,
        finished: stored.finished,
        question: stored.question.clone(),
        answer,
        factors: sweep.factors,
        runs: StudyRuns {
            done: counts.succeeded + observed.done,
            failed: counts.failed + observed.failed,
            cancelled: counts.cancelled,
            pending: counts.queued + counts.running + observed.handed_out,
            max_runs: u64::from(stored.max_runs),
            outside_budget: observed.outside_budget,
        },
        points: u64::from(sweep.points),
        submitted_at: stored.submitted_at,
        answered_at: stored.answered_at,
    })
}

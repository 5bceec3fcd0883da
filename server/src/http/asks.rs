//! Asking a study for runs, and telling it their outcomes.

use axum::Json;
use axum::extract::State;
use roost_api::Fault;
use roost_api::ask::{Ask, Asked, HandedOut, Tell, Told};
use roost_api::ids::SweepId;
use roost_api::problem::Problem;
use roost_api::study::StudyState;
use serde_json::json;
use uuid::Uuid;

use super::blocking::{run_blocking, run_detached};
use super::extract::{Document, Segments};
use super::problem::{ApiError, ProblemKind};
use super::studies::{cancelled, stored, view_of};
use super::submissions::Reserved;
use crate::decider::pause;
use crate::document::{fault, read_leniently, with_content_faults};
use crate::state::App;
use crate::store::{AskedRuns, Conflict, HandedOutRun, MAX_PROPOSALS, StoredStudy};
use crate::study::Study;

/// Seconds after which a run without an outcome may be handed out again, unless the client names others.
const EXPIRES_S: f64 = 86_400.0;
/// The refusal of points for a finished study.
const HAS_ANSWER: &str = "the study has its answer: wider ranges or a larger budget continue it";
/// The refusal of points while the last runs of a study end.
const WAITS: &str = "the answer is as certain as asked: the study only waits for the runs that have begun";
/// The refusal of clients that would run a calibration.
const CALIBRATION: &str = "only the server runs the tests of a calibration";
/// Decisions that may come between before a request is refused.
const TRIES: usize = 20;

/// Asks for runs. With `count` the client runs the study's next proposals itself; with `points` the server makes jobs at points of the client.
#[utoipa::path(post, path = "/v1/studies/{id}/ask", tag = "studies", operation_id = "ask_study",
    params(("id" = uuid::Uuid, Path, description = "The study"),
           ("Idempotency-Key" = Option<String>, Header, min_length = 1, max_length = 255,
            description = "A repeat with the same key hands out nothing new")),
    request_body = Ask,
    responses((status = 200, description = "The runs; none when the study is finished or awaits outcomes", body = Asked),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The study is paused, cancelled, has its answer, or has no point that can be run", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn ask(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    reserved: Reserved,
    Document(document): Document,
) -> Result<Json<Asked>, ApiError> {
    let (ask, listed) = read_leniently::<Ask>(document);
    let Some(ask) = ask else { return Err(ApiError::faults(listed)) };
    let faults = with_content_faults(listed, faults(&ask));
    if !faults.is_empty() && ask.points.is_none() {
        return Err(ApiError::faults(faults));
    }
    run_detached(async move { asked(&app, id, (ask, reserved.known()), faults).await }).await?.map(Json)
}

/// Faults of a request for runs.
fn faults(ask: &Ask) -> Vec<Fault> {
    let mut faults = Vec::new();
    if ask.points.is_some() {
        for (name, is_given) in [("count", ask.count.is_some()), ("expires_s", ask.expires_s.is_some())] {
            if is_given {
                let detail = "jobs at points of the client are not handed out";
                faults.push(fault(&format!("/{name}"), json!(true), detail, "left out with `points`"));
            }
        }
    }
    faults
}

/// Makes the runs of a request. With faults, those of its points are added, and no run is made.
async fn asked(
    app: &App,
    id: SweepId,
    (ask, request): (Ask, Option<Uuid>),
    faults: Vec<Fault>,
) -> Result<Asked, ApiError> {
    let _turn = app.submission_turns.wait(id).await;
    // The first request with this key has ended without its answer.
    if let Some(request) = request
        && let Some(made) = app.store.answered_ask(id, request).await?
    {
        let study = Study::stored(stored(app, id).await?.present()?).map_err(ApiError::faults)?;
        let runs = handed_out(&study, made.runs)?;
        return Ok(Asked { runs, jobs: made.jobs, study: view_of(app, id).await? });
    }
    for _ in 0..TRIES {
        let stored = stored(app, id).await?;
        if stored.state == StudyState::Finished && ask.points.is_none() {
            return Ok(Asked { runs: Vec::new(), jobs: Vec::new(), study: view_of(app, id).await? });
        }
        let obstacle = match stored.state {
            StudyState::Running => None,
            StudyState::Paused => Some("the study is paused: resume it to get runs"),
            StudyState::Finished => Some(HAS_ANSWER),
            StudyState::Cancelled => return Err(cancelled(id)),
        };
        if let Some(obstacle) = obstacle.or(stored.is_calibration().then_some(CALIBRATION)) {
            return Err(ApiError::new(ProblemKind::WrongState, obstacle));
        }
        if let Some(asked) = ask_once(app, &stored, (&ask, request), &faults).await? {
            return Ok(asked);
        }
    }
    let detail = "the study changes too often: try again later";
    Err(ApiError::new(ProblemKind::Unavailable, detail))
}

/// Decides and stores the decision with its runs; none when another decision came between.
async fn ask_once(
    app: &App,
    stored: &StoredStudy,
    (ask, request): (&Ask, Option<Uuid>),
    faults: &[Fault],
) -> Result<Option<Asked>, ApiError> {
    let id = stored.id;
    let (trials, observations) =
        (app.store.trials_of(id, 0..u32::MAX).await?, app.store.observations(id).await?);
    let (present, ask) = (stored.present()?, ask.clone());
    let has_no_points = ask.points.is_none();
    let expires_ms = (ask.expires_s.unwrap_or(EXPIRES_S) * 1000.0) as i64;
    let work = run_blocking(move || {
        let study = Study::stored(present)?;
        let (decided, runs) = match &ask.points {
            Some(points) => (study.add_points(&trials, &observations, (points, MAX_PROPOSALS))?, Vec::new()),
            None => study.hand_out(&trials, &observations, ask.count.unwrap_or(1) as usize)?,
        };
        Ok::<_, Vec<Fault>>((study, decided, runs))
    });
    let (study, decided, runs) = match work.await? {
        Ok(made) if faults.is_empty() => made,
        // No proposal can be run, and the document is not to blame.
        Err(found) if has_no_points && faults.is_empty() => {
            let reason = found.first().map(ToString::to_string).unwrap_or_default();
            pause(app, id, &reason).await?;
            let detail =
                format!("the server has paused the study, since it finds no point that can be run: {reason}");
            return Err(ApiError::new(ProblemKind::WrongState, detail));
        }
        made => {
            let found = made.err().unwrap_or_default();
            return Err(ApiError::faults(with_content_faults(faults.to_vec(), found)));
        }
    };
    if (decided.finished.is_some() || decided.is_met) && !decided.trials.is_empty() {
        let detail = if decided.finished.is_some() { HAS_ANSWER } else { WAITS };
        return Err(ApiError::new(ProblemKind::WrongState, detail));
    }
    let now = app.clock.now();
    let asked = AskedRuns { request, runs, expires_at: now.plus_ms(expires_ms) };
    let made = app.store.store_decision(stored, &study.sweep_spec(), decided, asked, now).await?;
    let Some(made) = made else { return Ok(None) };
    if !made.jobs.is_empty() {
        app.work.notify_waiters();
    }
    let runs = handed_out(&study, made.runs)?;
    Ok(Some(Asked { runs, jobs: made.jobs, study: view_of(app, id).await? }))
}

/// Runs that were handed out, with their scenarios.
fn handed_out(study: &Study, runs: Vec<HandedOutRun>) -> Result<Vec<HandedOut>, ApiError> {
    let run = |HandedOutRun { number, run, expires_at }| -> Result<HandedOut, ApiError> {
        let scenario = study.scenario_of(&run.levels, run.seed).map_err(ApiError::faults)?;
        Ok(HandedOut {
            run: number,
            values: run.levels,
            replicate: run.replicate,
            seed: run.seed,
            scenario: json!(scenario),
            expires_at,
        })
    };
    runs.into_iter().map(run).collect()
}

/// Shows the runs that were handed out and await their outcome.
#[utoipa::path(get, path = "/v1/studies/{id}/ask", tag = "studies", operation_id = "handed_out_runs",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    responses((status = 200, description = "The runs", body = Asked),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn list(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
) -> Result<Json<Asked>, ApiError> {
    let present = stored(&app, id).await?.present()?;
    let runs = app.store.handed_out_runs(id).await?;
    let runs = run_blocking(move || {
        let study = Study::stored(present).map_err(ApiError::faults)?;
        handed_out(&study, runs)
    });
    let runs = runs.await??;
    Ok(Json(Asked { runs, jobs: Vec::new(), study: view_of(&app, id).await? }))
}

/// Tells outcomes of runs that were handed out, or of runs at points of the client. A repeat of the same outcome changes nothing.
#[utoipa::path(post, path = "/v1/studies/{id}/tell", tag = "studies", operation_id = "tell_study",
    params(("id" = uuid::Uuid, Path, description = "The study")),
    request_body = Tell,
    responses((status = 200, description = "Recorded", body = Told),
              (status = 404, description = "No such study", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "A run has another outcome already, or the study is cancelled", body = Problem,
               content_type = "application/problem+json"),
              (status = 422, description = "The document has faults; `errors` lists all of them", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn tell(
    State(app): State<App>,
    Segments(id): Segments<SweepId>,
    Document(document): Document,
) -> Result<Json<Told>, ApiError> {
    let (tell, listed) = read_leniently::<Tell>(document);
    let Some(tell) = tell else { return Err(ApiError::faults(listed)) };
    let study = stored(&app, id).await?;
    if study.state == StudyState::Cancelled {
        return Err(cancelled(id));
    }
    if study.is_calibration() {
        return Err(ApiError::new(ProblemKind::WrongState, CALIBRATION));
    }
    let (present, handed_out) = (study.present()?, app.store.numbers_handed_out(id).await?);
    let told = run_blocking(move || match Study::stored(present)?.read_outcomes(&tell, &handed_out) {
        Ok(outcomes) if listed.is_empty() => Ok((outcomes, tell)),
        read => Err(with_content_faults(listed, read.err().unwrap_or_default())),
    });
    let (outcomes, tell) = told.await?.map_err(ApiError::faults)?;
    let now = app.clock.now();
    match app.store.tell(id, outcomes, now).await? {
        Ok((recorded, repeated)) => Ok(Json(Told { recorded, repeated, study: view_of(&app, id).await? })),
        Err(conflicts) => {
            let fault = |Conflict { index, known }| {
                let (at, told) = (format!("/outcomes/{index}"), json!(tell.outcomes[index]));
                fault(&at, told, "the run has another outcome already", &format!("{known}, or left out"))
            };
            Err(ApiError::at(ProblemKind::WrongState, conflicts.into_iter().map(fault).collect()))
        }
    }
}

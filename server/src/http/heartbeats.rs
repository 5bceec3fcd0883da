//! Heartbeats: one covers all attempts of a worker.

use axum::Json;
use axum::extract::State;
use roost_api::ids::WorkerId;
use roost_api::lease::{AttemptBeat, Directive, HeartbeatReply, HeartbeatRequest};
use roost_api::problem::Problem;
use serde_json::json;

use super::extract::{Body, Segments};
use super::problem::ApiError;
use crate::document::fault;
use crate::queue::lease_end;
use crate::state::App;
use crate::store::Beat;

/// Renews leases, takes progress and new samples, and answers a directive for each attempt.
#[utoipa::path(post, path = "/v1/workers/{id}/heartbeat", tag = "workers", operation_id = "heartbeat",
    params(("id" = uuid::Uuid, Path, description = "The worker")),
    request_body = HeartbeatRequest,
    responses((status = 200, description = "A directive per attempt, in the order of the request",
               body = HeartbeatReply),
              (status = 404, description = "The worker has not registered", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn heartbeat(
    State(app): State<App>,
    Segments(worker): Segments<WorkerId>,
    Body(request): Body<HeartbeatRequest>,
) -> Result<Json<HeartbeatReply>, ApiError> {
    let uneven = |(index, beat): (usize, &AttemptBeat)| {
        let part = beat.samples.iter().position(|part| part.t_s.len() != part.values.len())?;
        let at = format!("/attempts/{index}/samples/{part}/values");
        Some(fault(
            &at,
            json!(beat.samples[part].values.len()),
            "`values` and `t_s` differ in length",
            "one value per time",
        ))
    };
    let faults: Vec<_> = request.attempts.iter().enumerate().filter_map(uneven).collect();
    if !faults.is_empty() {
        return Err(ApiError::faults(faults));
    }
    let until = lease_end(app.clock.lease_now(), app.config.lease);
    let beats = request.attempts.iter().map(|beat| Beat { job_id: beat.job_id, attempt: beat.attempt });
    let mut reply = app.store.heartbeat(worker, beats.collect(), app.clock.now(), until).await??;
    for (beat, answer) in request.attempts.into_iter().zip(&mut reply.attempts) {
        let has_samples = beat.t0_s.is_some() || !beat.samples.is_empty();
        if answer.directive == Directive::Abandon || (beat.progress.is_none() && !has_samples) {
            continue;
        }
        let sweep = match app.progress.sweep_of(beat.job_id) {
            Some(sweep) => sweep,
            None => app.store.sweep_of(beat.job_id).await?,
        };
        if let Some(progress) = beat.progress {
            app.progress.set(beat.job_id, sweep, progress);
        }
        if has_samples {
            let attempt = (beat.job_id, beat.attempt);
            answer.missing_samples = app.progress.append(attempt, sweep, beat.t0_s, beat.samples);
            answer.resend_samples = !answer.missing_samples.is_empty();
        }
    }
    Ok(Json(reply))
}

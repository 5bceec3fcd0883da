//! Heartbeats: one covers everything that a worker runs.

use axum::Json;
use axum::extract::State;
use roost_api::ids::WorkerId;
use roost_api::lease::{Directive, HeartbeatReply, HeartbeatRequest};
use roost_api::problem::Problem;

use super::extract::{Body, Segments};
use super::problem::ApiError;
use crate::app::App;
use crate::queue::lease_end;
use crate::store::Beat;

/// Renews leases, notes progress, and says for each attempt what to do.
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
    let until = lease_end(app.clock.lease_now(), app.config.lease);
    let beats = request.attempts.iter().map(|beat| Beat { job_id: beat.job_id, attempt: beat.attempt });
    let reply = app.store.heartbeat(worker, beats.collect(), app.clock.now(), until).await??;
    for (beat, answer) in request.attempts.into_iter().zip(&reply.attempts) {
        if let (Some(progress), Directive::Continue | Directive::Cancel) = (beat.progress, answer.directive) {
            let sweep = match app.progress.sweep_of(beat.job_id) {
                Some(sweep) => sweep,
                None => app.store.sweep_of(beat.job_id).await?,
            };
            app.progress.set(beat.job_id, sweep, progress);
        }
    }
    Ok(Json(reply))
}

//! Claims: a worker asks for jobs, and waits until there are some.

use std::time::Duration;

use axum::Json;
use axum::extract::State;
use roost_api::checkpoint::CheckpointOrder;
use roost_api::lease::{ClaimReply, ClaimRequest};
use roost_api::problem::Problem;
use tokio::time::{Instant, sleep, sleep_until};

use super::extract::Body;
use super::problem::ApiError;
use crate::state::App;
use crate::store::Claim;

/// Interval between two claims for a job that the worker may only hold alone: nothing notifies it when its
/// other jobs end.
const CLAIM_AGAIN: Duration = Duration::from_millis(200);

/// Claims up to `max_jobs` jobs, waiting up to `wait_s` for the first.
#[utoipa::path(post, path = "/v1/claims", tag = "workers", operation_id = "claim",
    request_body = ClaimRequest,
    responses((status = 200, description = "The claimed attempts; empty without work", body = ClaimReply),
              (status = 404, description = "The worker has not registered", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn claim(
    State(app): State<App>,
    Body(request): Body<ClaimRequest>,
) -> Result<Json<ClaimReply>, ApiError> {
    let wait = Duration::from_secs_f64(request.wait_s.min(app.config.max_claim_wait.as_secs_f64()));
    let deadline = Instant::now() + wait;
    let claim = Claim {
        request_id: request.request_id,
        worker: request.worker_id,
        max_jobs: request.max_jobs,
        lease: app.config.lease,
        max_frames_bytes: app.config.max_frames_bytes,
        checkpoints: (!app.config.checkpoint_interval.is_zero()).then(|| CheckpointOrder {
            interval_s: app.config.checkpoint_interval.as_secs_f64(),
            limit_bytes: app.config.max_checkpoint_bytes,
        }),
        shares_fills: request.shares_fills && app.config.fill_limit_bytes > 0,
        max_fill_bytes: app.config.max_checkpoint_bytes.min(app.config.fill_limit_bytes),
    };
    let mut is_first = true;
    loop {
        // Subscribe first: work that arrives during the claim must wake it too.
        let work = app.work.notified();
        tokio::pin!(work);
        work.as_mut().enable();
        // Of many woken claims few find work: the others only read.
        let mut held_back = false;
        if std::mem::take(&mut is_first) || app.store.has_work(claim, app.clock.both()).await? {
            let claimed = app.store.claim(claim, app.clock.both()).await??;
            if let Some(held) = claimed.held_jobs {
                app.slots.record(claim.worker, held.saturating_add(claim.max_jobs));
            }
            if !claimed.attempts.is_empty() {
                for attempt in &claimed.attempts {
                    tracing::debug!(job = %attempt.job_id, attempt = attempt.attempt, "claimed");
                }
                return Ok(Json(ClaimReply { attempts: claimed.attempts }));
            }
            held_back = claimed.held_back;
        }
        tokio::select! {
            () = work => {}
            () = sleep(CLAIM_AGAIN), if held_back => {}
            () = sleep_until(deadline) => break,
            () = app.shutdown.cancelled() => break,
        }
    }
    Ok(Json(ClaimReply { attempts: Vec::new() }))
}

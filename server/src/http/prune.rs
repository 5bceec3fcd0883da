//! Deletion of old sweeps, jobs and meshes on request.

use axum::extract::State;
use axum::{Extension, Json};
use roost_api::problem::Problem;
use roost_api::prune::Pruning;
use serde::Deserialize;
use utoipa::IntoParams;

use super::audit::DryRun;
use super::blocking::run_detached;
use super::extract::Params;
use super::problem::{ApiError, ProblemKind};
use crate::state::App;

/// Query of a pruning.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct PruneQuery {
    /// Delete what ended longer ago than this, in seconds.
    older_than_s: f64,
    /// Only report what would be deleted.
    #[serde(default)]
    dry_run: bool,
}

/// Maximum age, a thousand years: a larger one is a typing error.
const MAX_AGE_S: f64 = 1000.0 * 365.0 * 86_400.0;

/// Deletes sweeps and single jobs that ended long ago, and meshes that nothing names. With `dry_run`, only reports them.
#[utoipa::path(post, path = "/v1/prune", tag = "server", operation_id = "prune", params(PruneQuery),
    responses((status = 200, description = "The deleted objects, or with `dry_run` those that would be", body = Pruning),
              (status = 400, description = "The age is missing or out of range", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The server's clock has jumped: nothing was deleted", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn prune(
    State(app): State<App>,
    Params(query): Params<PruneQuery>,
) -> Result<(Option<Extension<DryRun>>, Json<Pruning>), ApiError> {
    if !(0.0..=MAX_AGE_S).contains(&query.older_than_s) {
        let detail =
            format!("older_than_s {} is out of range: allowed is 0 to {MAX_AGE_S} s", query.older_than_s);
        return Err(ApiError::new(ProblemKind::InvalidQuery, detail));
    }
    if let Some(jump_ms) = app.clock.jump_ms().filter(|_| !query.dry_run) {
        let detail = format!(
            "the server's clock has jumped by {} s since the server started, so ages are wrong and nothing was deleted: correct \
             the clock, or restart the server if the clock is right",
            jump_ms / 1000
        );
        return Err(ApiError::new(ProblemKind::ClockJumped, detail));
    }
    let then = app.clock.now().plus_ms(-(query.older_than_s * 1000.0) as i64);
    if query.dry_run {
        return Ok((Some(Extension(DryRun)), Json(app.store.prunable(then).await?)));
    }
    Ok((None, Json(run_detached(async move { app.prune(then).await }).await??)))
}

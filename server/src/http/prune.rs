//! Retention by hand: what ended long ago goes.

use axum::extract::State;
use axum::{Extension, Json};
use roost_api::problem::Problem;
use roost_api::prune::Pruning;
use serde::Deserialize;
use utoipa::IntoParams;

use super::aside::to_its_end;
use super::audit::DryRun;
use super::extract::Params;
use super::problem::{ApiError, Kind};
use crate::app::App;

/// What to delete.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct PruneQuery {
    /// What ended longer ago than so many seconds.
    older_than_s: f64,
    /// Only say what would go.
    #[serde(default)]
    dry_run: bool,
}

/// The longest age, a thousand years: what is past it is a slip of the finger.
const MAX_AGE_S: f64 = 1000.0 * 365.0 * 86_400.0;

/// Deletes sweeps and single jobs that ended long ago, and meshes that nothing names any more; or says what would go.
#[utoipa::path(post, path = "/v1/prune", tag = "server", operation_id = "prune", params(PruneQuery),
    responses((status = 200, description = "What is gone, or would be", body = Pruning),
              (status = 400, description = "No age, or none that can be", body = Problem,
               content_type = "application/problem+json"),
              (status = 409, description = "The server's clock has jumped: nothing was deleted", body = Problem,
               content_type = "application/problem+json")))]
pub(crate) async fn prune(
    State(app): State<App>,
    Params(query): Params<PruneQuery>,
) -> Result<(Option<Extension<DryRun>>, Json<Pruning>), ApiError> {
    if !(0.0..=MAX_AGE_S).contains(&query.older_than_s) {
        let detail = format!("older_than_s: {} is no age; allowed: 0 to {MAX_AGE_S}", query.older_than_s);
        return Err(ApiError::new(Kind::InvalidQuery, detail));
    }
    if let Some(jump_ms) = app.clock.jump_ms().filter(|_| !query.dry_run) {
        let detail = format!(
            "the server's clock is {} s away from where it was when the server started, and ages cannot be trusted: nothing was deleted; \
             correct the clock, or restart the server if the clock is right",
            jump_ms / 1000
        );
        return Err(ApiError::new(Kind::ClockJumped, detail));
    }
    let then = app.clock.now().plus_ms(-(query.older_than_s * 1000.0) as i64);
    if query.dry_run {
        return Ok((Some(Extension(DryRun)), Json(app.store.prunable(then).await?)));
    }
    Ok((None, Json(to_its_end(async move { app.prune(then).await }).await??)))
}

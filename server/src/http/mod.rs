//! The HTTP API: a file per resource. This file has the list of routes.

mod access;
mod asks;
mod attempts;
mod audit;
mod blocking;
mod checkpoints;
mod claims;
mod dashboard;
mod delivery;
mod etags;
mod events;
mod extract;
mod fills;
mod forecasts;
mod frames;
mod front;
mod heartbeats;
mod jobs;
mod listener;
mod meshes;
mod meta;
mod metrics;
mod page;
mod parts;
mod posteriors;
mod priority;
mod problem;
mod projects;
mod prune;
mod results;
mod safety;
mod seeding;
mod series;
mod session;
mod sign_in;
mod spec;
mod stored_result;
mod studies;
mod submissions;
mod sweeps;
mod table_columns;
mod table_query;
mod table_rows;
mod tables;
#[cfg(test)]
mod tests;
mod traces;
mod upload;
mod validate;
mod workbooks;
mod workers;

use std::sync::Arc;

use axum::extract::DefaultBodyLimit;
use axum::http::{Method, Uri};
use axum::middleware::{from_fn, from_fn_with_state};
use axum::response::{IntoResponse, Response};
use axum::{Extension, Router};
use hyper_util::service::TowerToHyperService;
use tokio::net::TcpListener;
use tokio::sync::watch;
use tokio_util::sync::CancellationToken;
use tower_http::catch_panic::CatchPanicLayer;
use utoipa::OpenApi;
use utoipa_axum::router::OpenApiRouter;
use utoipa_axum::routes;
use utoipa_swagger_ui::{Config, SwaggerUi};

use crate::config::ServerConfig;
use crate::state::{App, Connections};
pub(crate) use delivery::budget_kib as delivery_budget_kib;
use extract::BodyLimit;
pub(crate) use front::Role;
use listener::Timeouts;
use problem::{ApiError, ProblemKind};
use roost_api::table::{SweepPoints, SweepResults};
pub(crate) use upload::MAX_UPLOADS;

/// Answers requests as the present role says until `stop`, then finishes those under way.
pub(crate) async fn serve(
    listener: TcpListener,
    roles: watch::Receiver<Role>,
    config: &ServerConfig,
    connections: Arc<Connections>,
    stop: CancellationToken,
) {
    let timeouts = Timeouts { head: config.head_timeout, body: config.body_timeout };
    listener::serve(listener, front::router(roles, stop.clone()), connections, timeouts, stop).await;
}

/// The role of a server that leads.
pub(crate) fn leading(app: App) -> Role {
    Role::Leads(TowerToHyperService::new(router(app)))
}

/// Title and description of the API; handlers add the routes.
#[derive(OpenApi)]
#[openapi(
    info(
        title = "Roost",
        description = "Distributed parameter sweeps of bonded-particle DEM simulations of soft food. \
                   Every error is an `application/problem+json` document."
    ),
    components(schemas(SweepResults, SweepPoints))
)]
struct Api;

/// The OpenAPI document of the HTTP API as JSON, made without a running server.
pub fn openapi() -> String {
    let (_, mut spec) = routes(&ServerConfig::default(), |router| router).split_for_parts();
    spec::complete(&mut spec);
    spec.to_json().expect("the document is JSON")
}

/// Every route, with its documentation; `made_once` adds the layer that answers a repeated submission like the first.
fn routes(
    config: &ServerConfig,
    made_once: impl FnOnce(OpenApiRouter<App>) -> OpenApiRouter<App>,
) -> OpenApiRouter<App> {
    let small = limited(config.max_body_bytes);
    let large = limited(config.max_result_bytes);
    let files = limited(config.max_mesh_bytes);
    let submissions = OpenApiRouter::new()
        .routes(routes!(jobs::submit))
        .routes(routes!(sweeps::submit))
        .routes(routes!(sweeps::extend))
        .routes(routes!(studies::submit))
        .routes(routes!(asks::ask));
    let submissions = made_once(submissions).layer(small);
    let users = OpenApiRouter::new()
        .routes(routes!(jobs::list))
        .routes(routes!(events::of_job))
        .routes(routes!(events::of_sweep))
        .routes(routes!(jobs::show))
        .routes(routes!(forecasts::of_job))
        .routes(routes!(forecasts::of_sweep))
        .routes(routes!(forecasts::of_queue))
        .routes(routes!(forecasts::of_study))
        .routes(routes!(forecasts::validate_study))
        .routes(routes!(results::result))
        .routes(routes!(results::series))
        .routes(routes!(frames::frames))
        .routes(routes!(jobs::cancel))
        .routes(routes!(jobs::retry))
        .routes(routes!(jobs::pause))
        .routes(routes!(jobs::resume))
        .routes(routes!(sweeps::list))
        .routes(routes!(sweeps::show, sweeps::delete))
        .routes(routes!(sweeps::jobs))
        .routes(routes!(sweeps::spec))
        .routes(routes!(tables::table))
        .routes(routes!(sweeps::cancel))
        .routes(routes!(sweeps::retry))
        .routes(routes!(sweeps::pause))
        .routes(routes!(sweeps::resume))
        .routes(routes!(studies::list))
        .routes(routes!(studies::show))
        .routes(routes!(studies::answer))
        .routes(routes!(studies::pause))
        .routes(routes!(studies::resume))
        .routes(routes!(studies::cancel))
        .routes(routes!(studies::budget))
        .routes(routes!(studies::ranges))
        .routes(routes!(asks::list))
        .routes(routes!(asks::tell))
        .routes(routes!(results::effects))
        .routes(routes!(results::differences))
        .routes(routes!(series::of_sweep))
        .routes(routes!(validate::validate))
        .routes(routes!(meta::scenario_schema))
        .routes(routes!(meta::sweep_schema))
        .routes(routes!(meta::responses))
        .routes(routes!(meta::parameters))
        .routes(routes!(meta::version))
        .routes(routes!(projects::list))
        .routes(routes!(prune::prune))
        .routes(routes!(workers::register, workers::list))
        .routes(routes!(workers::drain))
        .routes(routes!(claims::claim))
        .routes(routes!(heartbeats::heartbeat))
        .routes(routes!(meta::healthz))
        .routes(routes!(meta::readyz))
        .routes(routes!(meta::openapi))
        .routes(routes!(metrics::metrics))
        .layer(small);
    let deliveries = OpenApiRouter::new()
        .routes(routes!(attempts::result))
        .routes(routes!(attempts::results))
        .routes(routes!(attempts::failure))
        // These have their own limits, since they are streamed to disk.
        .routes(routes!(frames::upload))
        .routes(routes!(checkpoints::upload, checkpoints::download, checkpoints::discard))
        .routes(routes!(fills::upload, fills::download, fills::withdraw))
        .layer(large);
    let meshes = OpenApiRouter::new()
        .routes(routes!(meshes::upload, meshes::list))
        .routes(routes!(meshes::show))
        .routes(routes!(meshes::file))
        .layer(files);
    OpenApiRouter::with_openapi(Api::openapi())
        .merge(submissions)
        .merge(users)
        .merge(deliveries)
        .merge(meshes)
}

/// A layer that limits request bodies, and an extension with the limit for error texts.
fn limited(bytes: usize) -> (DefaultBodyLimit, Extension<BodyLimit>) {
    (DefaultBodyLimit::max(bytes), Extension(BodyLimit(bytes)))
}

fn router(app: App) -> Router {
    let once = from_fn_with_state(app.clone(), submissions::once);
    let (router, mut spec) = routes(&app.config, |router| router.layer(once)).split_for_parts();
    spec::complete(&mut spec);
    // The page of the API documentation is embedded and loads nothing from other servers.
    let docs = SwaggerUi::new("/docs").config(Config::from("/openapi.json"));
    router
        .merge(docs)
        .merge(dashboard::router())
        .merge(sign_in::router())
        .fallback(unknown_path)
        .method_not_allowed_fallback(wrong_method)
        .layer(from_fn_with_state(app.clone(), etags::add_etag))
        .layer(from_fn_with_state(app.clone(), access::guard))
        .layer(from_fn_with_state(app.clone(), metrics::measure))
        .layer(Extension(meta::Spec::new(&spec)))
        .layer(CatchPanicLayer::custom(panicked))
        .layer(from_fn(safety::complete))
        .layer(from_fn(audit::identify))
        .layer(traces::layer())
        .with_state(app)
}

async fn unknown_path(uri: Uri) -> ApiError {
    ApiError::new(
        ProblemKind::NotFound,
        format!("there is no path {}: /openapi.json lists all paths", uri.path()),
    )
}

async fn wrong_method(method: Method, uri: Uri) -> ApiError {
    ApiError::new(
        ProblemKind::MethodNotAllowed,
        format!("{} does not support {method}: the header `allow` lists its methods", uri.path()),
    )
}

fn panicked(panic: Box<dyn std::any::Any + Send>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    tracing::error!(message, "a request handler panicked");
    ApiError::new(ProblemKind::Internal, "this is a bug: please report it with the server's log")
        .into_response()
}

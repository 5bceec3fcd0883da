//! Projects: list, with shares, budgets and use.

use axum::extract::State;
use axum::http::Uri;
use axum::response::Response;
use roost_api::page::Page;
use roost_api::project::ProjectView;
use serde::Deserialize;
use utoipa::IntoParams;

use super::extract::Params;
use super::page::{cursor, limit, limit_schema, page};
use super::problem::ApiError;
use crate::state::App;

/// Query of a list of projects.
#[derive(Deserialize, IntoParams)]
#[serde(deny_unknown_fields)]
#[into_params(parameter_in = Query)]
pub(crate) struct ProjectQuery {
    /// `next_cursor` of the previous page.
    #[param(value_type = Option<String>)]
    cursor: Option<i64>,
    /// Maximum of rows of the page.
    #[param(schema_with = limit_schema)]
    limit: Option<u32>,
}

/// Lists projects, newest first, with their shares, budgets, core-hours and jobs.
#[utoipa::path(get, path = "/v1/projects", tag = "projects", operation_id = "list_projects", params(ProjectQuery),
    responses((status = 200, description = "A page of projects", body = Page<ProjectView>)))]
pub(crate) async fn list(
    State(app): State<App>,
    uri: Uri,
    Params(query): Params<ProjectQuery>,
) -> Result<Response, ApiError> {
    let (before, limit) = (cursor(query.cursor)?, limit(query.limit)?);
    let (projects, next) = app.store.projects(before, limit, &*app.project_counts().await?).await?;
    Ok(page(&uri, projects, next))
}

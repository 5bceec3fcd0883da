//! The range of priorities that a caller may use.
//!
//! A priority outside the range is answered 403, not 422: the document is valid, and another token may submit
//! it. Validation therefore does not report it.

use roost_api::job::MAX_SUBMIT_PRIORITY;
use roost_api::token::Scope;
use serde_json::json;

use super::problem::{ApiError, ProblemKind};
use crate::document::fault;
use crate::state::Caller;

/// Checks that the caller may use a priority, which is at `pointer` in the document. An open server has no
/// limit.
pub(super) fn check_priority(caller: &Caller, pointer: &str, priority: i32) -> Result<(), ApiError> {
    let has_limit = !caller.is_unrestricted() && !caller.scopes.contains(&Scope::Admin);
    if !has_limit || priority.unsigned_abs() <= MAX_SUBMIT_PRIORITY {
        return Ok(());
    }
    let detail = "this token does not allow this priority";
    let allowed =
        format!("-{MAX_SUBMIT_PRIORITY} to {MAX_SUBMIT_PRIORITY}, or any with a token of the scope admin");
    Err(ApiError::at(ProblemKind::Forbidden, vec![fault(pointer, json!(priority), detail, &allowed)]))
}

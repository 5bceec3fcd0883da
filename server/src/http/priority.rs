//! The priority that a caller may ask for.
//!
//! One out of range is answered 403, not 422: the document is sound, and another token may submit it. So it is no fault of
//! validation either, which knows no token.

use roost_api::job::MAX_SUBMIT_PRIORITY;
use roost_api::token::Scope;
use serde_json::json;

use super::access::Caller;
use super::problem::{ApiError, Kind};
use crate::document::fault;

/// Refuses jobs of a priority that takes the scope `admin`; `pointer` is where the document asks for it. A server without tokens has no
/// limit.
pub(super) fn allow(caller: &Caller, pointer: &str, priority: i32) -> Result<(), ApiError> {
    let Caller(token, scopes) = caller;
    if token.is_empty() || scopes.contains(&Scope::Admin) || priority.unsigned_abs() <= MAX_SUBMIT_PRIORITY {
        return Ok(());
    }
    let detail = "this token does not allow this priority";
    let allowed = format!("-{MAX_SUBMIT_PRIORITY} to {MAX_SUBMIT_PRIORITY}, or any with the scope admin");
    Err(ApiError::at(Kind::Forbidden, vec![fault(pointer, json!(priority), detail, &allowed)]))
}

//! The audit log: lines with the target `audit`, without what only an HTTP request has.
//!
//! Refusals are limited to some lines a second, so that a flood of strangers cannot fill the disk. The next
//! line then states how many were left out.

use std::num::NonZeroU32;
use std::sync::atomic::{AtomicU64, Ordering};

use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};

use crate::store::{ProjectValues, Token};

/// Refusals that are logged in one second; a burst of as many is logged at once.
const REFUSALS_PER_S: NonZeroU32 = NonZeroU32::new(20).unwrap();

/// Maximum length of client text in a line, in bytes.
pub(crate) const MAX_TEXT_BYTES: usize = 200;

/// Limits the lines about refusals.
pub(crate) struct RefusalLimit {
    rate: DefaultDirectRateLimiter,
    left_out: AtomicU64,
}

impl Default for RefusalLimit {
    fn default() -> Self {
        Self { rate: RateLimiter::direct(Quota::per_second(REFUSALS_PER_S)), left_out: AtomicU64::new(0) }
    }
}

impl RefusalLimit {
    /// None if the next line shall be left out; otherwise the number of lines that were left out before it.
    pub(crate) fn take(&self) -> Option<u64> {
        if self.rate.check().is_err() {
            self.left_out.fetch_add(1, Ordering::Relaxed);
            return None;
        }
        Some(self.left_out.swap(0, Ordering::Relaxed))
    }
}

/// The start of a text, short enough for a line.
pub(crate) fn shortened(text: &str) -> &str {
    &text[..text.floor_char_boundary(MAX_TEXT_BYTES)]
}

/// Logs a token that `roost token` made or revoked.
pub(super) fn log_token(action: &'static str, token: &Token) {
    let scopes: Vec<_> = token.scopes.iter().map(|scope| scope.as_str()).collect();
    tracing::info!(
        target: "audit", action, token = token.id, name = shortened(&token.name), user = shortened(&token.user), project = token.project,
        scopes = scopes.join(" "), "done"
    );
}

/// Logs a project that `roost project` made or changed. The use of its budget is no change.
pub(super) fn log_project(project: &str, before: Option<&ProjectValues>, values: &ProjectValues) {
    let of = |values: &ProjectValues| (values.share, values.budget_core_hours);
    let budget = |values: &ProjectValues| {
        values.budget_core_hours.map_or_else(|| "none".to_owned(), |hours| hours.to_string())
    };
    let action = match before {
        None => "project_create",
        Some(before) if of(before) != of(values) => "project_set",
        Some(_) => return,
    };
    tracing::info!(
        target: "audit", action, project, share = values.share, budget_core_hours = budget(values),
        share_before = before.map(|before| before.share), budget_core_hours_before = before.map(budget), "done"
    );
}

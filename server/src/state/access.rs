//! Access tokens in effect: who may do what, and how often.
//!
//! A server is open only while no token has ever existed and its address is a loopback address. Afterwards
//! every caller needs a valid token. Losing the last token closes the server; it never opens the server
//! again. On a server with sign-in by an identity provider, every caller needs a token or a session from the start.

use std::collections::HashMap;
use std::num::NonZeroU32;
use std::sync::{Arc, Mutex, PoisonError, RwLock};

use governor::clock::{Clock as _, DefaultClock};
use governor::{DefaultKeyedRateLimiter, Quota, RateLimiter};
use roost_api::project::DEFAULT_PROJECT;
use roost_api::time::Timestamp;
use roost_api::token::Scope;

use crate::store::Token;

/// The sender of a request.
#[derive(Clone, Debug, Default)]
pub(crate) struct Caller {
    /// Id of the token; empty on an open server.
    pub(crate) token: Arc<str>,
    /// The user of the token; empty if unknown.
    pub(crate) user: Arc<str>,
    /// The project of the token; empty on an open server.
    pub(crate) project: Arc<str>,
    /// The scopes of the token.
    pub(crate) scopes: Vec<Scope>,
    /// Hash of the secret that was sent: a token has another one for each session.
    hash: Option<blake3::Hash>,
}

impl Caller {
    /// Whether the server is open, so that the caller may do everything.
    pub(crate) fn is_unrestricted(&self) -> bool {
        self.token.is_empty()
    }

    /// The caller in the audit log.
    pub(crate) fn name(&self) -> &str {
        if self.is_unrestricted() { "open" } else { &self.token }
    }

    /// The user in the audit log, if known.
    pub(crate) fn user(&self) -> Option<&str> {
        Some(&*self.user).filter(|user| !user.is_empty())
    }

    /// The project in the audit log.
    pub(crate) fn project(&self) -> &str {
        if self.is_unrestricted() { DEFAULT_PROJECT } else { &self.project }
    }

    /// Checks that the token has one of these scopes.
    pub(crate) fn check_scope(&self, needed: &'static [Scope]) -> Result<(), AccessError> {
        let covers = |needed: &Scope| self.scopes.iter().any(|scope| scope.covers(*needed));
        if self.is_unrestricted() || needed.iter().any(covers) {
            return Ok(());
        }
        Err(AccessError::MissingScope { needed })
    }
}

/// Why a request was refused.
#[derive(Debug, thiserror::Error)]
pub(crate) enum AccessError {
    /// The request brought no token.
    #[error(
        "no token was sent: send the header `authorization: Bearer TOKEN`, or give the `roost` command `--token-file` or \
         ROOST_TOKEN; `roost token create` makes a token"
    )]
    NoToken,
    /// The token is not valid.
    #[error(
        "the token is unknown or revoked: `roost token list` shows valid tokens, `roost token create` makes one"
    )]
    InvalidToken,
    /// The token or the session has expired.
    #[error("the {what} expired at {at}: {advice}", what = if *is_session { "session" } else { "token" },
            advice = if *is_session { "sign in again" } else { "`roost token create` makes another one" })]
    ExpiredToken {
        /// When it expired.
        at: Timestamp,
        /// Whether it began with a sign-in.
        is_session: bool,
    },
    /// The token is valid and lacks every scope that would do.
    #[error("this request needs a token with the scope {}", names(needed))]
    MissingScope {
        /// Scopes of which one is needed.
        needed: &'static [Scope],
    },
    /// The token exceeded its rate.
    #[error(
        "the token exceeded {max_per_s} requests per second (max_requests_per_s, which the operator can set): wait \
         {wait_s} s"
    )]
    TooManyRequests {
        /// The limit.
        max_per_s: u32,
        /// Time until the next request is accepted, in seconds.
        wait_s: u64,
    },
}

fn names(scopes: &[Scope]) -> String {
    scopes.iter().map(|scope| scope.as_str()).collect::<Vec<_>>().join(" or ")
}

/// Whom the server admits.
#[derive(Clone, Debug)]
enum Admission {
    /// No token has ever existed and the address is a loopback address: everybody may do everything.
    Everybody,
    /// The bearers of these tokens; nobody when the list is empty.
    Bearers(Arc<[Token]>),
}

impl Admission {
    /// Whether no token is valid.
    fn is_closed(&self) -> bool {
        let now = Timestamp::now();
        matches!(self, Self::Bearers(tokens) if !tokens.iter().any(|token| token.is_valid(now)))
    }
}

/// Tokens in effect, and the request rate of each.
pub(crate) struct Access {
    admission: RwLock<Admission>,
    /// Every token that was logged, and whether it was revoked then.
    logged: Mutex<HashMap<String, bool>>,
    rate: Option<DefaultKeyedRateLimiter<Arc<str>>>,
    max_per_s: u32,
    /// Whether users can sign in with an identity provider.
    has_sign_in: bool,
}

impl Access {
    /// Access with all tokens that exist, revoked ones included. `max_per_s` limits each token; 0 is no limit.
    pub(crate) fn new(max_per_s: u32, is_loopback: bool, has_sign_in: bool, tokens: Vec<Token>) -> Self {
        let logged = tokens.iter().map(|token| (token.id.clone(), token.is_revoked)).collect();
        let admission = if tokens.is_empty() && is_loopback && !has_sign_in {
            Admission::Everybody
        } else {
            Admission::Bearers(valid(tokens))
        };
        let access = Self {
            admission: RwLock::new(admission),
            logged: Mutex::new(logged),
            rate: NonZeroU32::new(max_per_s).map(Quota::per_second).map(RateLimiter::keyed),
            max_per_s,
            has_sign_in,
        };
        access.log_if_closed();
        access
    }

    /// Takes over changes that `roost token` made. A server that has known a token never opens again.
    pub(crate) fn update(&self, tokens: Vec<Token>) {
        let before = self.admission();
        if tokens.is_empty() && matches!(before, Admission::Everybody) {
            return;
        }
        self.log_changes(&tokens);
        let had_tokens = !before.is_closed();
        *self.admission.write().unwrap_or_else(PoisonError::into_inner) = Admission::Bearers(valid(tokens));
        if had_tokens {
            self.log_if_closed();
        }
    }

    fn admission(&self) -> Admission {
        self.admission.read().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn log_if_closed(&self) {
        if self.admission().is_closed() && !self.has_sign_in {
            tracing::error!(
                "no access token is valid: every request is answered 401; `roost token create` makes a token"
            );
        }
    }

    fn log_changes(&self, tokens: &[Token]) {
        let mut logged = self.logged.lock().unwrap_or_else(PoisonError::into_inner);
        for token in tokens {
            let before = logged.insert(token.id.clone(), token.is_revoked);
            if before.is_none() {
                super::audit::log_token("token_create", token);
            }
            if token.is_revoked && before != Some(true) {
                super::audit::log_token("token_revoke", token);
            }
        }
    }

    /// Whether everybody may do everything.
    pub(crate) fn is_open(&self) -> bool {
        matches!(self.admission(), Admission::Everybody)
    }

    /// Whether a caller that was admitted before would be admitted now.
    pub(crate) fn still_admits(&self, caller: &Caller) -> bool {
        match self.admission() {
            Admission::Everybody => true,
            Admission::Bearers(tokens) => {
                let now = Timestamp::now();
                tokens.iter().any(|token| caller.hash == Some(token.hash) && token.is_valid(now))
            }
        }
    }

    /// The caller whose token has this secret.
    pub(crate) fn authenticate(&self, secret: Option<&str>) -> Result<Caller, AccessError> {
        let Admission::Bearers(tokens) = self.admission() else { return Ok(Caller::default()) };
        let hash = blake3::hash(secret.ok_or(AccessError::NoToken)?.as_bytes());
        // blake3 compares hashes in constant time, and the loop compares all of them.
        let mut found = None;
        for token in tokens.iter() {
            if token.hash == hash {
                found = Some(token);
            }
        }
        let token = found.ok_or(AccessError::InvalidToken)?;
        if let Some(at) = token.expires_at.filter(|_| token.has_expired(Timestamp::now())) {
            return Err(AccessError::ExpiredToken { at, is_session: token.is_session });
        }
        Ok(Caller {
            token: token.id.as_str().into(),
            user: token.user.as_str().into(),
            project: token.project.as_str().into(),
            scopes: token.scopes.clone(),
            hash: Some(hash),
        })
    }

    /// Whether this is the secret of a session, even of one that has expired. Anybody may ask to end one, and strangers shall not reach
    /// the database.
    pub(crate) fn has_session(&self, secret: &str) -> bool {
        let Admission::Bearers(tokens) = self.admission() else { return false };
        let hash = blake3::hash(secret.as_bytes());
        tokens.iter().any(|token| token.is_session && token.hash == hash)
    }

    /// Counts a request of this caller, and refuses it above the rate.
    pub(crate) fn count_request(&self, caller: &Caller) -> Result<(), AccessError> {
        let Some(rate) = &self.rate else { return Ok(()) };
        rate.check_key(&caller.token).map_err(|refused| {
            let wait_s = refused.wait_time_from(DefaultClock::default().now()).as_secs() + 1;
            AccessError::TooManyRequests { max_per_s: self.max_per_s, wait_s }
        })
    }
}

/// Expired ones stay, so that their error says so.
fn valid(tokens: Vec<Token>) -> Arc<[Token]> {
    tokens.into_iter().filter(|token| !token.is_revoked).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_secrets_of_sessions_reach_the_database() {
        let token = |secret: &str, is_session, expires_at: Option<i64>, is_revoked| Token {
            id: "t".to_owned(),
            name: "n".to_owned(),
            user: "u".to_owned(),
            project: DEFAULT_PROJECT.to_owned(),
            hash: blake3::hash(secret.as_bytes()),
            scopes: vec![Scope::Read],
            is_revoked,
            expires_at: expires_at.map(Timestamp),
            is_session,
        };
        let tokens = vec![
            token("token", false, None, false),
            token("session", true, Some(i64::MAX), false),
            token("expired", true, Some(0), false),
            token("revoked", true, Some(i64::MAX), true),
        ];
        let access = Access::new(0, true, true, tokens);
        let known = ["invented", "", "token", "session", "expired", "revoked"];
        assert_eq!(known.map(|secret| access.has_session(secret)), [false, false, false, true, true, false]);
        assert!(!Access::new(0, true, false, Vec::new()).has_session("invented"), "an open server");
    }
}

//! Sign-in with an identity provider by OpenID Connect: the authorization code flow with PKCE.
//!
//! | file | task |
//! |---|---|
//! | `settings` | the operator's options, checked; rules who may do what |
//! | `attempt` | state, nonce and verifier of one sign-in, from a cookie |
//! | `provider` | talks to the provider: its metadata, its keys, the exchange of a code |
//! | `id_token` | verifies the token that names the user |
//! | `claims` | name and groups of the user |
//! | `error` | why a sign-in failed, and what to do |
//!
//! These files know neither HTTP requests of browsers nor the database.

mod attempt;
mod claims;
mod error;
mod id_token;
mod provider;
mod settings;
#[cfg(test)]
mod tests;

use std::num::NonZeroU32;
use std::sync::Arc;

use governor::{DefaultDirectRateLimiter, Quota, RateLimiter};
use roost_api::time::Timestamp;

pub(crate) use attempt::{ATTEMPT_S, Attempt};
use claims::Claims;
pub(crate) use error::SignInError;
use provider::Provider;
pub(crate) use settings::CALLBACK;
use settings::Grant;
pub use settings::{SignInOptions, SignInSettings};

/// Codes that are exchanged in one second. Whoever starts a sign-in can send an invented code.
const EXCHANGES_PER_S: NonZeroU32 = NonZeroU32::new(10).unwrap();

/// Sign-in with the provider of the settings.
pub(crate) struct SignIn {
    pub(crate) settings: SignInSettings,
    /// The key of attempts, from the database. All servers have the same one, so that a sign-in outlives a change of the leader.
    key: [u8; blake3::KEY_LEN],
    provider: Arc<Provider>,
    exchanges: DefaultDirectRateLimiter,
}

/// A user whom the provider knows.
#[derive(Clone, Debug)]
pub(crate) struct Who {
    /// Issuer and subject: the user for ever.
    pub(crate) identity: String,
    /// Name of the user.
    pub(crate) user: String,
}

/// A user whom a rule admits.
#[derive(Clone, Debug)]
pub(crate) struct SignedIn {
    pub(crate) who: Who,
    /// The rights of the user.
    pub(crate) grant: Grant,
}

impl SignIn {
    /// It calls the provider when a user signs in, not before.
    pub(crate) fn new(settings: SignInSettings, key: [u8; blake3::KEY_LEN]) -> Self {
        let provider = Arc::new(Provider::new(&settings));
        let exchanges = RateLimiter::direct(Quota::per_second(EXCHANGES_PER_S));
        Self { settings, key, provider, exchanges }
    }

    /// A new attempt, and the address of the provider that the browser goes to.
    pub(crate) async fn begin(&self, now: Timestamp) -> Result<(Attempt, String), SignInError> {
        let attempt = Attempt::new(&self.key, now);
        let address = self.provider.authorization_address(&self.settings, &attempt).await?;
        Ok((attempt, address))
    }

    /// The attempt of a cookie, if this server made it and the provider gives its state back.
    pub(crate) fn attempt(
        &self,
        cookie: Option<&str>,
        state: Option<&str>,
        now: Timestamp,
    ) -> Result<Attempt, SignInError> {
        let attempt = cookie.and_then(|cookie| Attempt::read(&self.key, cookie, now));
        attempt.filter(|attempt| attempt.has_state(state)).ok_or(SignInError::NoAttempt)
    }

    /// The user whom the provider names for a code.
    pub(crate) async fn complete(&self, attempt: &Attempt, code: &str) -> Result<SignedIn, SignInError> {
        self.exchanges.check().map_err(|_| SignInError::Busy)?;
        let claims: Claims = self.provider.claims(&self.settings, attempt, code).await?;
        let groups = claims.groups(&self.settings.groups_claim);
        let who = Who {
            identity: format!("{} {}", self.settings.issuer, claims.subject),
            user: claims.user(&self.settings.user_claim),
        };
        match self.settings.grant(&groups) {
            Some(grant) => Ok(SignedIn { who, grant }),
            None => Err(SignInError::NoRule { who, groups }),
        }
    }
}

//! One attempt to sign in: its state, nonce and verifier.
//!
//! A cookie of the browser holds the attempt, and the server keeps nothing, so that another server can complete it. The cookie is a moment
//! and a random number. The other values come from it by a key that no browser has. So a state fits a cookie only if a server with this
//! key has made both, and the provider alone learns the verifier. The key is random and in the database: one that came from the secret of
//! the client could be guessed from a single attempt.

use roost_api::time::Timestamp;
use uuid::Uuid;

/// Time to sign in at the provider, in seconds.
pub(crate) const ATTEMPT_S: u32 = 600;

/// Maximum difference between the clocks of two servers, in milliseconds.
const SKEW_MS: i64 = 60_000;

/// An attempt.
pub(crate) struct Attempt {
    /// The value of the cookie.
    pub(crate) cookie: String,
    /// Comes back from the provider with the code (RFC 6749, section 10.12).
    pub(super) state: blake3::Hash,
    /// Comes back in the ID token.
    pub(super) nonce: String,
    /// Shows the provider who began (RFC 7636).
    pub(super) verifier: String,
}

impl Attempt {
    /// A new attempt.
    pub(super) fn new(key: &[u8; blake3::KEY_LEN], now: Timestamp) -> Self {
        Self::of(key, format!("{}.{}{}", now.0, Uuid::new_v4().simple(), Uuid::new_v4().simple()))
    }

    /// The attempt of a cookie; none if it is too old.
    pub(super) fn read(key: &[u8; blake3::KEY_LEN], cookie: &str, now: Timestamp) -> Option<Self> {
        let began: i64 = cookie.split_once('.')?.0.parse().ok()?;
        let age = now.0.checked_sub(began)?;
        (-SKEW_MS..=i64::from(ATTEMPT_S) * 1000).contains(&age).then(|| Self::of(key, cookie.to_owned()))
    }

    fn of(key: &[u8; blake3::KEY_LEN], cookie: String) -> Self {
        let derive = |what: &str| blake3::keyed_hash(key, format!("{what} {cookie}").as_bytes());
        let (state, nonce, verifier) = (derive("state"), derive("nonce"), derive("verifier"));
        Self { state, nonce: nonce.to_hex().to_string(), verifier: verifier.to_hex().to_string(), cookie }
    }

    /// Whether a state is that of the attempt. blake3 compares in constant time.
    pub(super) fn has_state(&self, state: Option<&str>) -> bool {
        state.and_then(|state| blake3::Hash::from_hex(state).ok()).is_some_and(|state| state == self.state)
    }
}

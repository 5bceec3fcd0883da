//! The identity provider: its metadata and keys, and the exchange of a code for claims.
//!
//! The metadata is read at the first sign-in and kept for an hour. The keys belong to it: an unknown key makes the server read both again.
//! If that fails, the known ones stay.

use std::sync::Arc;
use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use jsonwebtoken::jwk::JwkSet;
use reqwest::{RequestBuilder, Url};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use serde_json::{Map, Value};
use tokio::sync::Mutex;
use tokio::time::Instant;

use super::attempt::Attempt;
use super::claims::Claims;
use super::error::SignInError;
use super::id_token::{self, Expected, Failure};
use super::settings::{SignInSettings, is_loopback, is_safe};

/// Maximum time of an answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Time for which metadata and keys are kept.
const KEEP: Duration = Duration::from_secs(3600);

/// Time for which a failed attempt to read them holds. Anybody may begin a sign-in, and none of them shall make the server call the
/// provider more often.
const HOLD: Duration = Duration::from_secs(5);

/// Maximum size of an answer, in bytes.
const MAX_BYTES: usize = 1 << 20;

/// Scopes that are asked for if the provider has them, beside `openid`.
const SCOPES: [&str; 3] = ["profile", "email", "groups"];

/// The metadata of a provider (OpenID Connect Discovery, section 3).
#[derive(Deserialize)]
struct Metadata {
    issuer: String,
    authorization_endpoint: Endpoint,
    token_endpoint: Endpoint,
    jwks_uri: Endpoint,
    userinfo_endpoint: Option<Endpoint>,
    scopes_supported: Option<Vec<String>>,
    token_endpoint_auth_methods_supported: Option<Vec<String>>,
}

/// An address of the provider.
#[derive(Deserialize)]
#[serde(try_from = "String")]
struct Endpoint(Url);

impl TryFrom<String> for Endpoint {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        Url::parse(&text).map(Self).map_err(|error| format!("{text:?} is no address: {error}"))
    }
}

struct Known {
    metadata: Metadata,
    keys: JwkSet,
}

/// The answer to a code (RFC 6749, section 5.1).
#[derive(Deserialize)]
struct Tokens {
    id_token: String,
    access_token: Option<String>,
}

/// The error of the provider (RFC 6749, section 5.2).
#[derive(Deserialize)]
struct Refusal {
    error: String,
    #[serde(default)]
    error_description: String,
}

/// The results of the last readings of metadata and keys.
#[derive(Default)]
struct Last {
    known: Option<(Instant, Arc<Known>)>,
    failed: Option<(Instant, SignInError)>,
}

pub(super) struct Provider {
    http: reqwest::Client,
    host: String,
    /// One request reads; others wait for it.
    last: Arc<Mutex<Last>>,
}

impl Provider {
    pub(super) fn new(settings: &SignInSettings) -> Self {
        // Fails where the process has chosen one already, which serves as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        // A redirect could lead the secret of the client elsewhere.
        let http = reqwest::Client::builder().redirect(reqwest::redirect::Policy::none()).timeout(PATIENCE);
        // No proxy reaches this machine's loopback addresses.
        let is_local = Url::parse(&settings.issuer).is_ok_and(|issuer| is_loopback(&issuer));
        let http = if is_local { http.no_proxy() } else { http };
        let http = http.build().expect("settings without files");
        Self { http, host: settings.provider_host(), last: Default::default() }
    }

    /// The address at which the user signs in.
    pub(super) async fn authorization_address(
        self: &Arc<Self>,
        settings: &SignInSettings,
        attempt: &Attempt,
    ) -> Result<String, SignInError> {
        let known = self.known(settings, None).await?;
        let mut address = known.metadata.authorization_endpoint.0.clone();
        let hash = ring::digest::digest(&ring::digest::SHA256, attempt.verifier.as_bytes());
        let is_offered = |scope: &&str| match &known.metadata.scopes_supported {
            Some(offered) => offered.iter().any(|offer| offer == scope),
            None => *scope != "groups",
        };
        let scopes: Vec<_> = ["openid"].into_iter().chain(SCOPES.into_iter().filter(is_offered)).collect();
        address
            .query_pairs_mut()
            .append_pair("response_type", "code")
            .append_pair("client_id", &settings.client_id)
            .append_pair("redirect_uri", &settings.callback())
            .append_pair("scope", &scopes.join(" "))
            .append_pair("state", &attempt.state.to_hex())
            .append_pair("nonce", &attempt.nonce)
            .append_pair("code_challenge", &URL_SAFE_NO_PAD.encode(hash))
            .append_pair("code_challenge_method", "S256");
        Ok(address.into())
    }

    /// Exchanges a code, and verifies the ID token that comes for it.
    pub(super) async fn claims(
        self: &Arc<Self>,
        settings: &SignInSettings,
        attempt: &Attempt,
        code: &str,
    ) -> Result<Claims, SignInError> {
        let known = self.known(settings, None).await?;
        let request = self.exchange(settings, &known.metadata, attempt, code);
        let tokens: Tokens = self.fetch(request).await?;
        let expected =
            Expected { issuer: &settings.issuer, client: &settings.client_id, nonce: &attempt.nonce };
        let mut verified = id_token::verify(&tokens.id_token, &known.keys, expected);
        if let Err(Failure::UnknownKey) = verified {
            let known = self.known(settings, Some(&known)).await?;
            verified = id_token::verify(&tokens.id_token, &known.keys, expected);
        }
        let (subject, all) = verified.map_err(SignInError::from)?;
        let mut claims = Claims { subject, all };
        // Some providers keep the ID token small.
        if let (Some(endpoint), Some(token)) = (&known.metadata.userinfo_endpoint, &tokens.access_token)
            && !claims.have(&settings.user_claim, &settings.groups_claim)
        {
            let more: Map<String, Value> =
                self.fetch(self.http.get(endpoint.0.clone()).bearer_auth(token)).await?;
            if more.get("sub").and_then(Value::as_str) != Some(&claims.subject) {
                return Err(SignInError::Unusable("its user info is about another user".to_owned()));
            }
            claims.complete(more);
        }
        Ok(claims)
    }

    /// The request that exchanges a code.
    fn exchange(
        &self,
        settings: &SignInSettings,
        metadata: &Metadata,
        attempt: &Attempt,
        code: &str,
    ) -> RequestBuilder {
        let SignInSettings { client_id, client_secret, .. } = settings;
        let mut form = form_urlencoded::Serializer::new(String::new());
        form.append_pair("grant_type", "authorization_code")
            .append_pair("code", code)
            .append_pair("redirect_uri", &settings.callback())
            .append_pair("code_verifier", &attempt.verifier);
        let mut request = self.http.post(metadata.token_endpoint.0.clone());
        let ways = metadata.token_endpoint_auth_methods_supported.as_deref();
        let has = |way: &str| ways.is_some_and(|ways| ways.iter().any(|known| known == way));
        if has("client_secret_post") && !has("client_secret_basic") {
            form.append_pair("client_id", client_id).append_pair("client_secret", client_secret);
        } else {
            // RFC 6749, section 2.3.1, encodes both as a form does. Some providers do not know the sign + for a space.
            let encoded = |text: &str| {
                form_urlencoded::byte_serialize(text.as_bytes()).collect::<String>().replace('+', "%20")
            };
            request = request.basic_auth(encoded(client_id), Some(encoded(client_secret)));
        }
        request.header("content-type", "application/x-www-form-urlencoded").body(form.finish())
    }

    /// Metadata and keys. `before`: those that lack a key.
    async fn known(
        self: &Arc<Self>,
        settings: &SignInSettings,
        before: Option<&Arc<Known>>,
    ) -> Result<Arc<Known>, SignInError> {
        let mut last = self.last.clone().lock_owned().await;
        if let Some((at, known)) = &last.known
            && at.elapsed() < KEEP
            && before.is_none_or(|before| !Arc::ptr_eq(before, known))
        {
            return Ok(known.clone());
        }
        if let Some((at, error)) = &last.failed
            && at.elapsed() < HOLD
        {
            return Err(error.clone());
        }
        // A task of its own: a visitor who goes away shall not undo the record.
        let (provider, settings) = (self.clone(), settings.clone());
        let reading = tokio::spawn(async move {
            let read = provider.discover(&settings).await;
            let now = Instant::now();
            match &read {
                Ok(known) => *last = Last { known: Some((now, known.clone())), failed: None },
                Err(error) => last.failed = Some((now, error.clone())),
            }
            read
        });
        reading.await.unwrap_or_else(|_| Err(SignInError::Unusable("reading it has failed".to_owned())))
    }

    async fn discover(&self, settings: &SignInSettings) -> Result<Arc<Known>, SignInError> {
        let address = format!("{}/.well-known/openid-configuration", settings.issuer.trim_end_matches('/'));
        let metadata: Metadata = self.fetch(self.http.get(address)).await?;
        if metadata.issuer != settings.issuer {
            let cause =
                format!("--oidc-issuer is {}, and it names itself {}", settings.issuer, metadata.issuer);
            return Err(SignInError::OtherIssuer(cause));
        }
        let endpoints = [&metadata.authorization_endpoint, &metadata.token_endpoint, &metadata.jwks_uri];
        let all = endpoints.into_iter().chain(&metadata.userinfo_endpoint);
        let is_https = settings.issuer.starts_with("https:");
        let is_unsafe = |url: &&Endpoint| !is_safe(&url.0) || (is_https && url.0.scheme() != "https");
        if let Some(address) = all.into_iter().find(is_unsafe) {
            return Err(SignInError::UnsafeAddress(address.0.to_string()));
        }
        let keys = self.fetch(self.http.get(metadata.jwks_uri.0.clone())).await?;
        Ok(Arc::new(Known { metadata, keys }))
    }

    /// The document that answers a request.
    async fn fetch<T: DeserializeOwned>(&self, request: RequestBuilder) -> Result<T, SignInError> {
        let answer = request.header("accept", "application/json").send().await;
        let mut answer = answer.map_err(|error| self.failed(error))?;
        let (status, mut body) = (answer.status(), Vec::new());
        while let Some(part) = answer.chunk().await.map_err(|error| self.failed(error))? {
            body.extend_from_slice(&part);
            if body.len() > MAX_BYTES {
                return Err(SignInError::Unusable(format!("it is larger than {MAX_BYTES} bytes")));
            }
        }
        if !status.is_success() {
            return Err(refused(status.as_u16(), &body));
        }
        serde_json::from_slice(&body).map_err(|error| {
            // The text of the error would repeat parts of the answer.
            let place = format!("line {}, column {}", error.line(), error.column());
            SignInError::Unusable(format!("it is no JSON as expected, at {place}"))
        })
    }

    fn failed(&self, error: reqwest::Error) -> SignInError {
        let error = error.without_url();
        let mut cause = error.to_string();
        let mut source = std::error::Error::source(&error);
        while let Some(inner) = source {
            cause = inner.to_string();
            source = inner.source();
        }
        if error.is_timeout() {
            cause = format!("no answer within {} s", PATIENCE.as_secs());
        }
        self.unreachable(cause.contains("certificate"), cause)
    }

    fn unreachable(&self, is_certificate: bool, cause: String) -> SignInError {
        let host = self.host.clone();
        if is_certificate {
            SignInError::Certificate { host, cause }
        } else {
            SignInError::Away { host, cause }
        }
    }
}

/// An error answer of the provider. Its texts are for the log.
fn refused(status: u16, body: &[u8]) -> SignInError {
    let Ok(Refusal { error, error_description }) = serde_json::from_slice(body) else {
        return SignInError::Unusable(format!("its status is {status}"));
    };
    match error.as_str() {
        "invalid_grant" => SignInError::Code(error_description),
        "invalid_client" | "unauthorized_client" => {
            SignInError::Client(format!("{error}: {error_description}"))
        }
        _ => SignInError::Refused { error, description: Some(error_description) },
    }
}

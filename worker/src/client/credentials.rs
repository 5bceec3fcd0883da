//! The credentials of a client: its access token and the authorities that it trusts.

use std::sync::Once;

use reqwest::header::{AUTHORIZATION, HeaderMap, HeaderValue};
use reqwest::{Certificate, ClientBuilder};

use super::{ClientError, ClientResult, reason};

/// Access to a server.
#[derive(Clone, Default)]
pub struct Credentials {
    /// Access token of every call.
    pub token: Option<String>,
    /// Certificates (PEM) of the authorities to trust, in place of the system's.
    pub ca: Option<Vec<u8>>,
}

/// Without the secret.
impl std::fmt::Debug for Credentials {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let ca = self.ca.as_ref().map(Vec::len);
        f.debug_struct("Credentials")
            .field("has_token", &self.token.is_some())
            .field("ca_bytes", &ca)
            .finish()
    }
}

impl Credentials {
    /// Checks that the authorities are certificates.
    ///
    /// # Errors
    /// [`ClientError::Authorities`] with the reason.
    pub fn check(&self) -> ClientResult<()> {
        self.ca.as_deref().map_or(Ok(()), |pem| authorities(pem).map(drop))
    }

    /// Why no client can be made for a valid address.
    pub(super) fn error(&self, server: &str, error: &reqwest::Error) -> ClientError {
        let reason = reason::innermost(error).to_string();
        match self.ca {
            Some(_) => ClientError::Authorities(reason),
            None => ClientError::NoAuthorities { server: server.to_owned(), reason },
        }
    }

    pub(super) fn apply(&self, builder: ClientBuilder, is_encrypted: bool) -> ClientResult<ClientBuilder> {
        prepare_tls();
        let mut builder = builder;
        if let Some(token) = &self.token {
            let mut value =
                HeaderValue::try_from(format!("Bearer {}", token.trim())).map_err(|_| ClientError::Token)?;
            value.set_sensitive(true);
            builder = builder.default_headers(HeaderMap::from_iter([(AUTHORIZATION, value)]));
        }
        Ok(match &self.ca {
            Some(pem) => builder.tls_certs_only(authorities(pem)?),
            None if is_encrypted => builder,
            // The system's certificates are slow to read, and a container may have none.
            None => builder.tls_certs_only([]),
        })
    }
}

fn authorities(pem: &[u8]) -> ClientResult<Vec<Certificate>> {
    let broken = |error: reqwest::Error| ClientError::Authorities(reason::innermost(&error).to_string());
    let authorities = Certificate::from_pem_bundle(pem).map_err(broken)?;
    if authorities.is_empty() {
        return Err(ClientError::Authorities("it has no `-----BEGIN CERTIFICATE-----` (PEM)".to_owned()));
    }
    Ok(authorities)
}

/// Chooses the cryptography of every TLS connection of this process. Call it before the first client is made.
pub fn prepare_tls() {
    static ONCE: Once = Once::new();
    // Fails where the process has chosen one already, which serves as well.
    ONCE.call_once(|| drop(rustls::crypto::ring::default_provider().install_default()));
}

//! Verification of ID tokens (OpenID Connect Core, section 3.1.3.7): signature, issuer, audience, times and nonce.
//!
//! `jsonwebtoken` reads tokens and keys and checks the claims. Signatures are checked by ring, which TLS uses too.

use std::sync::Once;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use jsonwebtoken::crypto::{CryptoProvider, JwtVerifier, KeyUtils};
use jsonwebtoken::errors::{Error, ErrorKind, new_error};
use jsonwebtoken::jwk::{Jwk, JwkSet, PublicKeyUse};
use jsonwebtoken::{
    Algorithm, AlgorithmFamily, DecodingKey, DecodingKeyKind, Validation, decode, decode_header,
};
use ring::signature::{
    self, RsaParameters, RsaPublicKeyComponents, UnparsedPublicKey, VerificationAlgorithm,
};
use serde_json::{Map, Value};

use super::error::SignInError;

/// Maximum length of a subject (OpenID Connect Core, section 2).
const MAX_SUBJECT_BYTES: usize = 255;

/// The values that a token must have.
#[derive(Clone, Copy)]
pub(super) struct Expected<'a> {
    pub(super) issuer: &'a str,
    pub(super) client: &'a str,
    pub(super) nonce: &'a str,
}

/// Why a token is not valid.
#[derive(Debug, PartialEq)]
pub(super) enum Failure {
    /// The provider may have a new key.
    UnknownKey,
    /// It is from another time.
    Clock(&'static str),
    /// Any other reason.
    Invalid(String),
}

impl From<Failure> for SignInError {
    fn from(failure: Failure) -> Self {
        match failure {
            Failure::UnknownKey => Self::Token("its key is unknown".to_owned()),
            Failure::Clock(reason) => Self::Clock(reason),
            Failure::Invalid(reason) => Self::Token(reason),
        }
    }
}

/// The subject and all claims of a token.
pub(super) fn verify(
    token: &str,
    keys: &JwkSet,
    expected: Expected,
) -> Result<(String, Map<String, Value>), Failure> {
    install();
    let header = decode_header(token).map_err(|error| invalid(&error))?;
    if names_extensions(token) {
        return Err(Failure::Invalid("its header has extensions".to_owned()));
    }
    // A client secret is no key of a signature here.
    if header.alg.family() == AlgorithmFamily::Hmac {
        return Err(Failure::Invalid(format!("its algorithm is {:?}", header.alg)));
    }
    let fits = |key: &&Jwk| {
        let is_named = header.kid.is_none() || key.common.key_id == header.kid;
        is_named && matches!(key.common.public_key_use, None | Some(PublicKeyUse::Signature))
    };
    let mut validation = Validation::new(header.alg);
    validation.set_issuer(&[expected.issuer]);
    validation.set_audience(&[expected.client]);
    validation.set_required_spec_claims(&["exp", "iss", "aud", "sub"]);
    validation.validate_nbf = true;
    let mut last = Failure::UnknownKey;
    for key in keys.keys.iter().filter(fits) {
        let Ok(key) = DecodingKey::from_jwk(key) else { continue };
        match decode::<Map<String, Value>>(token, &key, &validation) {
            Ok(token) => return checked(token.claims, expected),
            Err(error) if !is_of_key(&error) => return Err(failure(&error)),
            // Without a name, any of the keys may be the right one.
            Err(_) if header.kid.is_none() => last = Failure::UnknownKey,
            Err(error) => last = failure(&error),
        }
    }
    Err(last)
}

/// Whether a header has `crit`: extensions that everybody must understand (RFC 7515, section 4.1.11). This server understands none.
fn names_extensions(token: &str) -> bool {
    let header = token.split('.').next().and_then(|header| URL_SAFE_NO_PAD.decode(header).ok());
    let header = header.and_then(|header| serde_json::from_slice::<Map<String, Value>>(&header).ok());
    header.is_none_or(|header| header.contains_key("crit"))
}

fn is_of_key(error: &Error) -> bool {
    matches!(
        error.kind(),
        ErrorKind::InvalidSignature | ErrorKind::InvalidAlgorithm | ErrorKind::InvalidKeyFormat
    )
}

/// Checks what is particular to ID tokens.
fn checked(claims: Map<String, Value>, expected: Expected) -> Result<(String, Map<String, Value>), Failure> {
    let text = |name: &str| claims.get(name).and_then(Value::as_str);
    let wrong = |reason: &str| Err(Failure::Invalid(reason.to_owned()));
    // A list of issuers would pass the check of the library.
    if text("iss") != Some(expected.issuer) {
        return wrong("its issuer is another one");
    }
    if text("nonce") != Some(expected.nonce) {
        return wrong("its nonce is that of another sign-in");
    }
    let audiences = claims.get("aud").and_then(Value::as_array).map_or(1, Vec::len);
    if (claims.contains_key("azp") || audiences > 1) && text("azp") != Some(expected.client) {
        return wrong("it was made for another client");
    }
    match text("sub") {
        None | Some("") => wrong("it names no user"),
        Some(subject) if subject.len() > MAX_SUBJECT_BYTES || subject.chars().any(char::is_control) => {
            wrong("its subject is too long, or has control characters")
        }
        Some(subject) => Ok((subject.to_owned(), claims)),
    }
}

fn failure(error: &Error) -> Failure {
    match error.kind() {
        ErrorKind::ExpiredSignature => Failure::Clock("has expired"),
        ErrorKind::ImmatureSignature => Failure::Clock("begins later"),
        _ => invalid(error),
    }
}

fn invalid(error: &Error) -> Failure {
    let reason = match error.kind() {
        ErrorKind::InvalidSignature => "its signature is wrong".to_owned(),
        ErrorKind::InvalidIssuer => "its issuer is another one".to_owned(),
        ErrorKind::InvalidAudience => "it is for another client".to_owned(),
        // The library repeats parts of the token.
        ErrorKind::Json(error) => {
            format!("it is no JSON as expected, at line {}, column {}", error.line(), error.column())
        }
        _ => error.to_string(),
    };
    Failure::Invalid(reason)
}

/// Lets the library check signatures with ring.
fn install() {
    static ONCE: Once = Once::new();
    static PROVIDER: CryptoProvider = CryptoProvider {
        signer_factory: |_, _| Err(new_error(ErrorKind::UnsupportedAlgorithm)),
        verifier_factory: |algorithm, key| {
            let key = PublicKey::of(*algorithm, key)?;
            Ok(Box::new(Verifier { algorithm: *algorithm, key }))
        },
        key_utils: KeyUtils::new_unimplemented(),
    };
    ONCE.call_once(|| PROVIDER.install_default().expect("nobody else installs one"));
}

enum PublicKey {
    Rsa(RsaPublicKeyComponents<Vec<u8>>, &'static RsaParameters),
    Point(UnparsedPublicKey<Vec<u8>>),
}

impl PublicKey {
    fn of(algorithm: Algorithm, key: &DecodingKey) -> Result<Self, Error> {
        if let DecodingKeyKind::RsaModulusExponent { n, e } = key.kind() {
            let parameters = match algorithm {
                Algorithm::RS256 => &signature::RSA_PKCS1_2048_8192_SHA256,
                Algorithm::RS384 => &signature::RSA_PKCS1_2048_8192_SHA384,
                Algorithm::RS512 => &signature::RSA_PKCS1_2048_8192_SHA512,
                Algorithm::PS256 => &signature::RSA_PSS_2048_8192_SHA256,
                Algorithm::PS384 => &signature::RSA_PSS_2048_8192_SHA384,
                Algorithm::PS512 => &signature::RSA_PSS_2048_8192_SHA512,
                _ => return Err(new_error(ErrorKind::InvalidAlgorithm)),
            };
            return Ok(Self::Rsa(RsaPublicKeyComponents { n: n.clone(), e: e.clone() }, parameters));
        }
        let scheme: &'static dyn VerificationAlgorithm = match (algorithm, key.family()) {
            (Algorithm::ES256, AlgorithmFamily::Ec) => &signature::ECDSA_P256_SHA256_FIXED,
            (Algorithm::ES384, AlgorithmFamily::Ec) => &signature::ECDSA_P384_SHA384_FIXED,
            (Algorithm::EdDSA, AlgorithmFamily::Ed) => &signature::ED25519,
            _ => return Err(new_error(ErrorKind::InvalidAlgorithm)),
        };
        Ok(Self::Point(UnparsedPublicKey::new(scheme, key.try_get_as_bytes()?.to_vec())))
    }
}

struct Verifier {
    algorithm: Algorithm,
    key: PublicKey,
}

impl jsonwebtoken::signature::Verifier<Vec<u8>> for Verifier {
    fn verify(&self, message: &[u8], signature: &Vec<u8>) -> Result<(), jsonwebtoken::signature::Error> {
        let verified = match &self.key {
            PublicKey::Rsa(key, parameters) => key.verify(parameters, message, signature),
            PublicKey::Point(key) => key.verify(message, signature),
        };
        verified.map_err(|_| jsonwebtoken::signature::Error::new())
    }
}

impl JwtVerifier for Verifier {
    fn algorithm(&self) -> Algorithm {
        self.algorithm
    }
}

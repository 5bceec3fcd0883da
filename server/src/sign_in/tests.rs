//! Tests of sign-in: settings, rules, attempts, claims and ID tokens.

use std::time::Duration;

use base64::Engine as _;
use base64::engine::general_purpose::URL_SAFE_NO_PAD;
use jsonwebtoken::jwk::JwkSet;
use ring::hmac;
use ring::rand::SystemRandom;
use ring::signature::{ECDSA_P256_SHA256_FIXED_SIGNING, EcdsaKeyPair, KeyPair as _};
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use serde_json::{Value, json};

use super::Who;
use super::attempt::Attempt;
use super::claims::Claims;
use super::error::SignInError;
use super::id_token::{Expected, Failure, verify};
use super::settings::{Grant, SignInOptions, SignInSettings};

fn secret_file() -> tempfile::NamedTempFile {
    let file = tempfile::NamedTempFile::new().unwrap();
    std::fs::write(file.path(), "of the client\n").unwrap();
    file
}

fn options(secret: &tempfile::NamedTempFile, allow: &[&str]) -> SignInOptions {
    SignInOptions {
        issuer: Some("https://idp.example/realms/lab".to_owned()),
        client_id: Some("roost".to_owned()),
        client_secret_file: Some(secret.path().to_owned()),
        redirect: Some("https://roost.example".to_owned()),
        allow: allow.iter().map(|rule| (*rule).to_owned()).collect(),
        groups_claim: "groups".to_owned(),
        user_claim: "email".to_owned(),
        session: Duration::from_secs(3600),
    }
}

#[test]
fn all_faults_of_the_options_come_at_once() {
    assert!(SignInSettings::of(&SignInOptions::default()).unwrap().is_none(), "no sign-in");
    let secret = secret_file();
    let good = SignInSettings::of(&options(&secret, &["*=default:read"])).unwrap().unwrap();
    assert_eq!(good.callback(), "https://roost.example/dashboard/sign-in/callback");
    assert_eq!(good.provider_host(), "idp.example");
    assert!(good.is_https() && !format!("{good:?}").contains("of the client"));

    let wrong = SignInOptions {
        issuer: Some("http://idp.example".to_owned()),
        client_id: Some(" ".to_owned()),
        client_secret_file: Some("/nonexistent/secret".into()),
        redirect: Some("https://roost.example/below".to_owned()),
        ..options(&secret, &["scientists", "scientists=lab:cook", "=lab:read"])
    };
    let faults = SignInSettings::of(&wrong).unwrap_err();
    for (fault, parts) in faults.iter().zip([
        ["--oidc-client-id", "missing", "client"],
        ["--oidc-issuer", "\"http://idp.example\"", "https://"],
        ["--oidc-client-secret-file", "/nonexistent/secret", "cannot be read"],
        ["--oidc-redirect", "\"https://roost.example/below\"", "without a path"],
        ["--oidc-allow", "\"scientists\"", "GROUP=PROJECT:SCOPE"],
        ["--oidc-allow", "\"scientists=lab:cook\"", "admin, submit, read, worker"],
        ["--oidc-allow", "\"=lab:read\"", "GROUP=PROJECT:SCOPE"],
    ]) {
        assert!(parts.iter().all(|part| fault.contains(part)), "{parts:?}: {fault}");
    }
    assert_eq!(faults.len(), 7, "{faults:?}");
    let missing = SignInOptions { allow: vec!["*=default:read".to_owned()], ..SignInOptions::default() };
    assert_eq!(SignInSettings::of(&missing).unwrap_err().len(), 6, "four options and two claims");

    for (issuer, is_allowed) in [
        ("http://127.0.0.1:8080/", true),
        ("http://[::1]:8080", true),
        ("http://localhost", true),
        ("http://127.evil.example", false),
        ("https://user@idp.example", false),
        ("https://idp.example/?a=b", false),
        ("idp.example", false),
    ] {
        let options =
            SignInOptions { issuer: Some(issuer.to_owned()), ..options(&secret, &["*=default:read"]) };
        assert_eq!(SignInSettings::of(&options).is_ok(), is_allowed, "{issuer}");
    }
}

#[test]
fn the_first_rule_that_fits_gives_the_project_and_all_of_it_give_scopes() {
    let secret = secret_file();
    let rules =
        ["cn=lab,dc=example=wax:submit", "cn=lab,dc=example=wax:worker", "staff=wax:admin", "*=default:read"];
    let settings = SignInSettings::of(&options(&secret, &rules)).unwrap().unwrap();
    let grant =
        |groups: &[&str]| settings.grant(&groups.iter().map(|group| (*group).to_owned()).collect::<Vec<_>>());
    let of = |project: &str, scopes: &[Scope]| {
        Some(Grant { project: project.to_owned(), scopes: scopes.to_vec() })
    };
    assert_eq!(grant(&["other", "cn=lab,dc=example"]), of("wax", &[Scope::Submit, Scope::Worker]));
    assert_eq!(grant(&["staff"]), of("wax", &[Scope::Admin]));
    assert_eq!(grant(&[]), of("default", &[Scope::Read]));
    assert_eq!(grant(&["*"]), of("default", &[Scope::Read]));
    let strict = SignInSettings::of(&options(&secret, &rules[..3])).unwrap().unwrap();
    assert_eq!(strict.grant(&["cn=lab".to_owned(), "*".to_owned()]), None);
}

#[test]
fn an_attempt_belongs_to_its_cookie_and_its_key() {
    let (key, other) = ([1; blake3::KEY_LEN], [2; blake3::KEY_LEN]);
    let attempt = Attempt::new(&key, Timestamp(1_000_000));
    let read = |key, cookie: &str, now| Attempt::read(key, cookie, Timestamp(now));
    let state = attempt.state.to_hex().to_string();
    let again = read(&key, &attempt.cookie, 1_000_000 + 600_000).expect("ten minutes");
    assert!(
        again.has_state(Some(&state)) && again.verifier == attempt.verifier && again.nonce == attempt.nonce
    );
    assert!(!again.has_state(None) && !again.has_state(Some("")) && !again.has_state(Some(&attempt.nonce)));
    assert!(read(&key, &attempt.cookie, 1_000_000 + 600_001).is_none(), "too old");
    assert!(read(&key, &attempt.cookie, 0).is_none(), "from the future");
    for invented in ["", "0", "x.y"] {
        assert!(read(&key, invented, 0).is_none(), "{invented}");
    }
    // An invented cookie has no state that fits.
    assert!(!read(&other, &attempt.cookie, 1_000_000).unwrap().has_state(Some(&state)));
    let renewed = attempt.cookie.replacen("1000000", "1500000", 1);
    assert!(!read(&key, &renewed, 1_500_000).unwrap().has_state(Some(&state)));
    assert!(!attempt.cookie.contains(&attempt.verifier));
}

fn claims(all: Value) -> Claims {
    Claims { subject: "17".to_owned(), all: all.as_object().unwrap().clone() }
}

#[test]
fn an_unverified_address_names_nobody() {
    for (all, user) in [
        (json!({"email": "ada@lab.example", "email_verified": true}), "ada@lab.example"),
        (json!({"email": "ada@lab.example", "email_verified": "true"}), "ada@lab.example"),
        (json!({"email": "ada@lab.example", "email_verified": false, "preferred_username": "Ada"}), "Ada"),
        (json!({"email": "ada@lab.example"}), "17"),
        (json!({"email": "ada@lab.example", "preferred_username": "boss@lab.example"}), "17"),
        (json!({"preferred_username": "boss@lab.example"}), "17"),
        (json!({"preferred_username": "a\u{7}b"}), "17"),
        (json!({"preferred_username": " "}), "17"),
    ] {
        assert_eq!(claims(all.clone()).user("email"), user, "{all}");
    }
    let mut known = claims(json!({"email": "boss@lab.example"}));
    known.complete(json!({"email": "ada@lab.example", "email_verified": true}).as_object().unwrap().clone());
    assert_eq!(known.user("email"), "17", "the state of one address is not that of another");
    let mut known = claims(json!({"email_verified": true}));
    known.complete(json!({"email": "boss@lab.example"}).as_object().unwrap().clone());
    assert_eq!(known.user("email"), "17", "the ID token has verified another address");
    let named = claims(json!({"preferred_username": "ada@lab.example"}));
    assert_eq!(named.user("preferred_username"), "ada@lab.example", "the operator has chosen it");
    assert_eq!(claims(json!({"groups": ["a", 5, "b"]})).groups("groups"), ["a", "b"]);
    assert_eq!(claims(json!({"roles": "a"})).groups("roles"), ["a"]);
    assert_eq!(claims(json!({})).groups("groups"), [""; 0]);
}

/// A key of a provider.
struct Key(EcdsaKeyPair);

impl Key {
    fn new() -> Self {
        let (scheme, random) = (&ECDSA_P256_SHA256_FIXED_SIGNING, SystemRandom::new());
        let document = EcdsaKeyPair::generate_pkcs8(scheme, &random).unwrap();
        Self(EcdsaKeyPair::from_pkcs8(scheme, document.as_ref(), &random).unwrap())
    }

    fn jwk(&self, id: &str) -> Value {
        let point = self.0.public_key().as_ref();
        let (x, y) = (URL_SAFE_NO_PAD.encode(&point[1..33]), URL_SAFE_NO_PAD.encode(&point[33..]));
        json!({"kty": "EC", "crv": "P-256", "use": "sig", "alg": "ES256", "kid": id, "x": x, "y": y})
    }

    fn sign(&self, header: &Value, claims: &Value) -> String {
        let part = |value: &Value| URL_SAFE_NO_PAD.encode(value.to_string());
        let text = format!("{}.{}", part(header), part(claims));
        let signature = self.0.sign(&SystemRandom::new(), text.as_bytes()).unwrap();
        format!("{text}.{}", URL_SAFE_NO_PAD.encode(signature))
    }
}

#[test]
fn an_id_token_is_for_this_client_this_sign_in_and_this_time() {
    let (key, stranger) = (Key::new(), Key::new());
    let keys: JwkSet = serde_json::from_value(json!({"keys": [key.jwk("a"), stranger.jwk("b")]})).unwrap();
    let only_b: JwkSet = serde_json::from_value(json!({"keys": [stranger.jwk("b")]})).unwrap();
    let expected = Expected { issuer: "https://idp.example", client: "roost", nonce: "n" };
    let now = Timestamp::now().0 / 1000;
    let good = json!({"iss": "https://idp.example", "aud": "roost", "sub": "17", "nonce": "n", "exp": now + 60, "iat": now});
    let with = |changes: Value| {
        let mut claims = good.clone();
        for (name, value) in changes.as_object().unwrap() {
            claims[name] = value.clone();
        }
        claims
    };
    let header = json!({"alg": "ES256", "kid": "a"});
    let check = |claims: &Value| verify(&key.sign(&header, claims), &keys, expected);
    for claims in [
        good.clone(),
        with(json!({"aud": ["roost"], "azp": "roost"})),
        with(json!({"aud": ["roost", "other"], "azp": "roost"})),
        with(json!({"exp": now - 50})),
        with(json!({"nbf": now + 50})),
    ] {
        let (subject, all) = check(&claims).unwrap_or_else(|failure| panic!("{claims}: {failure:?}"));
        assert!(subject == "17" && all["nonce"] == "n");
    }
    let clock = |reason| Err(Failure::Clock(reason));
    assert_eq!(check(&with(json!({"exp": now - 100}))), clock("has expired"));
    assert_eq!(check(&with(json!({"nbf": now + 100}))), clock("begins later"));
    for (claims, reason) in [
        (with(json!({"nonce": "m"})), "nonce"),
        (with(json!({"nonce": null})), "nonce"),
        (with(json!({"iss": "https://evil.example"})), "issuer"),
        (with(json!({"iss": ["https://idp.example", "https://evil.example"]})), "issuer"),
        (with(json!({"iss": null})), "iss"),
        (with(json!({"aud": "other"})), "another client"),
        (with(json!({"aud": []})), "another client"),
        (with(json!({"aud": null})), "aud"),
        (with(json!({"aud": ["roost", "other"]})), "another client"),
        (with(json!({"azp": "other"})), "another client"),
        (with(json!({"sub": ""})), "no user"),
        (with(json!({"sub": null})), "sub"),
        (with(json!({"sub": "a\u{7}b"})), "control characters"),
        (with(json!({"sub": "a".repeat(256)})), "too long"),
        (with(json!({"exp": null})), "exp"),
    ] {
        match check(&claims) {
            Err(Failure::Invalid(found)) => assert!(found.contains(reason), "{claims}: {found}"),
            other => panic!("{claims}: {other:?}"),
        }
    }
    // Keys and signatures.
    let signed = |key: &Key, header: Value| verify(&key.sign(&header, &good), &keys, expected);
    let wrong = |found: Result<_, Failure>, reason: &str| match found {
        Err(Failure::Invalid(found)) => assert!(found.contains(reason), "{reason}: {found}"),
        other => panic!("{reason}: {other:?}"),
    };
    wrong(signed(&stranger, header.clone()), "signature");
    assert!(signed(&key, json!({"alg": "ES256"})).is_ok(), "one of several keys without a name");
    assert_eq!(signed(&Key::new(), json!({"alg": "ES256"})).unwrap_err(), Failure::UnknownKey);
    assert_eq!(signed(&key, json!({"alg": "ES256", "kid": "new"})).unwrap_err(), Failure::UnknownKey);
    assert_eq!(verify(&key.sign(&header, &good), &only_b, expected).unwrap_err(), Failure::UnknownKey);
    let expired = key.sign(&json!({"alg": "ES256"}), &with(json!({"exp": now - 100})));
    assert_eq!(verify(&expired, &keys, expected), clock("has expired"), "not the fault of the next key");
    wrong(signed(&key, json!({"alg": "ES256", "kid": "a", "crit": ["b64"], "b64": true})), "extensions");
    // A secret among the keys, and a token that it has signed.
    let secret = b"0123456789abcdef0123456789abcdef";
    let jwk = json!({"kty": "oct", "kid": "s", "alg": "HS256", "k": URL_SAFE_NO_PAD.encode(secret)});
    let with_secret: JwkSet = serde_json::from_value(json!({"keys": [jwk]})).unwrap();
    for header in [json!({"alg": "HS256", "kid": "s"}), json!({"alg": "HS256"})] {
        let part = |value: &Value| URL_SAFE_NO_PAD.encode(value.to_string());
        let text = format!("{}.{}", part(&header), part(&good));
        let tag = hmac::sign(&hmac::Key::new(hmac::HMAC_SHA256, secret), text.as_bytes());
        let token = format!("{text}.{}", URL_SAFE_NO_PAD.encode(tag));
        wrong(verify(&token, &with_secret, expected), "algorithm");
    }
    for algorithm in ["HS256", "RS256", "none", "EdDSA"] {
        let found = signed(&key, json!({"alg": algorithm, "kid": "a"}));
        assert!(matches!(found, Err(Failure::Invalid(_))), "{algorithm}: {found:?}");
    }
    wrong(verify("nonsense", &keys, expected).map(|_| ()).map(|()| (String::new(), Default::default())), "");
}

#[test]
fn pages_repeat_no_long_texts_of_the_provider() {
    let refused = |error: &str| SignInError::Refused { error: error.to_owned(), description: None };
    assert_eq!(refused("server_error").to_string(), "the provider answers server_error");
    for free in ["<b>call this number</b>", "a b", &"a".repeat(61)] {
        assert_eq!(refused(free).to_string(), "the provider answers an unknown error");
    }
    let who = Who { identity: "https://idp.example 17".to_owned(), user: "Ada".to_owned() };
    let error = SignInError::NoRule { who, groups: vec!["g".repeat(1000); 30] };
    assert!(error.to_string().len() < 1500, "{error}");
    assert_eq!(error.who().map(|who| who.user.as_str()), Some("Ada"));
    assert!(
        error.ends_attempt() && !SignInError::Busy.ends_attempt() && !SignInError::NoAttempt.ends_attempt()
    );
}

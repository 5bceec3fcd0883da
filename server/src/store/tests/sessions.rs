//! Tests of tokens that expire, and of sessions.

use roost_api::token::Scope;

use super::super::*;
use super::*;

on_both_engines!(
    a_token_expires_at_its_time,
    a_user_has_one_token_for_all_sessions_of_a_project,
    a_revoked_user_gets_another_token,
    old_sessions_of_a_user_end_first,
    a_sign_in_ends_what_the_user_has_lost,
    all_servers_share_the_key_of_attempts,
);

const HOUR_MS: i64 = 3_600_000;

fn session(user: &str, scopes: &[Scope], expires_at: i64) -> NewSession {
    NewSession {
        identity: "https://idp.example 17".to_owned(),
        name: "sign-in at idp.example".to_owned(),
        user: user.to_owned(),
        project: "default".to_owned(),
        scopes: scopes.to_vec(),
        expires_at: Timestamp(expires_at),
    }
}

/// The valid token with this secret.
async fn token_of(store: &Store, secret: &str, now: i64) -> Option<Token> {
    let hash = blake3::hash(secret.as_bytes());
    store
        .tokens()
        .await
        .unwrap()
        .into_iter()
        .find(|token| token.hash == hash && token.is_valid(Timestamp(now)))
}

async fn a_token_expires_at_its_time(place: Place) {
    let mut file = TokenFile::open(&place.location, true).await.unwrap();
    let token = NewToken {
        name: "t",
        user: "u",
        project: "default",
        scopes: &[Scope::Read],
        expires_at: Some(Timestamp(HOUR_MS)),
    };
    let (view, secret) = file.create_for(token, Timestamp(0)).await.unwrap();
    assert_eq!(view.expires_at, Some(Timestamp(HOUR_MS)));
    assert_eq!(file.list().await.unwrap()[0], view);
    assert!(file.has_valid(Timestamp(HOUR_MS - 1)).await.unwrap());
    assert!(!file.has_valid(Timestamp(HOUR_MS)).await.unwrap());
    file.close().await.unwrap();
    let store = place.open().await;
    assert!(token_of(&store, &secret, HOUR_MS - 1).await.is_some());
    assert!(token_of(&store, &secret, HOUR_MS).await.is_none());
    store.close().await;
}

async fn a_user_has_one_token_for_all_sessions_of_a_project(place: Place) {
    let store = place.open().await;
    let begin = async |scopes: &[Scope], now: i64| {
        let begun = store.begin_session(session("Ada", scopes, now + HOUR_MS), Timestamp(now)).await;
        begun.unwrap().expect("the project exists")
    };
    let (first, laptop) = begin(&[Scope::Admin], 0).await;
    let (second, desk) = begin(&[Scope::Read], 1000).await;
    assert_eq!(first, second, "one token, so one owner with turns");
    assert_ne!(laptop, desk);
    let found = token_of(&store, &laptop, 2000).await.expect("the second sign-in ends no other session");
    assert_eq!((found.id, found.user.as_str(), found.is_session), (first.clone(), "Ada", true));
    assert_eq!(found.scopes, [Scope::Read], "the newest answer of the provider counts");
    let token = |tokens: Vec<Token>| tokens.into_iter().find(|token| !token.is_session).unwrap();
    let expiry = async || token(store.tokens().await.unwrap()).expires_at;
    assert_eq!(expiry().await, Some(Timestamp(1000 + HOUR_MS)), "that of the last session");

    let ended = store.end_session(&desk, Timestamp(3000)).await.unwrap().expect("a session");
    assert_eq!((ended.token, ended.user.as_str(), ended.project.as_str()), (first, "Ada", "default"));
    assert_eq!(store.end_session(&desk, Timestamp(3000)).await.unwrap(), None, "once");
    assert!(token_of(&store, &desk, 3000).await.is_none());
    assert!(token_of(&store, &laptop, 3000).await.is_some());
    assert_eq!(expiry().await, Some(Timestamp(HOUR_MS)));

    store.forget_sessions(Timestamp(HOUR_MS)).await.unwrap();
    assert_eq!(store.tokens().await.unwrap().len(), 2, "not yet");
    store.forget_sessions(Timestamp(HOUR_MS + 1)).await.unwrap();
    let left = store.tokens().await.unwrap();
    assert_eq!(left.len(), 1, "the token stays, since jobs name it");
    let nowhere = NewSession { project: "nowhere".to_owned(), ..session("Ada", &[], 0) };
    assert_eq!(store.begin_session(nowhere, Timestamp(0)).await.unwrap(), None);
    store.close().await;
}

async fn a_revoked_user_gets_another_token(place: Place) {
    let store = place.open().await;
    let begin = async |user: &str| {
        store.begin_session(session(user, &[Scope::Read], HOUR_MS), Timestamp(0)).await.unwrap().unwrap()
    };
    let (first, secret) = begin("Ada").await;
    let mut file = TokenFile::open(&place.location, false).await.unwrap();
    assert!(file.revoke(&first, Timestamp(1)).await.unwrap());
    file.close().await.unwrap();
    assert!(token_of(&store, &secret, 1).await.is_none(), "all sessions of the token have ended");
    let (second, _) = begin("Ada").await;
    assert_ne!(first, second);
    let (renamed, _) = begin("Ada Lovelace").await;
    assert_ne!(second, renamed, "the user of a token never changes");
    store.close().await;
}

async fn old_sessions_of_a_user_end_first(place: Place) {
    let store = place.open().await;
    let mut secrets = Vec::new();
    for now in 0..21 {
        let begun = store.begin_session(session("Ada", &[Scope::Read], HOUR_MS), Timestamp(now)).await;
        secrets.push(begun.unwrap().unwrap().1);
    }
    assert!(token_of(&store, &secrets[0], 30).await.is_none());
    for secret in &secrets[1..] {
        assert!(token_of(&store, secret, 30).await.is_some());
    }
    store.close().await;
}

async fn a_sign_in_ends_what_the_user_has_lost(place: Place) {
    let mut file = TokenFile::open(&place.location, true).await.unwrap();
    file.create_project("wax", ProjectChange::default()).await.unwrap();
    file.close().await.unwrap();
    let store = place.open().await;
    let begin = async |new: NewSession, now: i64| {
        store.begin_session(new, Timestamp(now)).await.unwrap().map(|(_, secret)| secret)
    };
    let is_valid = async |secret: &str, now: i64| token_of(&store, secret, now).await.is_some();
    let ada = |project: &str, user: &str| NewSession {
        project: project.to_owned(),
        ..session(user, &[Scope::Submit], HOUR_MS)
    };
    let eve = NewSession { identity: "https://idp.example 18".to_owned(), ..ada("wax", "Eve") };
    let stranger = begin(eve, 0).await.unwrap();
    let in_wax = begin(ada("wax", "Ada"), 0).await.unwrap();
    let in_default = begin(ada("default", "Ada"), 1).await.unwrap();
    assert!(!is_valid(&in_wax, 2).await, "the user has left the group of this project");
    assert!(is_valid(&in_default, 2).await);
    let renamed = begin(ada("default", "Ada Lovelace"), 3).await.unwrap();
    assert!(!is_valid(&in_default, 4).await, "the token of the old name");
    assert!(is_valid(&renamed, 4).await);
    let ends: Vec<_> = store.tokens().await.unwrap();
    let valid = ends.iter().filter(|token| !token.is_session && token.is_valid(Timestamp(4)));
    assert_eq!(valid.count(), 2, "one for each user: {ends:?}");

    assert_eq!(begin(ada("nowhere", "Ada Lovelace"), 5).await, None);
    assert!(!is_valid(&renamed, 6).await, "the rule of the user names another project now");
    let again = begin(ada("wax", "Ada"), 7).await.unwrap();
    assert!(is_valid(&again, 8).await, "the first token is used again");
    store.end_sessions("https://idp.example 17".to_owned(), Timestamp(9)).await.unwrap();
    assert!(!is_valid(&again, 10).await, "no rule fits");
    assert!(is_valid(&stranger, 10).await, "sessions of other users stay");
    store.close().await;
}

async fn all_servers_share_the_key_of_attempts(place: Place) {
    let store = place.open().await;
    let key = store.sign_in_key().await.unwrap();
    assert_ne!(key, [0; blake3::KEY_LEN]);
    store.close().await;
    let store = place.open().await;
    assert_eq!(store.sign_in_key().await.unwrap(), key);
    store.close().await;
}

//! Sessions of users who signed in with an identity provider.
//!
//! A user has one token in a project, whatever the number of sign-ins, since each token has its own turns in the queue. Every sign-in adds
//! a session: another secret of this token, with an expiry of its own. So no sign-in ends the session of another browser.

use ring::rand::{SecureRandom as _, SystemRandom};
use roost_api::time::Timestamp;
use roost_api::token::Scope;
use uuid::Uuid;

use super::columns::{corrupt, to_json};
use super::database::{Connection, query, query_as, query_scalar};
use super::tokens::new_secret;
use super::{Store, StoreError};

/// Sessions of a token at the same time. The oldest ones end.
const MAX_SESSIONS: i64 = 20;

/// A session to begin.
#[derive(Clone, Debug)]
pub(crate) struct NewSession {
    /// The user at the identity provider, for ever: its issuer and subject.
    pub(crate) identity: String,
    /// Name of the token in lists.
    pub(crate) name: String,
    /// Name of the user.
    pub(crate) user: String,
    /// Name of the project.
    pub(crate) project: String,
    /// The scopes of the token from now on.
    pub(crate) scopes: Vec<Scope>,
    /// The end of the session.
    pub(crate) expires_at: Timestamp,
}

/// A session that ended.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct EndedSession {
    /// Id of its token.
    pub(crate) token: String,
    /// Its user.
    pub(crate) user: String,
    /// Its project.
    pub(crate) project: String,
}

impl Store {
    /// The key of attempts to sign in, which all servers of the database share. It is made once.
    pub(crate) async fn sign_in_key(&self) -> Result<[u8; blake3::KEY_LEN], StoreError> {
        let mut new = [0; blake3::KEY_LEN];
        SystemRandom::new().fill(&mut new).expect("the system has random numbers");
        let new = blake3::Hash::from_bytes(new).to_hex().to_string();
        let write = self.writer.write(move |tx| {
            Box::pin(async move {
                let sql = "INSERT INTO sign_in_keys (id, secret) VALUES (0, ?) ON CONFLICT (id) DO NOTHING";
                query(sql).bind(new).execute(&mut *tx).await?;
                let find = "SELECT secret FROM sign_in_keys WHERE id = 0";
                Ok(query_scalar::<String>(find).fetch_one(tx).await?)
            })
        });
        let key = blake3::Hash::from_hex(write.await?).map_err(|error| corrupt("key of sign-in", error))?;
        Ok(*key.as_bytes())
    }

    /// Begins a session. Returns the id of its token, and its secret, which is not stored; none without such a project. All sessions of the
    /// user with another token end in any case, since the newest answer of the provider counts.
    pub(crate) async fn begin_session(
        &self,
        session: NewSession,
        now: Timestamp,
    ) -> Result<Option<(String, String)>, StoreError> {
        let scopes = to_json("scopes", &session.scopes)?;
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let find = "SELECT id FROM projects WHERE name = ?";
                    let project = query_scalar(find).bind(&session.project).fetch_optional(&mut *tx).await?;
                    let Some(project) = project else {
                        end_sessions(tx, &session.identity, "", now).await?;
                        return Ok(None);
                    };
                    let token = token_of(tx, &session, project, &scopes, now).await?;
                    end_sessions(tx, &session.identity, &token, now).await?;
                    let secret = new_secret();
                    query("INSERT INTO sessions (hash, token_id, created_at, expires_at) VALUES (?, ?, ?, ?)")
                        .bind(hash(&secret))
                        .bind(&token)
                        .bind(now.0)
                        .bind(session.expires_at.0)
                        .execute(&mut *tx)
                        .await?;
                    let sql = "DELETE FROM sessions WHERE token_id = ?1 AND hash NOT IN (
                                   SELECT hash FROM sessions WHERE token_id = ?1 ORDER BY created_at DESC, hash LIMIT ?2)";
                    query(sql).bind(&token).bind(MAX_SESSIONS).execute(&mut *tx).await?;
                    update_expiry(tx, &token, now).await?;
                    Ok(Some((token, secret)))
                })
            })
            .await
    }

    /// Ends all sessions of a user of the identity provider.
    pub(crate) async fn end_sessions(&self, identity: String, now: Timestamp) -> Result<(), StoreError> {
        self.writer.write(move |tx| Box::pin(async move { end_sessions(tx, &identity, "", now).await })).await
    }

    /// Ends the session with this secret, if there is one.
    pub(crate) async fn end_session(
        &self,
        secret: &str,
        now: Timestamp,
    ) -> Result<Option<EndedSession>, StoreError> {
        let hash = hash(secret);
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    let find = "SELECT t.id, t.user_name, p.name FROM sessions s
                                JOIN tokens t ON t.id = s.token_id JOIN projects p ON p.id = t.project WHERE s.hash = ?";
                    let found: Option<(String, String, String)> =
                        query_as(find).bind(&hash).fetch_optional(&mut *tx).await?;
                    let Some((token, user, project)) = found else { return Ok(None) };
                    query("DELETE FROM sessions WHERE hash = ?").bind(&hash).execute(&mut *tx).await?;
                    update_expiry(tx, &token, now).await?;
                    Ok(Some(EndedSession { token, user, project }))
                })
            })
            .await
    }

    /// Deletes sessions that expired before a moment. Their tokens stay: jobs and the audit log name them.
    pub(crate) async fn forget_sessions(&self, before: Timestamp) -> Result<(), StoreError> {
        self.writer
            .write(move |tx| {
                Box::pin(async move {
                    query("DELETE FROM sessions WHERE expires_at < ?").bind(before.0).execute(tx).await?;
                    Ok(())
                })
            })
            .await
    }
}

fn hash(secret: &str) -> String {
    blake3::hash(secret.as_bytes()).to_hex().to_string()
}

/// The token of the user in a project, with the scopes of the present sign-in. It is made at the first one.
async fn token_of(
    tx: &mut Connection,
    session: &NewSession,
    project: i64,
    scopes: &str,
    now: Timestamp,
) -> Result<String, StoreError> {
    let find =
        "SELECT id FROM tokens WHERE identity = ? AND user_name = ? AND project = ? AND revoked_at IS NULL";
    let found: Option<String> = query_scalar(find)
        .bind(&session.identity)
        .bind(&session.user)
        .bind(project)
        .fetch_optional(&mut *tx)
        .await?;
    if let Some(id) = found {
        query("UPDATE tokens SET scopes = ? WHERE id = ?").bind(scopes).bind(&id).execute(tx).await?;
        return Ok(id);
    }
    let id = Uuid::now_v7().to_string();
    let sql = "INSERT INTO tokens (id, name, hash, scopes, created_at, user_name, project, identity) VALUES (?, ?, ?, ?, ?, ?, ?, ?)";
    query(sql)
        .bind(&id)
        .bind(&session.name)
        // Nobody ever gets its secret: the token is used through sessions alone.
        .bind(hash(&new_secret()))
        .bind(scopes)
        .bind(now.0)
        .bind(&session.user)
        .bind(project)
        .bind(&session.identity)
        .execute(tx)
        .await?;
    Ok(id)
}

/// Ends the sessions of all tokens of a user but one. These tokens expire.
async fn end_sessions(
    tx: &mut Connection,
    identity: &str,
    kept: &str,
    now: Timestamp,
) -> Result<(), StoreError> {
    let sql = "DELETE FROM sessions WHERE token_id IN (SELECT id FROM tokens WHERE identity = ? AND id <> ?)";
    query(sql).bind(identity).bind(kept).execute(&mut *tx).await?;
    let sql = "UPDATE tokens SET expires_at = ?1
               WHERE identity = ?2 AND id <> ?3 AND (expires_at IS NULL OR expires_at > ?1)";
    query(sql).bind(now.0).bind(identity).bind(kept).execute(tx).await?;
    Ok(())
}

/// A token of sign-ins expires with its last session.
async fn update_expiry(tx: &mut Connection, token: &str, now: Timestamp) -> Result<(), StoreError> {
    let sql = "UPDATE tokens SET expires_at = coalesce((SELECT max(expires_at) FROM sessions WHERE token_id = ?1), ?2) WHERE id = ?1";
    query(sql).bind(token).bind(now.0).execute(tx).await?;
    Ok(())
}

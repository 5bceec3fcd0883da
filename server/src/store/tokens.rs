//! Access tokens, hashed. The server reads them; `roost token` writes them, with or without a running server.

use roost_api::project::DEFAULT_PROJECT;
use roost_api::time::Timestamp;
use roost_api::token::{Scope, TokenView};
use uuid::Uuid;

use super::columns::{Columns, corrupt, to_json};
use super::database::{Connection, Row, query, query_scalar, sqlite};
use super::migrations::{migrate, refuse_other};
use super::projects::ProjectError;
use super::{Location, Store, StoreError};

/// A stored token.
#[derive(Clone, Debug)]
pub(crate) struct Token {
    pub(crate) id: String,
    pub(crate) name: String,
    pub(crate) user: String,
    pub(crate) project: String,
    pub(crate) hash: blake3::Hash,
    pub(crate) scopes: Vec<Scope>,
    pub(crate) is_revoked: bool,
    pub(crate) expires_at: Option<Timestamp>,
    /// Whether a sign-in made its secret.
    pub(crate) is_session: bool,
}

impl Token {
    /// Whether it was neither revoked nor has expired.
    pub(crate) fn is_valid(&self, now: Timestamp) -> bool {
        !self.is_revoked && !self.has_expired(now)
    }

    /// Whether its time is over.
    pub(crate) fn has_expired(&self, now: Timestamp) -> bool {
        self.expires_at.is_some_and(|end| end <= now)
    }
}

impl Store {
    /// All tokens, revoked and expired ones included: a server without tokens admits everybody, one without valid tokens nobody. A token
    /// comes once more for each session, with the secret and the expiry of the session.
    pub(crate) async fn tokens(&self) -> Result<Vec<Token>, StoreError> {
        let sql = "SELECT t.id, t.name, t.user_name, p.name AS project_name, s.hash, t.scopes, t.revoked_at IS NOT NULL AS is_revoked, s.expires_at, s.is_session
                   FROM (SELECT id, hash, expires_at, 0 AS is_session FROM tokens
                         UNION ALL SELECT token_id, hash, expires_at, 1 FROM sessions) AS s
                   JOIN tokens t ON t.id = s.id JOIN projects p ON p.id = t.project";
        let rows = query(sql).fetch_all(&self.readers).await?;
        let token = |row: &Row| {
            let hash: String = row.column("hash")?;
            let hash = blake3::Hash::from_hex(hash).map_err(|error| corrupt("hash of a token", error))?;
            Ok(Token {
                id: row.column("id")?,
                name: row.column("name")?,
                user: row.column("user_name")?,
                project: row.column("project_name")?,
                hash,
                scopes: row.json("scopes")?,
                is_revoked: row.column("is_revoked")?,
                expires_at: row.moment_opt("expires_at")?,
                is_session: row.column("is_session")?,
            })
        };
        rows.iter().map(token).collect()
    }
}

/// The tokens and projects of a data directory. Opening it does not migrate the database of a running server.
pub struct TokenFile(pub(super) Connection);

/// A token to make.
#[derive(Clone, Copy, Debug)]
pub struct NewToken<'a> {
    /// A name for people.
    pub name: &'a str,
    /// Its user.
    pub user: &'a str,
    /// The name of its project.
    pub project: &'a str,
    /// Its scopes.
    pub scopes: &'a [Scope],
    /// When it expires; none for never.
    pub expires_at: Option<Timestamp>,
}

/// A new secret of a token.
pub(super) fn new_secret() -> String {
    // 244 bits of the system's random numbers.
    format!("roost_{}{}", Uuid::new_v4().simple(), Uuid::new_v4().simple())
}

impl TokenFile {
    /// Opens a database. `is_offline`: no server uses it, so that it is created and migrated as needed.
    pub(crate) async fn open(place: &Location, is_offline: bool) -> Result<Self, StoreError> {
        let mut connection: Connection = match place {
            Location::File(path) => {
                sqlite::connect(sqlite::options(path).create_if_missing(is_offline)).await?.0.into()
            }
            Location::Postgres(address) => address.connect().await?.0.into(),
        };
        let is_offline = is_offline && connection.locks_out_servers().await?;
        if is_offline {
            migrate(&mut connection).await?
        } else {
            refuse_other(&mut connection).await?
        }
        Ok(Self(connection))
    }

    /// Creates a token of the default project, whose name also names its user. Returns it with its secret, which is not stored.
    pub async fn create(
        &mut self,
        name: &str,
        scopes: &[Scope],
        now: Timestamp,
    ) -> Result<(TokenView, String), ProjectError> {
        self.create_for(
            NewToken { name, user: name, project: DEFAULT_PROJECT, scopes, expires_at: None },
            now,
        )
        .await
    }

    /// Creates a token of a user in a project.
    pub async fn create_for(
        &mut self,
        token: NewToken<'_>,
        now: Timestamp,
    ) -> Result<(TokenView, String), ProjectError> {
        let project = self.project_id(token.project).await?;
        let secret = new_secret();
        let id = Uuid::now_v7().to_string();
        let sql = "INSERT INTO tokens (id, name, hash, scopes, created_at, user_name, project, expires_at) VALUES (?, ?, ?, ?, ?, ?, ?, ?)";
        query(sql)
            .bind(&id)
            .bind(token.name)
            .bind(blake3::hash(secret.as_bytes()).to_hex().to_string())
            .bind(to_json("scopes", &token.scopes)?)
            .bind(now.0)
            .bind(token.user)
            .bind(project)
            .bind(token.expires_at.map(|end| end.0))
            .execute(&mut self.0)
            .await
            .map_err(StoreError::from)?;
        let view = TokenView {
            id,
            name: token.name.to_owned(),
            user: token.user.to_owned(),
            project: token.project.to_owned(),
            scopes: token.scopes.to_vec(),
            created_at: now,
            expires_at: token.expires_at,
            revoked_at: None,
        };
        Ok((view, secret))
    }

    /// All tokens, newest first.
    pub async fn list(&mut self) -> Result<Vec<TokenView>, StoreError> {
        let sql = "SELECT t.*, p.name AS project_name FROM tokens t JOIN projects p ON p.id = t.project ORDER BY t.id DESC";
        let rows = query(sql).fetch_all(&mut self.0).await?;
        let view = |row: &Row| {
            Ok(TokenView {
                id: row.column("id")?,
                name: row.column("name")?,
                user: row.column("user_name")?,
                project: row.column("project_name")?,
                scopes: row.json("scopes")?,
                created_at: row.moment("created_at")?,
                expires_at: row.moment_opt("expires_at")?,
                revoked_at: row.moment_opt("revoked_at")?,
            })
        };
        rows.iter().map(view).collect()
    }

    /// Revokes a token. Returns whether it was valid.
    pub async fn revoke(&mut self, id: &str, now: Timestamp) -> Result<bool, StoreError> {
        let done = query("UPDATE tokens SET revoked_at = ? WHERE id = ? AND revoked_at IS NULL")
            .bind(now.0)
            .bind(id)
            .execute(&mut self.0)
            .await?;
        Ok(done.rows_affected() > 0)
    }

    /// Whether a valid token exists.
    pub async fn has_valid(&mut self, now: Timestamp) -> Result<bool, StoreError> {
        let sql = "SELECT EXISTS (SELECT 1 FROM tokens WHERE revoked_at IS NULL AND (expires_at IS NULL OR expires_at > ?))";
        Ok(query_scalar(sql).bind(now.0).fetch_one(&mut self.0).await?)
    }

    /// Closes the file.
    pub async fn close(self) -> Result<(), StoreError> {
        Ok(self.0.close().await?)
    }
}

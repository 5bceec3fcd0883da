-- Tokens that expire, and sessions of users who signed in with an identity provider.

ALTER TABLE tokens ADD COLUMN expires_at INTEGER;

-- Issuer and subject of a user at the identity provider; null for tokens that `roost token` made.
ALTER TABLE tokens ADD COLUMN identity TEXT;

-- One token for each user and project, however often the user signs in: each token has its own turns in the queue.
CREATE UNIQUE INDEX tokens_by_identity ON tokens (identity, user_name, project) WHERE identity IS NOT NULL AND revoked_at IS NULL;

-- A session is another secret of a token. The secret itself is nowhere.
CREATE TABLE sessions (
    hash       TEXT    NOT NULL PRIMARY KEY,                  -- blake3
    token_id   TEXT    NOT NULL REFERENCES tokens (id),
    created_at INTEGER NOT NULL,
    expires_at INTEGER NOT NULL
) STRICT;

CREATE INDEX sessions_by_token ON sessions (token_id, created_at);

-- The key of attempts to sign in, which all servers share: one row. It is of no use without the database, and opens nothing by itself.
CREATE TABLE sign_in_keys (
    id     INTEGER NOT NULL PRIMARY KEY CHECK (id = 0),
    secret TEXT    NOT NULL                                   -- 32 random bytes in hexadecimal digits
) STRICT;

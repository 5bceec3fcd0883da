-- Sign-in, as the migration 0023 of SQLite makes it. Its comments explain tables and columns.

ALTER TABLE tokens ADD COLUMN expires_at BIGINT;
ALTER TABLE tokens ADD COLUMN identity TEXT;

CREATE UNIQUE INDEX tokens_by_identity ON tokens (identity, user_name, project) WHERE identity IS NOT NULL AND revoked_at IS NULL;

CREATE TABLE sessions (
    hash       TEXT   NOT NULL PRIMARY KEY,
    token_id   TEXT   NOT NULL REFERENCES tokens (id),
    created_at BIGINT NOT NULL,
    expires_at BIGINT NOT NULL
);

CREATE INDEX sessions_by_token ON sessions (token_id, created_at);

CREATE TABLE sign_in_keys (
    id     BIGINT NOT NULL PRIMARY KEY CHECK (id = 0),
    secret TEXT   NOT NULL
);

-- What the API remembers: what happened to jobs, which submissions were answered already, who may do what.

-- Every visible change of a job, for event streams that resume and for the tags of what is polled. Old ones go.
CREATE TABLE events (
    seq           INTEGER PRIMARY KEY AUTOINCREMENT,
    at            INTEGER NOT NULL,
    sweep_id      TEXT,
    job_id        TEXT    NOT NULL,
    state         TEXT    NOT NULL,
    attempt       INTEGER NOT NULL,
    cancelling    INTEGER NOT NULL,
    failure_class TEXT
) STRICT;

CREATE INDEX events_of_sweep ON events (sweep_id, seq) WHERE sweep_id IS NOT NULL;
CREATE INDEX events_of_job ON events (job_id, seq);

CREATE TRIGGER jobs_change AFTER UPDATE ON jobs
WHEN (NEW.state, NEW.attempt, NEW.cancelling, NEW.not_before, NEW.alone)
     IS NOT (OLD.state, OLD.attempt, OLD.cancelling, OLD.not_before, OLD.alone)
BEGIN
    INSERT INTO events (at, sweep_id, job_id, state, attempt, cancelling, failure_class)
    VALUES (CAST(unixepoch('subsec') * 1000 AS INTEGER), NEW.sweep_id, NEW.id, NEW.state, NEW.attempt,
            NEW.cancelling, NEW.failure_class);
END;

-- Idempotency keys of submissions, kept for a day. The identifier is reserved before anything is made under it, so that a repeat
-- finds what a crash left.
CREATE TABLE submissions (
    owner       TEXT    NOT NULL,                             -- the token, or nothing
    key         TEXT    NOT NULL,
    fingerprint TEXT    NOT NULL,                             -- blake3 of method, path and body
    reserved    TEXT    NOT NULL,                             -- identifier of what it makes
    status      INTEGER,                                      -- of the answer, once there is one
    location    TEXT,
    body        TEXT,
    created_at  INTEGER NOT NULL,
    PRIMARY KEY (owner, key)
) STRICT, WITHOUT ROWID;

CREATE INDEX submissions_by_age ON submissions (created_at);

-- Access tokens. The token itself is nowhere.
CREATE TABLE tokens (
    id         TEXT    NOT NULL PRIMARY KEY,
    name       TEXT    NOT NULL,
    hash       TEXT    NOT NULL UNIQUE,                       -- blake3
    scopes     TEXT    NOT NULL CHECK (json_valid(scopes)),
    created_at INTEGER NOT NULL,
    revoked_at INTEGER
) STRICT;

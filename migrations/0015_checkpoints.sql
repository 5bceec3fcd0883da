-- Checkpoints, attempts that end as `preempted`, and jobs that a user has paused.

-- The newest checkpoint of a job that has not ended. Its object was stored first.
CREATE TABLE checkpoints (
    job_id          TEXT    NOT NULL PRIMARY KEY REFERENCES jobs (id),
    attempt         INTEGER NOT NULL CHECK (attempt >= 1),
    object_digest   TEXT    NOT NULL,
    bytes           INTEGER NOT NULL CHECK (bytes >= 1),
    simulated_s     REAL    NOT NULL CHECK (simulated_s >= 0),
    -- Only workers with the same revision, backend and device can read it.
    solver_revision INTEGER NOT NULL,
    backend         TEXT    NOT NULL,
    device          TEXT    NOT NULL
) STRICT, WITHOUT ROWID;

CREATE INDEX checkpoints_by_object ON checkpoints (object_digest);

-- Objects that lost a name. The server soon removes those that no row names.
CREATE TABLE unnamed_objects (
    digest TEXT NOT NULL PRIMARY KEY
) STRICT, WITHOUT ROWID;

CREATE TRIGGER checkpoints_replaced AFTER UPDATE OF object_digest ON checkpoints
WHEN NEW.object_digest <> OLD.object_digest
BEGIN
    INSERT INTO unnamed_objects (digest) VALUES (OLD.object_digest) ON CONFLICT DO NOTHING;
END;

CREATE TRIGGER checkpoints_deleted AFTER DELETE ON checkpoints
BEGIN
    INSERT INTO unnamed_objects (digest) VALUES (OLD.object_digest) ON CONFLICT DO NOTHING;
END;

CREATE TRIGGER jobs_ended AFTER UPDATE OF ended_at ON jobs WHEN NEW.ended_at IS NOT NULL
BEGIN
    DELETE FROM checkpoints WHERE job_id = NEW.id;
END;

-- A new outcome. SQLite changes no CHECK: the table is copied.
CREATE TABLE new_attempts (
    job_id         TEXT    NOT NULL REFERENCES jobs (id),
    number         INTEGER NOT NULL CHECK (number >= 1),
    worker_id      TEXT    NOT NULL REFERENCES workers (id),
    request_id     TEXT    NOT NULL,                           -- the claim that made it
    outcome        TEXT    CHECK (outcome IN
                   ('succeeded', 'invalid', 'unstable', 'worker', 'lost', 'timeout', 'released', 'preempted', 'cancelled')),
    message        TEXT,
    partial_digest TEXT    REFERENCES documents (digest),
    claimed_at     INTEGER NOT NULL,
    ended_at       INTEGER,
    resumed_from_s REAL    CHECK (resumed_from_s >= 0),        -- simulated time of its checkpoint; null from zero
    PRIMARY KEY (job_id, number),
    CHECK ((outcome IS NULL) = (ended_at IS NULL))
) STRICT, WITHOUT ROWID;

INSERT INTO new_attempts
SELECT job_id, number, worker_id, request_id, outcome, message, partial_digest, claimed_at, ended_at, NULL FROM attempts;
DROP TABLE attempts;
ALTER TABLE new_attempts RENAME TO attempts;

CREATE INDEX attempts_by_request ON attempts (request_id, worker_id);
CREATE INDEX attempts_by_worker ON attempts (worker_id, outcome);
CREATE INDEX attempts_by_partial ON attempts (partial_digest) WHERE partial_digest IS NOT NULL;

-- No worker claims a paused job, and the worker of a running one hands it back.
ALTER TABLE jobs ADD COLUMN paused INTEGER NOT NULL DEFAULT 0
    CHECK (paused = 0 OR (paused = 1 AND ended_at IS NULL));
ALTER TABLE events ADD COLUMN paused INTEGER NOT NULL DEFAULT 0;

DROP INDEX jobs_to_claim;
CREATE INDEX jobs_to_claim ON jobs (priority DESC, owner, queue_position, seq, needs_backend, needs_memory_mib)
    WHERE state = 'queued' AND not_before IS NULL AND paused = 0;
DROP INDEX jobs_paused;
CREATE INDEX jobs_by_not_before ON jobs (not_before) WHERE not_before IS NOT NULL;
CREATE INDEX jobs_paused ON jobs (sweep_id, state, not_before) WHERE paused = 1;

DROP TRIGGER jobs_change;
CREATE TRIGGER jobs_change AFTER UPDATE ON jobs
WHEN (NEW.state, NEW.attempt, NEW.cancelling, NEW.paused, NEW.not_before, NEW.alone)
     IS NOT (OLD.state, OLD.attempt, OLD.cancelling, OLD.paused, OLD.not_before, OLD.alone)
BEGIN
    INSERT INTO events (at, sweep_id, job_id, state, attempt, cancelling, paused, failure_class)
    VALUES (CAST(unixepoch('subsec') * 1000 AS INTEGER), NEW.sweep_id, NEW.id, NEW.state, NEW.attempt,
            NEW.cancelling, NEW.paused, NEW.failure_class);
END;

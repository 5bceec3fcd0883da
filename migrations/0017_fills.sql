-- Filled states that jobs share: checkpoints at t = 0, by what acted before.

-- Whether a job may start from a shared fill, and the digest of what acts before t = 0; null for a job that shares none.
ALTER TABLE jobs ADD COLUMN shared_fill INTEGER NOT NULL DEFAULT 1 CHECK (shared_fill IN (0, 1));
ALTER TABLE jobs ADD COLUMN fill_digest TEXT;
ALTER TABLE attempts ADD COLUMN filled_by TEXT CHECK (filled_by IN ('attempt', 'shared'));

-- A fill is being computed (with an attempt), stored (with an object), or withdrawn (with neither): then every job fills for itself.
-- It counts as being computed only while the attempt runs.
CREATE TABLE fills (
    fill_digest     TEXT    NOT NULL,
    -- Only workers with the same revision, backend and device can read it.
    solver_revision INTEGER NOT NULL,
    backend         TEXT    NOT NULL,
    device          TEXT    NOT NULL,
    job_id          TEXT,
    attempt         INTEGER CHECK (attempt >= 1),
    object_digest   TEXT,
    bytes           INTEGER CHECK (bytes >= 1),
    used_at         INTEGER NOT NULL,
    PRIMARY KEY (fill_digest, solver_revision, backend, device),
    CHECK ((job_id IS NULL) = (attempt IS NULL) AND (object_digest IS NULL) = (bytes IS NULL)
           AND (job_id IS NULL OR object_digest IS NULL))
) STRICT, WITHOUT ROWID;

CREATE INDEX fills_by_object ON fills (object_digest) WHERE object_digest IS NOT NULL;
CREATE INDEX fills_by_job ON fills (job_id, attempt) WHERE job_id IS NOT NULL;
CREATE INDEX fills_by_use ON fills (used_at, bytes);

CREATE TRIGGER fills_replaced AFTER UPDATE OF object_digest ON fills
WHEN OLD.object_digest IS NOT NULL AND NEW.object_digest IS NOT OLD.object_digest
BEGIN
    INSERT INTO unnamed_objects (digest) VALUES (OLD.object_digest) ON CONFLICT DO NOTHING;
END;

CREATE TRIGGER fills_deleted AFTER DELETE ON fills WHEN OLD.object_digest IS NOT NULL
BEGIN
    INSERT INTO unnamed_objects (digest) VALUES (OLD.object_digest) ON CONFLICT DO NOTHING;
END;

-- The core: workers, sweeps with their design points, jobs, attempts and results.

CREATE TABLE workers (
    id               TEXT    NOT NULL PRIMARY KEY,
    name             TEXT    NOT NULL,
    solver_revision INTEGER NOT NULL,
    backend          TEXT    NOT NULL,
    device           TEXT    NOT NULL,
    threads          INTEGER NOT NULL,
    registered_at    INTEGER NOT NULL,
    last_seen_at     INTEGER NOT NULL
) STRICT;

CREATE TABLE sweeps (
    seq          INTEGER PRIMARY KEY AUTOINCREMENT,
    id           TEXT    NOT NULL UNIQUE,
    name         TEXT    NOT NULL,
    spec         TEXT    NOT NULL CHECK (json_valid(spec)),
    factors      TEXT    NOT NULL CHECK (json_valid(factors)), -- pointers, in the order of the spec
    labels       TEXT    NOT NULL CHECK (json_valid(labels)),
    points       INTEGER NOT NULL CHECK (points >= 1),
    replicates   INTEGER NOT NULL CHECK (replicates >= 1),
    submitted_at INTEGER NOT NULL
) STRICT;

-- The design matrix. A point's index means the same levels for ever.
CREATE TABLE points (
    sweep_id TEXT    NOT NULL REFERENCES sweeps (id),
    idx      INTEGER NOT NULL,
    levels   TEXT    NOT NULL CHECK (json_valid(levels)),      -- level by pointer
    PRIMARY KEY (sweep_id, idx)
) STRICT, WITHOUT ROWID;

CREATE TRIGGER points_are_immutable BEFORE UPDATE ON points
BEGIN
    SELECT RAISE(ABORT, 'a design point never changes');
END;

-- Scenarios as run, by the digest of their canonical JSON: repeats of one scenario share a row.
CREATE TABLE scenarios (
    digest TEXT NOT NULL PRIMARY KEY,
    body   TEXT NOT NULL CHECK (json_valid(body))
) STRICT;

CREATE TABLE jobs (
    seq              INTEGER PRIMARY KEY AUTOINCREMENT,
    id               TEXT    NOT NULL UNIQUE,
    sweep_id         TEXT    REFERENCES sweeps (id),
    point            INTEGER,
    replicate        INTEGER,
    digest           TEXT    NOT NULL REFERENCES scenarios (digest),
    seed             INTEGER NOT NULL,
    priority         INTEGER NOT NULL,
    turn             INTEGER NOT NULL,                         -- see `turns`
    labels           TEXT    NOT NULL CHECK (json_valid(labels)),
    needs_backend    TEXT,
    max_wall_s       REAL,
    cache            TEXT    NOT NULL CHECK (cache IN ('use', 'bypass')),
    state            TEXT    NOT NULL DEFAULT 'queued'
                     CHECK (state IN ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    cancelling       INTEGER NOT NULL DEFAULT 0 CHECK (cancelling IN (0, 1)),
    attempt          INTEGER NOT NULL DEFAULT 0,               -- number of the newest one
    forgiven         INTEGER NOT NULL DEFAULT 0,               -- attempts up to this number count against no limit
    worker_id        TEXT    REFERENCES workers (id),
    lease_expires_at INTEGER,
    failure_class    TEXT    CHECK (failure_class IN ('invalid', 'unstable', 'worker', 'lost', 'timeout')),
    failure_message  TEXT,
    from_cache       INTEGER NOT NULL DEFAULT 0 CHECK (from_cache IN (0, 1)),
    submitted_at     INTEGER NOT NULL,
    started_at       INTEGER,
    ended_at         INTEGER,
    FOREIGN KEY (sweep_id, point) REFERENCES points (sweep_id, idx),
    CHECK ((state = 'running') = (lease_expires_at IS NOT NULL)),
    CHECK ((state = 'failed') = (failure_class IS NOT NULL)),
    CHECK ((state IN ('succeeded', 'failed', 'cancelled')) = (ended_at IS NOT NULL)),
    CHECK (cancelling = 0 OR state = 'running')
) STRICT;

CREATE INDEX jobs_to_claim ON jobs (priority DESC, turn, seq) WHERE state = 'queued';
CREATE INDEX jobs_by_lease ON jobs (lease_expires_at) WHERE state = 'running';
CREATE INDEX jobs_of_sweep ON jobs (sweep_id) WHERE sweep_id IS NOT NULL;
CREATE INDEX jobs_by_sweep ON jobs (sweep_id, state) WHERE sweep_id IS NOT NULL;
-- Partial, so that it never looks better to the planner than the two for the queue and the leases.
CREATE INDEX jobs_ended ON jobs (state, seq) WHERE ended_at IS NOT NULL;
CREATE INDEX jobs_by_worker ON jobs (worker_id) WHERE state = 'running';

-- Round-robin: the jobs of a sweep take one turn each, counted from the turn the queue of that priority has
-- come to, so that the order of `jobs_to_claim` alternates between sweeps and a late one neither waits
-- for those before it nor pushes them aside.
CREATE TABLE turns (
    priority INTEGER NOT NULL PRIMARY KEY,
    turn     INTEGER NOT NULL
) STRICT;

-- Result documents, by the blake3 of their text: a result taken from the store names the same row.
CREATE TABLE documents (
    digest TEXT NOT NULL PRIMARY KEY,
    body   TEXT NOT NULL
) STRICT;

CREATE TABLE attempts (
    job_id     TEXT    NOT NULL REFERENCES jobs (id),
    number     INTEGER NOT NULL CHECK (number >= 1),
    worker_id  TEXT    NOT NULL REFERENCES workers (id),
    request_id TEXT    NOT NULL,                               -- the claim that made it
    outcome    TEXT    CHECK (outcome IN
               ('succeeded', 'invalid', 'unstable', 'worker', 'lost', 'timeout', 'released', 'cancelled')),
    message    TEXT,
    partial    TEXT    REFERENCES documents (digest),          -- what an unstable, cancelled or late run left
    claimed_at INTEGER NOT NULL,
    ended_at   INTEGER,
    PRIMARY KEY (job_id, number),
    CHECK ((outcome IS NULL) = (ended_at IS NULL))
) STRICT, WITHOUT ROWID;

CREATE INDEX attempts_by_request ON attempts (request_id, worker_id);
CREATE INDEX attempts_by_worker ON attempts (worker_id, outcome);

-- One row a job, for ever: a result is recorded exactly once.
CREATE TABLE results (
    job_id           TEXT    NOT NULL PRIMARY KEY REFERENCES jobs (id),
    attempt          INTEGER NOT NULL,                         -- 0 when taken from the store
    digest           TEXT    NOT NULL,                         -- of the scenario
    solver_revision INTEGER NOT NULL,
    backend          TEXT    NOT NULL,
    responses        TEXT    NOT NULL CHECK (json_valid(responses)),
    document         TEXT    NOT NULL REFERENCES documents (digest),
    recorded_at      INTEGER NOT NULL
) STRICT;

CREATE INDEX results_by_digest ON results (digest, solver_revision);

CREATE TRIGGER results_are_immutable BEFORE UPDATE ON results
BEGIN
    SELECT RAISE(ABORT, 'a result is recorded once');
END;

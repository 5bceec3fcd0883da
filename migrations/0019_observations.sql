-- Studies: runs that are not jobs of their own, and wider ranges.

-- The present ranges of the factors, [[low, high], …]; null as submitted.
ALTER TABLE studies ADD COLUMN ranges TEXT CHECK (json_valid(ranges));
-- Attempts at a confirmation before the ranges grew: their runs belong to the search now.
ALTER TABLE studies ADD COLUMN past_attempts INTEGER NOT NULL DEFAULT 0;
-- Who runs the proposals: the jobs of the server, or clients that ask for them.
ALTER TABLE studies ADD COLUMN driver TEXT NOT NULL DEFAULT 'server' CHECK (driver IN ('server', 'client'));
-- The sweeps that it began with: numbers of their runs that were copied or left out.
ALTER TABLE studies ADD COLUMN seeding TEXT NOT NULL DEFAULT '[]' CHECK (json_valid(seeding));
-- Changes of ranges and observations so far: a decision follows each.
ALTER TABLE studies ADD COLUMN news INTEGER NOT NULL DEFAULT 0;

-- A run that is no job of the study: copied from a sweep, handed out to a client, or told by a client for a point of its own.
CREATE TABLE observations (
    study_id      TEXT    NOT NULL REFERENCES studies (sweep_id),
    number        INTEGER NOT NULL CHECK (number >= 1),        -- within the study
    source        TEXT    NOT NULL CHECK (source IN ('sweep', 'asked', 'client')),
    state         TEXT    NOT NULL CHECK (state IN ('handed_out', 'done', 'failed', 'given_back', 'expired')),
    origin        TEXT,                                        -- the sweep that it was copied from
    levels        TEXT    NOT NULL CHECK (json_valid(levels)), -- values by factor
    replicate     INTEGER NOT NULL,
    seed          INTEGER NOT NULL,
    responses     TEXT             CHECK (json_valid(responses)),
    handed_out_at INTEGER,
    expires_at    INTEGER,
    recorded_at   INTEGER,                                     -- when its outcome was copied or told
    PRIMARY KEY (study_id, number),
    CHECK ((origin IS NULL) = (source <> 'sweep') AND (expires_at IS NULL) = (source <> 'asked')
           AND (responses IS NULL) = (state <> 'done'))
) STRICT, WITHOUT ROWID;

-- A client tells a run of its own by its point and its seed.
CREATE UNIQUE INDEX observations_of_clients ON observations (study_id, levels, seed) WHERE source = 'client';
CREATE INDEX observations_handed_out ON observations (expires_at) WHERE state = 'handed_out';

-- Requests for runs that had an Idempotency-Key, with what they were given: a repeat is given the same.
CREATE TABLE asks (
    request_id TEXT NOT NULL PRIMARY KEY,
    study_id   TEXT NOT NULL REFERENCES studies (sweep_id),
    numbers    TEXT NOT NULL CHECK (json_valid(numbers)),      -- of runs that were handed out
    jobs       TEXT NOT NULL CHECK (json_valid(jobs))
) STRICT;
CREATE INDEX asks_of_studies ON asks (study_id);

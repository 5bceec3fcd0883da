-- Designs of every kind, sweeps that grow and sweeps that can be deleted.

ALTER TABLE sweeps ADD COLUMN design TEXT NOT NULL DEFAULT 'grid'
    CHECK (design IN ('grid', 'one_at_a_time', 'random', 'latin_hypercube', 'sobol', 'box_behnken', 'list', 'csv'));
-- A sweep that is being deleted is no longer there for anybody; what is left of it goes piece by piece.
ALTER TABLE sweeps ADD COLUMN deleting INTEGER NOT NULL DEFAULT 0 CHECK (deleting IN (0, 1));

-- What a deletion asks: whether anybody else names a scenario or a document.
CREATE INDEX jobs_by_digest ON jobs (digest);
CREATE INDEX results_by_document ON results (document);
CREATE INDEX attempts_by_partial ON attempts (partial) WHERE partial IS NOT NULL;

-- What was added to sweeps after they were submitted; whoever adds under the same identifier again adds nothing.
CREATE TABLE extensions (
    id          TEXT    NOT NULL PRIMARY KEY,
    sweep_id    TEXT    NOT NULL REFERENCES sweeps (id),
    body        TEXT    NOT NULL CHECK (json_valid(body)),
    points      INTEGER NOT NULL,                              -- points of the sweep before
    replicates  INTEGER NOT NULL,                              -- its replicates before
    extended_at INTEGER NOT NULL
) STRICT;

CREATE INDEX extensions_of_sweep ON extensions (sweep_id);

-- What once was there.
CREATE TABLE deletions (
    seq        INTEGER PRIMARY KEY AUTOINCREMENT,
    sweep_id   TEXT    NOT NULL,
    name       TEXT    NOT NULL,
    deleted_at INTEGER NOT NULL
) STRICT;

-- Turns between owners, and labels of a sweep that are stored once.

-- Who asks for jobs: a token, or nobody (0), which is everybody on a server without tokens and whoever asked before this table was.
CREATE TABLE owners (
    id    INTEGER PRIMARY KEY,
    token TEXT    NOT NULL UNIQUE                              -- its identifier, or nothing
) STRICT;

INSERT INTO owners (id, token) VALUES (0, '');

-- The row in `owners` of who asked for it.
ALTER TABLE jobs ADD COLUMN owner INTEGER NOT NULL DEFAULT 0;

-- How far an owner's jobs of a priority have come. `turn`: the turn of the last job claimed, where a new sweep begins its own.
-- `round`: the round between the owners in which the last job was claimed.
ALTER TABLE turns RENAME TO turns_of_all;

CREATE TABLE turns (
    priority INTEGER NOT NULL,
    owner    INTEGER NOT NULL REFERENCES owners (id),
    turn     INTEGER NOT NULL,
    round    INTEGER NOT NULL,
    PRIMARY KEY (priority, owner)
) STRICT, WITHOUT ROWID;

INSERT INTO turns (priority, owner, turn, round) SELECT priority, 0, turn, 0 FROM turns_of_all;
DROP TABLE turns_of_all;

DROP INDEX jobs_to_claim;
CREATE INDEX jobs_to_claim ON jobs (priority DESC, owner, turn, seq, needs_backend, needs_memory_mib)
    WHERE state = 'queued' AND not_before IS NULL;

-- The labels of a sweep stand with the sweep; those of its jobs were copies of them.
UPDATE jobs SET labels = '{}' WHERE sweep_id IS NOT NULL AND labels <> '{}';

-- Designs of every kind, and sweeps that can be deleted.

ALTER TABLE sweeps ADD COLUMN design TEXT NOT NULL DEFAULT 'grid'
    CHECK (design IN ('grid', 'one_at_a_time', 'random', 'latin_hypercube', 'sobol', 'box_behnken', 'list', 'csv'));
-- A sweep that is being deleted is no longer there for anybody; what is left of it goes piece by piece.
ALTER TABLE sweeps ADD COLUMN deleting INTEGER NOT NULL DEFAULT 0 CHECK (deleting IN (0, 1));

-- What a deletion asks: whether anybody else names a scenario or a document.
CREATE INDEX jobs_by_digest ON jobs (digest);
CREATE INDEX results_by_document ON results (document);
CREATE INDEX attempts_by_partial ON attempts (partial) WHERE partial IS NOT NULL;

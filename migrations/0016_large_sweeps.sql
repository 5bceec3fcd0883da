-- Sweeps are stored and deleted in slices; one statement makes a sweep visible, and one hides it.

-- Only a sweep that is `ready` is visible. The next start of the server deletes the others.
ALTER TABLE sweeps ADD COLUMN state TEXT NOT NULL DEFAULT 'ready' CHECK (state IN ('submitting', 'ready', 'deleting'));
UPDATE sweeps SET state = 'deleting' WHERE deleting = 1;
ALTER TABLE sweeps DROP COLUMN deleting;
CREATE INDEX sweeps_hidden ON sweeps (seq) WHERE state <> 'ready';

-- The queue of a job among those of its owner: 0 is the common one. A sweep that is stored in slices has a queue of its own, `sweeps.seq`,
-- so that a claim can pass over all of its jobs in one step.
ALTER TABLE jobs ADD COLUMN queue INTEGER NOT NULL DEFAULT 0;

DROP INDEX jobs_to_claim;
CREATE INDEX jobs_to_claim ON jobs (priority DESC, owner, queue, queue_position, seq, needs_backend, needs_memory_mib)
    WHERE state = 'queued' AND not_before IS NULL AND paused = 0;

-- With the time of the end: whether a large sweep can be deleted is read from the end of this index.
DROP INDEX jobs_by_sweep;
CREATE INDEX jobs_by_sweep ON jobs (sweep_id, state, ended_at) WHERE sweep_id IS NOT NULL;

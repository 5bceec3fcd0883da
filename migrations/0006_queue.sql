-- Retries and placement: a pause before the next attempt, jobs that run alone, the moment an attempt must have ended, what
-- a job needs of a device and what a worker has.

ALTER TABLE workers ADD COLUMN memory_mib INTEGER CHECK (memory_mib >= 0);
ALTER TABLE workers ADD COLUMN draining INTEGER NOT NULL DEFAULT 0 CHECK (draining IN (0, 1));
CREATE INDEX workers_by_last_seen ON workers (last_seen_at);

ALTER TABLE jobs ADD COLUMN needs_memory_mib INTEGER CHECK (needs_memory_mib >= 0);
-- Until then nobody may claim it, on the clock of leases; set to null when the pause is over.
ALTER TABLE jobs ADD COLUMN not_before INTEGER CHECK (not_before IS NULL OR state = 'queued');
-- Lost together with others: what runs it shall run nothing else.
ALTER TABLE jobs ADD COLUMN alone INTEGER NOT NULL DEFAULT 0 CHECK (alone IN (0, 1));
-- When the newest attempt is past `max_wall_s`, on the clock of leases.
ALTER TABLE jobs ADD COLUMN deadline INTEGER;

-- What is needed stands in the index: jobs for other devices are passed by without a look at their rows.
DROP INDEX jobs_to_claim;
CREATE INDEX jobs_to_claim ON jobs (priority DESC, turn, seq, needs_backend, needs_memory_mib)
    WHERE state = 'queued' AND not_before IS NULL;
CREATE INDEX jobs_paused ON jobs (not_before) WHERE not_before IS NOT NULL;
CREATE INDEX jobs_by_deadline ON jobs (deadline) WHERE state = 'running' AND deadline IS NOT NULL;

-- Workers that are gone: a row of theirs can be removed once no attempt names it. The removal asks every job that names a worker, which
-- without this index would read them all.

DROP INDEX jobs_by_worker;
CREATE INDEX jobs_by_worker ON jobs (worker_id, state) WHERE worker_id IS NOT NULL;

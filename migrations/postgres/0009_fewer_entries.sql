-- A change of a job's state adds an entry to every index of `jobs` whose condition the job meets.

-- The running jobs are few, and `jobs_by_lease` lists them.
DROP INDEX jobs_by_deadline;

-- Only the running jobs of a worker are looked for. SQLite looks for all of them when it deletes a worker, to check a reference that
-- PostgreSQL does not check.
DROP INDEX jobs_by_worker;
CREATE INDEX jobs_by_worker ON jobs (worker_id) WHERE state = 'running';

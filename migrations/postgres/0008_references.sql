-- For each reference that a claim or a result writes, PostgreSQL looks up the other row and locks it, which also writes to its page.
-- These were a tenth of the time of a claim with its result. The rows are written by the only writer, which has just read or written the
-- rows they refer to, and deletes a row after those that refer to it. SQLite checks the same references in the same statements.
ALTER TABLE jobs DROP CONSTRAINT jobs_worker_id_fkey;
ALTER TABLE attempts DROP CONSTRAINT attempts_worker_id_fkey;
ALTER TABLE attempts DROP CONSTRAINT attempts_job_id_fkey;
ALTER TABLE results DROP CONSTRAINT results_job_id_fkey;
ALTER TABLE results DROP CONSTRAINT results_document_digest_fkey;

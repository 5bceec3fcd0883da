-- Retention: single jobs by the time of their end.

CREATE INDEX jobs_single_ended ON jobs (ended_at) WHERE sweep_id IS NULL;

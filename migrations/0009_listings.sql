-- Tables and listings of large sweeps: trials by point and replicate, failures by class.

CREATE INDEX jobs_by_point ON jobs (sweep_id, point, replicate) WHERE sweep_id IS NOT NULL;

-- Partial: only what has failed is in them.
CREATE INDEX jobs_failed ON jobs (failure_class) WHERE failure_class IS NOT NULL;
CREATE INDEX jobs_failed_of_sweep ON jobs (sweep_id, failure_class) WHERE failure_class IS NOT NULL;

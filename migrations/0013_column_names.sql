-- Names of tables and columns say what they hold. No value changes.

ALTER TABLE points RENAME TO design_points;
ALTER TABLE design_points RENAME COLUMN idx TO point;
DROP TRIGGER points_are_immutable;
CREATE TRIGGER design_points_are_immutable BEFORE UPDATE ON design_points
BEGIN
    SELECT RAISE(ABORT, 'a design point never changes');
END;

-- Digests say of what.
ALTER TABLE jobs RENAME COLUMN digest TO scenario_digest;
ALTER TABLE results RENAME COLUMN digest TO scenario_digest;
ALTER TABLE results RENAME COLUMN document TO document_digest;
ALTER TABLE attempts RENAME COLUMN partial TO partial_digest;
ALTER TABLE frames RENAME COLUMN object TO object_digest;
ALTER TABLE frames RENAME COLUMN stopped TO stop_reason;

-- Attempts up to the last retry by a user; they count against no limit.
ALTER TABLE jobs RENAME COLUMN forgiven TO attempts_before_retry;

-- The position of a job in the queue of its owner and priority, and how far each of these queues has come.
ALTER TABLE jobs RENAME COLUMN turn TO queue_position;
ALTER TABLE turns RENAME TO fair_share;
ALTER TABLE fair_share RENAME COLUMN turn TO queue_position;

ALTER TABLE owners RENAME COLUMN token TO token_id;
ALTER TABLE submissions RENAME COLUMN owner TO token_id;
ALTER TABLE submissions RENAME COLUMN reserved TO resource_id;
ALTER TABLE extensions RENAME COLUMN points TO points_before;
ALTER TABLE extensions RENAME COLUMN replicates TO replicates_before;

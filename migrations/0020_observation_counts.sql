-- Numbers of the observations of a study. A view of a study reads them, and counts none.
CREATE TABLE observation_counts (
    study_id       TEXT    NOT NULL PRIMARY KEY REFERENCES studies (sweep_id),
    done           INTEGER NOT NULL,                           -- handed out, with responses
    failed         INTEGER NOT NULL,                           -- handed out, and failed
    handed_out     INTEGER NOT NULL,                           -- without an outcome yet
    outside_budget INTEGER NOT NULL                            -- copied from sweeps, or told at points of clients
) STRICT, WITHOUT ROWID;

-- A run that was given back and handed out again counts once.
INSERT INTO observation_counts
SELECT study_id,
       count(DISTINCT CASE WHEN source = 'asked' AND state = 'done' THEN levels || seed END),
       count(DISTINCT CASE WHEN source = 'asked' AND state = 'failed' THEN levels || seed END),
       sum(state = 'handed_out'), sum(source <> 'asked')
FROM observations GROUP BY study_id;

-- For the triggers: the rows of the same run. Without statistics SQLite prefers the primary key, so that they name the index.
CREATE INDEX observations_by_seed ON observations (study_id, seed);

-- Observations are deleted only together with their study, and its row of numbers. None is added with the outcome of a run that was handed out.
CREATE TRIGGER observations_added AFTER INSERT ON observations
BEGIN
    INSERT INTO observation_counts (study_id, done, failed, handed_out, outside_budget)
    VALUES (NEW.study_id, 0, 0, NEW.state = 'handed_out', NEW.source <> 'asked')
    ON CONFLICT (study_id) DO UPDATE SET
        handed_out = handed_out + excluded.handed_out, outside_budget = outside_budget + excluded.outside_budget;
END;

CREATE TRIGGER observations_left_flight AFTER UPDATE OF state ON observations
WHEN OLD.state = 'handed_out' AND NEW.state <> 'handed_out'
BEGIN
    UPDATE observation_counts SET handed_out = handed_out - 1 WHERE study_id = NEW.study_id;
END;

-- An outcome stays. Another row of the same run may have it already.
CREATE TRIGGER observations_ended AFTER UPDATE OF state ON observations
WHEN NEW.source = 'asked' AND NEW.state IN ('done', 'failed') AND NEW.state <> OLD.state AND NOT EXISTS (
    SELECT 1 FROM observations other INDEXED BY observations_by_seed
    WHERE other.study_id = NEW.study_id AND other.seed = NEW.seed AND other.levels = NEW.levels
        AND other.source = 'asked' AND other.state = NEW.state AND other.number <> NEW.number)
BEGIN
    UPDATE observation_counts SET done = done + (NEW.state = 'done'), failed = failed + (NEW.state = 'failed')
    WHERE study_id = NEW.study_id;
END;

-- Projects: tokens belong to a user and a project, and claims are fair between projects first.

CREATE TABLE projects (
    id             INTEGER PRIMARY KEY,
    name           TEXT    NOT NULL UNIQUE,
    -- Jobs of the project per round of claims, while several projects have queued jobs.
    share          INTEGER NOT NULL DEFAULT 1 CHECK (share BETWEEN 1 AND 1000),
    -- Processor time in milliseconds: the limit, if any, and the sum over ended attempts. Deleted attempts still count.
    budget_core_ms INTEGER CHECK (budget_core_ms >= 0),
    used_core_ms   INTEGER NOT NULL DEFAULT 0
) STRICT;

-- The project of all earlier tokens, and of a server without tokens.
INSERT INTO projects (id, name) VALUES (0, 'default');

-- The projects that claims may have to pass over.
CREATE INDEX projects_with_budget ON projects (id, used_core_ms, budget_core_ms) WHERE budget_core_ms IS NOT NULL;

-- The user and the project of a token never change. The name of an earlier token names its user.
ALTER TABLE tokens ADD COLUMN user_name TEXT NOT NULL DEFAULT '';
ALTER TABLE tokens ADD COLUMN project INTEGER NOT NULL DEFAULT 0;
UPDATE tokens SET user_name = name;

-- The project of the token, beside the owner: claims read it.
ALTER TABLE owners ADD COLUMN project INTEGER NOT NULL DEFAULT 0;
CREATE INDEX owners_by_project ON owners (project);

-- The last turn of each project: its round, and how many turns the project had before in this round.
CREATE TABLE project_rounds (
    priority INTEGER NOT NULL,
    project  INTEGER NOT NULL REFERENCES projects (id),
    round    INTEGER NOT NULL,
    turn     INTEGER NOT NULL,
    -- The number of its last claim: higher than those of earlier claims of the priority.
    served   INTEGER NOT NULL,
    PRIMARY KEY (priority, project)
) STRICT, WITHOUT ROWID;

-- The same of each owner.
ALTER TABLE fair_share ADD COLUMN served INTEGER NOT NULL DEFAULT 0;

-- Jobs that a worker can run at the same time, as its claims say; null before the first one.
ALTER TABLE workers ADD COLUMN slots INTEGER CHECK (slots >= 1);

-- Processor time in milliseconds that an ended attempt counts. Attempts that ended before this version have none, except lost ones:
-- a late heartbeat may still show that one was never lost.
ALTER TABLE attempts ADD COLUMN core_ms INTEGER CHECK (core_ms >= 0);
UPDATE attempts SET core_ms = max(ended_at - claimed_at, 0) WHERE outcome = 'lost';

-- One thread of each earlier attempt.
UPDATE projects SET used_core_ms = (
    SELECT coalesce(sum(CASE WHEN ended_at > claimed_at THEN ended_at - claimed_at ELSE 0 END), 0) FROM attempts)
WHERE id = 0;

-- An attempt counts when it ends, and no longer if a late heartbeat shows that it was never lost.
CREATE TRIGGER attempts_counted AFTER UPDATE OF core_ms ON attempts
WHEN NEW.core_ms IS NOT OLD.core_ms
BEGIN
    UPDATE projects SET used_core_ms = used_core_ms + coalesce(NEW.core_ms, 0) - coalesce(OLD.core_ms, 0)
    WHERE id = (SELECT o.project FROM jobs j JOIN owners o ON o.id = j.owner WHERE j.id = NEW.job_id);
END;

-- Studies: a question about a sweep that the server grows. A study has the identifier of its sweep.

CREATE TABLE studies (
    sweep_id    TEXT    NOT NULL PRIMARY KEY REFERENCES sweeps (id),
    spec        TEXT    NOT NULL CHECK (json_valid(spec)),     -- as submitted
    question    TEXT    NOT NULL,                              -- in words
    max_runs    INTEGER NOT NULL,                              -- the budget, which may grow
    token_id    TEXT    NOT NULL DEFAULT '',                   -- the token that submitted it; empty without one
    state       TEXT    NOT NULL DEFAULT 'running' CHECK (state IN ('running', 'paused', 'finished', 'cancelled')),
    reason      TEXT,                                          -- why the server has paused it
    changes     INTEGER NOT NULL DEFAULT 0,                    -- changes so far, for versions
    finished    TEXT             CHECK (finished IN ('by_rule', 'by_budget', 'nothing_left')),
    decisions   INTEGER NOT NULL DEFAULT 0,                    -- decisions so far: the next one is stored only if none came between
    answer      TEXT             CHECK (json_valid(answer)),   -- numbers of the newest answer
    sentences   TEXT    NOT NULL DEFAULT '[]' CHECK (json_valid(sentences)),
    answered_at INTEGER
) STRICT;

-- Studies that the server decides about.
CREATE INDEX studies_running ON studies (sweep_id) WHERE state = 'running';

-- The newest solver of a server that has led this database. A server with an older one may not lead: results of two solvers must not be mixed.
CREATE TABLE newest_solver (
    id       INTEGER NOT NULL PRIMARY KEY CHECK (id = 0),     -- one row
    revision INTEGER NOT NULL                                 -- `SOLVER_REVISION`
) STRICT;

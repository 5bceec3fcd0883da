-- The newest solver of a server that has led this database, as the migration 0024 of SQLite makes it.
CREATE TABLE newest_solver (
    id       BIGINT NOT NULL PRIMARY KEY CHECK (id = 0),
    revision BIGINT NOT NULL
);

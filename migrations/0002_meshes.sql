-- Meshes: STL files by the blake3 of their bytes.

CREATE TABLE meshes (
    seq          INTEGER PRIMARY KEY AUTOINCREMENT,
    digest       TEXT    NOT NULL UNIQUE,
    bytes        INTEGER NOT NULL CHECK (bytes >= 1),
    format       TEXT    NOT NULL CHECK (format IN ('binary', 'ascii')),
    triangles    INTEGER NOT NULL CHECK (triangles >= 1),
    degenerate   INTEGER NOT NULL,
    open_edges   INTEGER NOT NULL,
    turned_edges INTEGER NOT NULL,
    low          TEXT    NOT NULL CHECK (json_valid(low)),     -- least x, y and z, in the file's numbers
    high         TEXT    NOT NULL CHECK (json_valid(high)),    -- greatest
    size         TEXT    NOT NULL CHECK (json_valid(size)),
    uploaded_at  INTEGER NOT NULL
) STRICT;

CREATE TRIGGER meshes_are_immutable BEFORE UPDATE ON meshes
BEGIN
    SELECT RAISE(ABORT, 'a mesh never changes');
END;

-- The files, in parts of 1 MiB, so that neither reading nor writing one holds all of it or keeps the writer. All parts are
-- there before the row of `meshes`: those that no row names are of an upload that broke off, and go when the server starts.
CREATE TABLE mesh_parts (
    digest TEXT    NOT NULL,
    part   INTEGER NOT NULL CHECK (part >= 0),
    data   BLOB    NOT NULL,
    PRIMARY KEY (digest, part)
) STRICT;

CREATE TRIGGER mesh_parts_are_immutable BEFORE UPDATE ON mesh_parts
BEGIN
    SELECT RAISE(ABORT, 'a mesh never changes');
END;

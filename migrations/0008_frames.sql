-- Frames: streams of pictures that workers record, as objects beside the database.

-- Simulated time from frame to frame; null is none.
ALTER TABLE jobs ADD COLUMN frame_interval_s REAL CHECK (frame_interval_s > 0);

-- What the newest attempt that recorded any has recorded; 0 is the attempt of a job that was answered from the store.
CREATE TABLE frames (
    job_id      TEXT    NOT NULL PRIMARY KEY REFERENCES jobs (id),
    attempt     INTEGER NOT NULL CHECK (attempt >= 0),
    object      TEXT    NOT NULL,                              -- blake3 of the stream; the object was there first
    bytes       INTEGER NOT NULL CHECK (bytes >= 1),
    count       INTEGER NOT NULL CHECK (count >= 1),
    stopped     TEXT,                                          -- why they end before the run did
    recorded_at INTEGER NOT NULL
) STRICT, WITHOUT ROWID;

-- What a removal of an object asks: whether anybody else names it.
CREATE INDEX frames_by_object ON frames (object);

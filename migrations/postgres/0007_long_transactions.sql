-- A transaction that stays open, such as that of a backup, keeps every version of each row since its begin. Searches from the front of
-- the queue, and lookups of rows that each claim changes, would pass over more and more of them.
--
-- The session of the leader has temporary tables, whose old versions nobody else keeps: `queue_heads` has for each queue a place at or
-- before its first job that claims look at, and `running_jobs` has the running jobs. Triggers keep both up to date. Other sessions lack
-- them.

CREATE FUNCTION jobs_followed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF to_regclass('pg_temp.queue_heads') IS NOT NULL THEN
        INSERT INTO pg_temp.queue_heads AS known (priority, owner, queue, queue_position, seq)
        SELECT DISTINCT ON (priority, owner, queue) priority, owner, queue, queue_position, seq FROM new_rows
        WHERE state = 'queued' AND not_before IS NULL AND paused = 0
        ORDER BY priority, owner, queue, queue_position, seq
        ON CONFLICT (priority, owner, queue) DO UPDATE SET queue_position = excluded.queue_position, seq = excluded.seq
        WHERE (excluded.queue_position, excluded.seq) < (known.queue_position, known.seq);
        DELETE FROM pg_temp.running_jobs AS known USING new_rows WHERE known.seq = new_rows.seq AND new_rows.state <> 'running';
        INSERT INTO pg_temp.running_jobs AS known (seq, worker_id, alone)
        SELECT seq, worker_id, alone FROM new_rows WHERE state = 'running'
        ON CONFLICT (seq) DO UPDATE SET worker_id = excluded.worker_id, alone = excluded.alone
        WHERE (excluded.worker_id, excluded.alone) IS DISTINCT FROM (known.worker_id, known.alone);
    END IF;
    RETURN NULL;
END
$$;

CREATE TRIGGER jobs_follow_insert AFTER INSERT ON jobs
    REFERENCING NEW TABLE AS new_rows FOR EACH STATEMENT EXECUTE FUNCTION jobs_followed();
CREATE TRIGGER jobs_follow_update AFTER UPDATE ON jobs
    REFERENCING NEW TABLE AS new_rows FOR EACH STATEMENT EXECUTE FUNCTION jobs_followed();

-- A place in `queue_heads` may lie before the first job of its queue, or be that of an empty queue.
CREATE FUNCTION jobs_unfollowed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    IF to_regclass('pg_temp.running_jobs') IS NOT NULL THEN
        DELETE FROM pg_temp.running_jobs AS known USING old_rows WHERE known.seq = old_rows.seq;
    END IF;
    RETURN NULL;
END
$$;

CREATE TRIGGER jobs_follow_delete AFTER DELETE ON jobs
    REFERENCING OLD TABLE AS old_rows FOR EACH STATEMENT EXECUTE FUNCTION jobs_unfollowed();

-- Each claim and result adds events. The highest number is that of the newest stored event, or of a deleted one, which is noted.
DROP TRIGGER events_numbered ON events;

CREATE FUNCTION keep_number() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO row_numbers (name, seq) SELECT TG_TABLE_NAME, max(seq) FROM old_rows HAVING count(*) > 0
    ON CONFLICT (name) DO UPDATE SET seq = greatest(row_numbers.seq, excluded.seq);
    RETURN NULL;
END
$$;

CREATE TRIGGER events_deleted AFTER DELETE ON events
    REFERENCING OLD TABLE AS old_rows FOR EACH STATEMENT EXECUTE FUNCTION keep_number();

-- Every result changes the row of a project. Without the used time in an index, the new version needs no entry in any index of the table.
DROP INDEX projects_with_budget;
CREATE INDEX projects_with_budget ON projects (id) WHERE budget_core_ms IS NOT NULL;

-- The newest version of a row has the last entry of its key. A range of one key is searched from its end, an equality from its begin.
CREATE OR REPLACE FUNCTION attempts_counted() RETURNS trigger LANGUAGE plpgsql AS $$
DECLARE
    change RECORD;
BEGIN
    FOR change IN
        SELECT o.project, sum(counted.core_ms) AS core_ms
        FROM (SELECT job_id, core_ms FROM new_rows WHERE core_ms IS NOT NULL
              UNION ALL
              SELECT job_id, -core_ms FROM old_rows WHERE core_ms IS NOT NULL) AS counted
        JOIN jobs j ON j.id = counted.job_id JOIN owners o ON o.id = j.owner
        GROUP BY o.project
        HAVING sum(counted.core_ms) <> 0
        ORDER BY o.project
    LOOP
        UPDATE projects SET used_core_ms = used_core_ms + change.core_ms
        WHERE ctid = (SELECT newest.ctid FROM projects AS newest WHERE newest.id >= change.project AND newest.id <= change.project
                      ORDER BY newest.id DESC LIMIT 1);
        -- A command has just changed the row.
        IF NOT FOUND THEN
            UPDATE projects SET used_core_ms = used_core_ms + change.core_ms WHERE id = change.project;
        END IF;
    END LOOP;
    RETURN NULL;
END
$$;

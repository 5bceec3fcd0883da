-- The triggers of jobs and attempts compare the rows before and after a statement. These rows have no index, so that a join of both
-- would look at every pair of them. Sets of rows need no join.

CREATE OR REPLACE FUNCTION jobs_changed() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    INSERT INTO events (at, sweep_id, job_id, state, attempt, cancelling, paused, failure_class)
    SELECT floor(extract(epoch FROM clock_timestamp()) * 1000)::bigint, changed.sweep_id, changed.id, changed.state,
           changed.attempt, changed.cancelling, changed.paused, changed.failure_class
    FROM (SELECT seq, sweep_id, id, state, attempt, cancelling, paused, failure_class, not_before, alone FROM new_rows
          EXCEPT
          SELECT seq, sweep_id, id, state, attempt, cancelling, paused, failure_class, not_before, alone FROM old_rows) AS changed
    ORDER BY changed.seq;
    DELETE FROM checkpoints USING new_rows AS changed
    WHERE checkpoints.job_id = changed.id AND changed.ended_at IS NOT NULL;
    RETURN NULL;
END
$$;

CREATE OR REPLACE FUNCTION attempts_counted() RETURNS trigger LANGUAGE plpgsql AS $$
BEGIN
    UPDATE projects SET used_core_ms = projects.used_core_ms + change.core_ms
    FROM (
        SELECT o.project, sum(counted.core_ms) AS core_ms
        FROM (SELECT job_id, core_ms FROM new_rows WHERE core_ms IS NOT NULL
              UNION ALL
              SELECT job_id, -core_ms FROM old_rows WHERE core_ms IS NOT NULL) AS counted
        JOIN jobs j ON j.id = counted.job_id JOIN owners o ON o.id = j.owner
        GROUP BY o.project
        HAVING sum(counted.core_ms) <> 0
    ) AS change
    WHERE projects.id = change.project;
    RETURN NULL;
END
$$;

//! The statements of claims. They take and return rows of many workers at once.

/// An expression on the checkpoint that the worker of a row of `jobs` can continue from; null without one. The offset keeps PostgreSQL
/// from looking up the worker of a job without a checkpoint.
macro_rules! usable_checkpoint {
    ($of:literal) => {
        concat!(
            "(SELECT ",
            $of,
            " FROM checkpoints c WHERE c.job_id = jobs.id
             AND EXISTS (SELECT 1 FROM workers w WHERE w.id = jobs.worker_id AND w.solver_revision = c.solver_revision
                         AND w.backend = c.backend AND w.device = c.device LIMIT 1 OFFSET 0))"
        )
    };
}

/// An expression on the fill of a row of `jobs` for the device of its worker; null without one.
macro_rules! stored_fill {
    ($of:literal) => {
        concat!(
            "CASE WHEN jobs.fill_digest IS NOT NULL THEN (SELECT ",
            $of,
            " FROM workers w JOIN fills f ON f.fill_digest = jobs.fill_digest AND f.solver_revision = w.solver_revision
             AND f.backend = w.backend AND f.device = w.device
             WHERE w.id = jobs.worker_id AND f.object_digest IS NOT NULL) END"
        )
    };
}

/// The columns of a claimed job.
macro_rules! claimed_columns {
    () => {
        concat!(
            "id, attempt, max_wall_s, frame_interval_s, shared_fill, fill_digest, lease_expires_at, priority, queue_position, seq,
             (SELECT body FROM scenarios WHERE scenarios.digest = jobs.scenario_digest) AS scenario, ",
            usable_checkpoint!(
                "json_object('attempt', c.attempt, 'simulated_s', c.simulated_s, 'bytes', c.bytes, 'digest', c.object_digest,
                 'solver_revision', c.solver_revision, 'backend', c.backend, 'device', c.device)"
            ),
            " AS checkpoint, ",
            stored_fill!("json_object('bytes', f.bytes, 'digest', f.object_digest)"),
            " AS fill"
        )
    };
}

/// Starts attempts of jobs. The deadline of an attempt is `max_wall_s` after its first lease.
macro_rules! start {
    () => {
        concat!(
            "
    UPDATE jobs
    SET state = 'running', attempt = attempt + 1, worker_id = took.value ->> 'worker',
        lease_expires_at = CAST(took.value ->> 'until' AS BIGINT), started_at = CAST(took.value ->> 'at' AS BIGINT),
        deadline = CAST(took.value ->> 'until' AS BIGINT) + CAST(max_wall_s * 1000 AS BIGINT)
    FROM json_each(?) AS took WHERE jobs.seq = CAST(took.value ->> 'seq' AS BIGINT)
    RETURNING ",
            claimed_columns!(),
            ";
    INSERT INTO attempts (job_id, number, worker_id, request_id, claimed_at, resumed_from_s)
    SELECT jobs.id, jobs.attempt, jobs.worker_id, took.value ->> 'request', CAST(took.value ->> 'at' AS BIGINT), ",
            usable_checkpoint!("c.simulated_s"),
            "
    FROM json_each(?) AS took CROSS JOIN jobs ON jobs.seq = CAST(took.value ->> 'seq' AS BIGINT);"
        )
    };
}

/// Starts attempts of jobs, and advances the fair share of their owners and projects.
pub(super) const TAKE: &str = concat!(
    start!(),
    "
    INSERT INTO fair_share (priority, owner, queue_position, round, served)
    SELECT j.priority, j.owner, max(j.queue_position), max(CAST(took.value ->> 'round' AS BIGINT)),
           max(CAST(took.value ->> 'served' AS BIGINT))
    FROM json_each(?) AS took CROSS JOIN jobs j ON j.seq = CAST(took.value ->> 'seq' AS BIGINT)
    GROUP BY j.priority, j.owner
    ON CONFLICT (priority, owner) DO UPDATE SET
        queue_position = CASE WHEN excluded.queue_position > fair_share.queue_position
            THEN excluded.queue_position ELSE fair_share.queue_position END,
        round = CASE WHEN excluded.round > fair_share.round THEN excluded.round ELSE fair_share.round END,
        served = excluded.served;
    INSERT INTO project_rounds (priority, project, round, turn, served)
    SELECT CAST(took.value ->> 'priority' AS BIGINT), CAST(took.value ->> 'project' AS BIGINT), CAST(took.value ->> 'round' AS BIGINT),
           CAST(took.value ->> 'turn' AS BIGINT), CAST(took.value ->> 'served' AS BIGINT)
    FROM json_each(?) AS took WHERE true
    ON CONFLICT (priority, project) DO UPDATE SET round = excluded.round, turn = excluded.turn, served = excluded.served"
);

/// The same for PostgreSQL, which finds the newest version of a row from the end of its key (see [`leader_tables`](super::leader_tables)).
pub(super) const TAKE_IN_POSTGRES: &str = concat!(
    start!(),
    "
    WITH took AS (
        SELECT shares.*, (SELECT newest.ctid FROM fair_share newest
                          WHERE (newest.priority, newest.owner) >= (shares.priority, shares.owner)
                            AND (newest.priority, newest.owner) <= (shares.priority, shares.owner)
                          ORDER BY newest.priority DESC, newest.owner DESC LIMIT 1) AS place
        FROM (SELECT j.priority, j.owner, max(j.queue_position) AS queue_position,
                     max(CAST(job.value ->> 'round' AS BIGINT)) AS round, max(CAST(job.value ->> 'served' AS BIGINT)) AS served
              FROM json_each(?) AS job JOIN jobs j ON j.seq = CAST(job.value ->> 'seq' AS BIGINT)
              GROUP BY j.priority, j.owner) AS shares),
    changed AS (
        UPDATE fair_share SET queue_position = greatest(fair_share.queue_position, took.queue_position),
            round = greatest(fair_share.round, took.round), served = took.served
        FROM took WHERE fair_share.ctid = took.place)
    INSERT INTO fair_share (priority, owner, queue_position, round, served)
    SELECT priority, owner, queue_position, round, served FROM took WHERE place IS NULL;
    WITH took AS (
        SELECT turns.*, (SELECT newest.ctid FROM project_rounds newest
                         WHERE (newest.priority, newest.project) >= (turns.priority, turns.project)
                           AND (newest.priority, newest.project) <= (turns.priority, turns.project)
                         ORDER BY newest.priority DESC, newest.project DESC LIMIT 1) AS place
        FROM (SELECT CAST(value ->> 'priority' AS BIGINT) AS priority, CAST(value ->> 'project' AS BIGINT) AS project,
                     CAST(value ->> 'round' AS BIGINT) AS round, CAST(value ->> 'turn' AS BIGINT) AS turn,
                     CAST(value ->> 'served' AS BIGINT) AS served FROM json_each(?)) AS turns),
    changed AS (
        UPDATE project_rounds SET round = took.round, turn = took.turn, served = took.served
        FROM took WHERE project_rounds.ctid = took.place)
    INSERT INTO project_rounds (priority, project, round, turn, served)
    SELECT priority, project, round, turn, served FROM took WHERE place IS NULL"
);

/// Makes new attempts the ones that compute the fills of their jobs, where no attempt has stored or withdrawn them.
pub(super) const COMPUTE_FILLS: &str = "
    INSERT INTO fills (fill_digest, solver_revision, backend, device, job_id, attempt, used_at)
    SELECT j.fill_digest, w.solver_revision, w.backend, w.device, j.id, j.attempt, CAST(took.value ->> 'at' AS BIGINT)
    FROM json_each(?) AS took CROSS JOIN jobs j ON j.seq = CAST(took.value ->> 'seq' AS BIGINT) CROSS JOIN workers w ON w.id = j.worker_id
    WHERE CAST(took.value ->> 'computes' AS BIGINT) = 1 AND j.fill_digest IS NOT NULL
    ON CONFLICT (fill_digest, solver_revision, backend, device) DO UPDATE SET
        job_id = excluded.job_id, attempt = excluded.attempt, used_at = excluded.used_at
    WHERE fills.job_id IS NOT NULL";

/// Records the use of stored fills by new attempts.
pub(super) const USE_FILLS: &str = "
    UPDATE fills SET used_at = CASE WHEN CAST(took.value ->> 'at' AS BIGINT) > fills.used_at
        THEN CAST(took.value ->> 'at' AS BIGINT) ELSE fills.used_at END
    FROM json_each(?) AS took CROSS JOIN jobs j ON j.seq = CAST(took.value ->> 'seq' AS BIGINT) CROSS JOIN workers w ON w.id = j.worker_id
    WHERE fills.fill_digest = j.fill_digest AND fills.solver_revision = w.solver_revision
      AND fills.backend = w.backend AND fills.device = w.device AND fills.object_digest IS NOT NULL";

/// Renews the leases of attempts that a request claimed and that still run.
pub(super) const REPEAT: &str = concat!(
    "
    UPDATE jobs SET lease_expires_at = ?
    FROM attempts a
    WHERE a.request_id = ? AND a.worker_id = ? AND a.outcome IS NULL
      AND jobs.id = a.job_id AND jobs.attempt = a.number AND jobs.state = 'running'
    RETURNING ",
    claimed_columns!()
);

/// The device and load of each worker, whether it has failed jobs, whether it was not seen recently, and whether its request is a repeat. A
/// repeat is found by the id of its request alone: few attempts have the same one. The offset keeps
/// PostgreSQL from collecting the attempts of all workers instead of looking for one.
macro_rules! arrive {
    ($running:literal) => {
        concat!(
            "
    SELECT CAST(request.key AS BIGINT) AS place, me.solver_revision, me.backend, me.device, me.memory_mib, me.draining, me.slots,
        me.last_seen_at NOT BETWEEN CAST(request.value ->> 'recent' AS BIGINT) AND CAST(request.value ->> 'at' AS BIGINT) AS is_due,
        me.id IN (SELECT worker_id FROM attempts WHERE request_id = request.value ->> 'request') AS repeated,
        EXISTS (SELECT 1 FROM attempts WHERE worker_id = me.id AND outcome = 'worker' LIMIT 1 OFFSET 0) AS has_failed,
        (SELECT count(*) FROM ",
            $running,
            ") AS jobs,
        (SELECT coalesce(max(alone), 0) FROM ",
            $running,
            ") AS alone
    FROM json_each(?) AS request CROSS JOIN workers me ON me.id = request.value ->> 'worker'"
        )
    };
}

pub(super) const ARRIVE: &str = arrive!("jobs WHERE worker_id = me.id AND state = 'running'");

pub(super) const ARRIVE_IN_POSTGRES: &str = arrive!("running_jobs WHERE worker_id = me.id");

/// Records that workers were seen.
pub(super) const SEE: &str = "UPDATE workers SET last_seen_at = CAST(seen.value ->> 'at' AS BIGINT)
    FROM json_each(?) AS seen WHERE workers.id = seen.value ->> 'worker'";

/// Records how many jobs workers can run at the same time.
pub(super) const RECORD_SLOTS: &str = "UPDATE workers SET slots = CAST(found.value ->> 'slots' AS BIGINT)
    FROM json_each(?) AS found WHERE workers.id = found.value ->> 'worker'";

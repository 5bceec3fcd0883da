//! Servers of two versions on one PostgreSQL: the older one writes nothing, and says why.

use roost_api::job::JobState;
use serde_json::json;

use crate::cluster::Cluster;
use crate::postgres::END_SESSIONS;
use crate::requests::{
    accepted, assert_claimable, assert_refused, submit, wait_until_not_ready, wait_until_ready,
};
use crate::servers::pair_of_sandboxes;
use crate::support::{self, Process, Sandbox, hopper_scenario};

/// A newer server has led: it has changed a table, and noted its migration.
const UPGRADE: [&str; 2] = [
    "ALTER TABLE workers ADD COLUMN of_next_version BIGINT",
    "INSERT INTO _sqlx_migrations (version, description, success, checksum, execution_time) VALUES (9999, 'next', true, '', 0)",
];

/// Takes it back.
const DOWNGRADE: [&str; 2] =
    ["ALTER TABLE workers DROP COLUMN of_next_version", "DELETE FROM _sqlx_migrations WHERE version = 9999"];

fn postgres() -> (Cluster, String) {
    let postgres = Cluster::start(&std::env::temp_dir(), "-c fsync=off");
    let database = postgres.create("roost");
    (postgres, database)
}

fn start(sandbox: &Sandbox, database: &str) -> Process {
    sandbox.start_server_with(&["--lease-s", "30", "--database", database])
}

/// A server writes this when it does not lead any more.
fn wait_for_log(server: &Process, words: &str) {
    support::wait_until(words, || server.log().contains(words).then_some(()));
}

#[test]
fn a_leader_whose_session_ended_while_a_newer_server_led_writes_nothing() {
    let (postgres, database) = postgres();
    let sandbox = Sandbox::new();
    let server = start(&sandbox, &database);
    let job = accepted(submit(&sandbox, 1));
    // Between two transactions of this server, the newer one has led and ended.
    postgres.execute("roost", &[&UPGRADE[..], &[END_SESSIONS]].concat());
    let refused = submit(&sandbox, 2);
    assert_eq!(refused.0, 503, "{refused:?}");
    let reason = "the database was made by a newer roost (schema 9999";
    wait_for_log(&server, reason);
    wait_until_not_ready(&sandbox, reason);
    assert_refused(submit(&sandbox, 3), 503, reason);
    let rows = postgres.execute("roost", &["SELECT count(*) FROM jobs"]);
    assert_eq!(rows, "1", "it has written nothing more");

    postgres.execute("roost", &DOWNGRADE);
    wait_until_ready(&sandbox);
    assert_claimable(&sandbox, &[job, accepted(submit(&sandbox, 4))]);
}

#[test]
fn a_server_with_an_older_solver_does_not_lead() {
    let (postgres, database) = postgres();
    let [one, two] = pair_of_sandboxes(Sandbox::new);
    let (first, second) = (start(&one, &database), start(&two, &database));
    wait_for_log(&second, "requests are passed on");
    let job = accepted(submit(&two, 1));
    let noted = postgres.execute("roost", &["SELECT revision FROM newest_solver"]);
    assert_eq!(noted, roost_solver::SOLVER_REVISION.to_string(), "the leader has noted its solver");
    // A server with a newer solver has led.
    postgres.execute("roost", &["UPDATE newest_solver SET revision = revision + 1", END_SESSIONS]);
    let reason = format!("a server with solver revision {} has led", roost_solver::SOLVER_REVISION + 1);
    for (server, sandbox) in [(&first, &one), (&second, &two)] {
        wait_for_log(server, &reason);
        wait_until_not_ready(sandbox, &reason);
        assert_refused(submit(sandbox, 2), 503, &reason);
    }
    // One that starts now ends, with the reason.
    first.terminate();
    assert!(first.wait().0.success());
    let late = one.spawn_server(&["--database", &database]);
    wait_for_log(&late, &reason);
    assert!(!late.wait().0.success());

    postgres.execute("roost", &["UPDATE newest_solver SET revision = revision - 1"]);
    wait_until_ready(&two);
    assert_claimable(&two, &[job]);
}

#[test]
fn an_upgrade_under_running_jobs_loses_none() {
    let (postgres, database) = postgres();
    let [one, two] = pair_of_sandboxes(Sandbox::new);
    let (first, second) = (start(&one, &database), start(&two, &database));
    wait_for_log(&second, "requests are passed on");
    let _workers = [one.start_worker("one"), two.start_worker("two")];
    let jobs: Vec<_> = (0..8)
        .map(|seed| {
            let mut scenario = hopper_scenario(1.0);
            scenario["seed"] = json!(seed);
            if seed % 2 == 0 { one.submit(&scenario) } else { two.submit(&scenario) }
        })
        .collect();
    two.wait_for_job(&jobs[0], "a job is under way or has ended", |job| job.state != JobState::Queued);

    // The leader stops in good order, and the newer server has upgraded the database before the older standby could lead.
    postgres.execute("roost", &UPGRADE);
    first.terminate();
    assert!(first.wait().0.success());
    let reason = "the database was made by a newer roost (schema 9999";
    wait_for_log(&second, reason);
    wait_until_not_ready(&two, reason);
    let late = one.spawn_server(&["--database", &database]);
    wait_for_log(&late, reason);
    assert!(!late.wait().0.success(), "an older server ends");

    // The newer server, which knows this schema, takes over from the newer one that upgraded it.
    postgres.execute("roost", &DOWNGRADE);
    let _first = start(&one, &database);
    for job in &jobs {
        let ended = two.wait_for_job(job, "the job has ended", |job| job.state.is_ended());
        assert_eq!(ended.state, JobState::Succeeded, "{ended:?}");
    }
    assert_eq!(one.results_recorded(), jobs.len() as u64, "one result for each job");
}

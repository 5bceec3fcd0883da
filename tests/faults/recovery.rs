//! PostgreSQL recovered to a time before a mistake, as the page on operation describes.

use std::time::Duration;

use roost_api::job::{JobState, JobView};
use roost_api::time::Timestamp;

use crate::cluster::Cluster;
use crate::support::{Sandbox, hopper_scenario, stdout, wait_until};

/// No machine loses its power here.
const FAST: &str = "-c fsync=off";

/// A PostgreSQL that archives its log of changes in its own folder.
fn archiving() -> Cluster {
    let postgres = Cluster::start(&std::env::temp_dir(), FAST);
    let archive = postgres.folder().display().to_string();
    let copy = format!("test ! -f {archive}/wal-%f && cp %p {archive}/wal-%f");
    for setting in ["archive_mode = on", &format!("archive_command = '{copy}'")] {
        sql(&postgres, &format!("ALTER SYSTEM SET {setting}"));
    }
    // Archiving begins with the next start.
    postgres.kill();
    postgres
}

fn sql(postgres: &Cluster, statement: &str) {
    assert!(succeeds(postgres, statement), "{statement}");
}

fn succeeds(postgres: &Cluster, statement: &str) -> bool {
    postgres.run("psql", &["-U", "roost", "-d", "postgres", "-c", statement]).unwrap()
}

/// Waits until a condition of SQL holds.
fn wait_for(postgres: &Cluster, what: &str, condition: &str) {
    // A division by zero fails.
    let statement = format!("SELECT 1 / ({condition})::int");
    wait_until(what, || succeeds(postgres, &statement).then_some(()));
}

/// A job with its result, and a job that waits.
pub(crate) struct Jobs {
    pub(crate) done: JobView,
    pub(crate) result: String,
    pub(crate) waiting: JobView,
}

impl Jobs {
    pub(crate) fn of(sandbox: &Sandbox) -> Self {
        let worker = sandbox.start_worker("worker");
        let done = sandbox.submit(&hopper_scenario(0.6));
        sandbox.wait_for_job(&done, "it ends", |job| job.state == JobState::Succeeded);
        let result = stdout(&sandbox.roost(&["results", &done.id.to_string()]));
        worker.terminate();
        assert!(worker.wait().0.success());
        Self { done, result, waiting: sandbox.submit(&hopper_scenario(0.5)) }
    }
}

/// Cancels the waiting job and deletes the result of the other one.
pub(crate) fn lose(sandbox: &Sandbox, done: &JobView, waiting: &JobView) {
    stdout(&sandbox.roost(&["cancel", &waiting.id.to_string()]));
    stdout(&sandbox.roost(&["prune", "--older-than", "0h", "--yes"]));
    assert!(sandbox.job(done).is_none(), "the mistake");
}

#[test]
fn a_server_on_a_recovered_postgresql_has_the_jobs_of_that_time() {
    let postgres = archiving();
    let database = postgres.create("roost");
    let sandbox = Sandbox::new();
    let server = sandbox.start_server_with(&["--database", &database]);
    let base = sandbox.path("base");
    let folder = base.display().to_string();
    let backup = ["-U", "roost", "-D", &folder, "--format=tar", "--wal-method=none", "--checkpoint=fast"];
    assert!(postgres.run("pg_basebackup", &backup).unwrap());

    let Jobs { done, result, waiting } = Jobs::of(&sandbox);
    std::thread::sleep(Duration::from_millis(100));
    let before = Timestamp::now().to_string().replace('Z', "+00");
    std::thread::sleep(Duration::from_millis(100));
    lose(&sandbox, &done, &waiting);
    server.terminate();
    assert!(server.wait().0.success());
    sql(&postgres, "CREATE TABLE switched AS SELECT pg_walfile_name(pg_switch_wal()) AS name");
    let archived = "(SELECT last_archived_wal >= name FROM pg_stat_archiver, switched)";
    wait_for(&postgres, "the log is archived", archived);

    let archive = postgres.folder().display();
    let settings = format!(
        "fsync = off\narchive_mode = off\nrestore_command = 'cp {archive}/wal-%f %p'\nrecovery_target_time = '{before}'\n\
         recovery_target_action = promote"
    );
    let recovered = Cluster::recover(&base.join("base.tar"), &std::env::temp_dir(), &settings);
    wait_for(&recovered, "the recovery has ended", "NOT pg_is_in_recovery()");
    let database = recovered.address("roost");
    let _server = sandbox.start_server_with(&["--database", &database]);
    assert_eq!(stdout(&sandbox.roost(&["results", &done.id.to_string()])), result);
    let _worker = sandbox.start_worker("worker");
    sandbox.wait_for_job(&waiting, "it ends", |job| job.state == JobState::Succeeded);
    assert_eq!(sandbox.results_recorded(), 2);
}

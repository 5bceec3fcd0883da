//! A dump of PostgreSQL, made while a server runs and restored after a mistake, as the page on operation describes.

use roost_api::job::JobState;

use crate::cluster::Cluster;
use crate::recovery::{Jobs, lose};
use crate::support::{Sandbox, hopper_scenario, stdout};

#[test]
fn a_dump_restores_the_jobs_of_its_time() {
    // No machine loses its power here.
    let postgres = Cluster::start(&std::env::temp_dir(), "-c fsync=off");
    let database = postgres.create("roost");
    let sandbox = Sandbox::new();
    let start = || sandbox.start_server_with(&["--database", &database]);
    let server = start();
    let Jobs { done, result, waiting } = Jobs::of(&sandbox);
    let file = sandbox.path("roost.dump").display().to_string();
    let dump = ["-U", "roost", "--format=custom", "--file", &file, "--dbname=roost"];
    assert!(postgres.run("pg_dump", &dump).unwrap());

    lose(&sandbox, &done, &waiting);
    let late = sandbox.submit(&hopper_scenario(0.4));
    server.terminate();
    assert!(server.wait().0.success());
    // A newer version may have more tables than the dump.
    assert!(postgres.run("psql", &["-U", "roost", "-d", "roost", "-c", "CREATE TABLE newer ()"]).unwrap());
    let restore =
        ["-U", "roost", "--clean", "--create", "--if-exists", "--exit-on-error", "--dbname=postgres", &file];
    assert!(postgres.run("pg_restore", &restore).unwrap());
    assert!(
        !postgres.run("psql", &["-U", "roost", "-d", "roost", "-c", "TABLE newer"]).unwrap(),
        "it is gone"
    );

    let _server = start();
    assert_eq!(stdout(&sandbox.roost(&["results", &done.id.to_string()])), result);
    assert!(sandbox.job(&late).is_none());
    let _worker = sandbox.start_worker("worker");
    sandbox.wait_for_job(&waiting, "it ends", |job| job.state == JobState::Succeeded);
    assert_eq!(sandbox.results_recorded(), 2);
}

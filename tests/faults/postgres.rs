//! A PostgreSQL that is away, slow, read-only or full: each request gets one sentence, `/readyz` has the reason, and no job is lost.

use std::path::Path;
use std::thread;
use std::time::{Duration, Instant};

use roost_api::job::{MAX_LABELS, MAX_NAME_BYTES};
use serde_json::json;

use crate::cluster::Cluster;
use crate::requests::{
    accepted, assert_claimable, assert_refused, get, post, submit, wait_until_not_ready, wait_until_ready,
};
use crate::support::small_disk::SmallDisk;
use crate::support::{Process, Sandbox, hopper_scenario, wait_until};

/// No machine loses its power here.
const FAST: &str = "-c fsync=off";

/// Ends the sessions of all servers.
pub(crate) const END_SESSIONS: &str =
    "SELECT count(pg_terminate_backend(pid)) FROM pg_stat_activity WHERE application_name LIKE 'roost%'";

/// A server of a PostgreSQL, and a job that waits.
struct Place {
    server: Process,
    sandbox: Sandbox,
    postgres: Cluster,
    job: String,
}

impl Place {
    fn new() -> Self {
        Self::on(&std::env::temp_dir(), FAST)
    }

    fn on(folder: &Path, settings: &str) -> Self {
        let postgres = Cluster::start(folder, settings);
        let database = postgres.create("roost");
        let sandbox = Sandbox::new();
        let server = sandbox.start_server_with(&["--database", &database]);
        let job = accepted(submit(&sandbox, 1));
        Self { server, sandbox, postgres, job }
    }

    /// The server is ready again, and has these jobs beside the first one.
    fn assert_nothing_is_lost(&self, mut jobs: Vec<String>) {
        wait_until_ready(&self.sandbox);
        jobs.extend([self.job.clone(), accepted(submit(&self.sandbox, 2))]);
        assert_claimable(&self.sandbox, &jobs);
        assert!(!self.server.log().contains("panicked"), "{}", self.server.log());
    }
}

#[test]
fn a_postgresql_that_is_away_loses_nothing() {
    let place = Place::new();
    place.postgres.stop();
    let reason = "the server cannot reach PostgreSQL: try again later";
    let began = Instant::now();
    for seed in 10..13 {
        assert_refused(submit(&place.sandbox, seed), 503, reason);
    }
    assert!(began.elapsed() < Duration::from_secs(5), "nobody waits: {:?}", began.elapsed());
    wait_until_not_ready(&place.sandbox, "PostgreSQL");
    place.postgres.start_again();
    place.assert_nothing_is_lost(Vec::new());
}

#[test]
fn a_slow_postgresql_is_reported_and_loses_nothing() {
    let place = Place::new();
    place.postgres.signal_all("-STOP");
    let began = Instant::now();
    let late = thread::scope(|scope| {
        let address = &place.sandbox.address;
        let late = scope.spawn(move || {
            let document = json!({"scenario": hopper_scenario(0.4)}).to_string();
            let arguments = ["-sS", "--json", &document, &format!("{address}/v1/jobs")];
            std::process::Command::new("curl").args(arguments).output().unwrap().stdout
        });
        assert_refused(get(&place.sandbox, "/readyz"), 503, "the database took too long");
        // A probe waits 5 s, on a machine that is not as busy as this one may be.
        assert!(began.elapsed() < Duration::from_secs(10), "{:?}", began.elapsed());
        place.postgres.signal_all("-CONT");
        late.join().unwrap()
    });
    // A short pause only delays a write.
    let late: serde_json::Value = serde_json::from_slice(&late).unwrap();
    place.assert_nothing_is_lost(vec![accepted((202, late))]);
}

#[test]
fn a_postgresql_whose_writer_is_blocked_is_reported_and_loses_nothing() {
    let place = Place::new();
    // Another program holds the lock of writers for longer than the server waits for it.
    let hold = "SELECT pg_advisory_xact_lock(8246779703540740723), pg_sleep(60)";
    let is_held =
        "SELECT count(*) FROM pg_stat_activity WHERE query LIKE '%pg_sleep(60)' AND wait_event = 'PgSleep'";
    let release = "SELECT pg_cancel_backend(pid) FROM pg_stat_activity WHERE query LIKE '%pg_sleep(60)' AND wait_event = 'PgSleep'";
    thread::scope(|scope| {
        scope.spawn(|| place.postgres.try_execute("roost", &[hold]));
        wait_until("the lock is held", || (place.postgres.execute("roost", &[is_held]) == "1").then_some(()));
        assert_refused(submit(&place.sandbox, 10), 503, "the database took too long");
        place.postgres.execute("roost", &[release]);
    });
    place.assert_nothing_is_lost(Vec::new());
}

#[test]
fn a_read_only_postgresql_refuses_writes_with_its_reason_and_loses_nothing() {
    let place = Place::new();
    let set = |mode: &str| {
        let statement = format!("ALTER SYSTEM SET default_transaction_read_only = {mode}");
        let writes = "SET default_transaction_read_only = off";
        place.postgres.execute("roost", &[writes, &statement, "SELECT pg_reload_conf()"]);
    };
    set("on");
    wait_until_not_ready(&place.sandbox, "PostgreSQL accepts no writes now");
    assert_refused(submit(&place.sandbox, 10), 503, "PostgreSQL accepts no writes now");
    // New sessions find a PostgreSQL like a standby.
    place.postgres.execute("roost", &[END_SESSIONS]);
    wait_until_not_ready(&place.sandbox, "PostgreSQL accepts no writes now");
    for seed in 11..16 {
        assert_refused(submit(&place.sandbox, seed), 503, "PostgreSQL accepts no writes now");
    }
    assert_eq!(get(&place.sandbox, &format!("/v1/jobs/{}", place.job)).0, 200, "reads succeed");
    set("off");
    place.assert_nothing_is_lost(Vec::new());
}

#[test]
fn a_full_disk_of_postgresql_is_reported_and_loses_nothing() {
    let folder = tempfile::tempdir().unwrap();
    // PostgreSQL runs as another user than root.
    let open = std::os::unix::fs::PermissionsExt::from_mode(0o755);
    std::fs::set_permissions(folder.path(), open).unwrap();
    let Some(disk) = SmallDisk::mount(&folder.path().join("disk"), 160) else {
        eprintln!("left out: only root may mount the small disk that this fills");
        return;
    };
    let place =
        Place::on(&folder.path().join("disk"), "-c fsync=off -c max_wal_size=48MB -c min_wal_size=32MB");
    disk.fill();
    let labels: std::collections::BTreeMap<_, _> =
        (0..MAX_LABELS).map(|number| (format!("note {number}"), "x".repeat(MAX_NAME_BYTES))).collect();
    let (mut confirmed, mut seed) = (Vec::new(), 100);
    let refusal = loop {
        let mut scenario = hopper_scenario(0.2);
        scenario["seed"] = json!(seed);
        let answer = post(&place.sandbox, &json!({"scenario": scenario, "labels": labels}));
        if answer.0 != 202 {
            break answer;
        }
        confirmed.push(accepted(answer));
        seed += 1;
        assert!(seed < 1000, "the disk is full");
    };
    assert_refused(refusal, 507, "the disk of PostgreSQL is full: nothing changed");
    wait_until_not_ready(&place.sandbox, "the disk of PostgreSQL is full");
    disk.clear();
    assert!(confirmed.len() < 60, "one claim takes all of them: {}", confirmed.len());
    place.assert_nothing_is_lost(confirmed);
}

//! Wall clocks that are set forward and back by an hour, during jobs and across a restart.

use std::time::Duration;

use roost_api::job::{JobState, JobView};
use serde_json::json;

use crate::support::{Sandbox, fraction, skip, slow_scenario, transcript, wait_until};

const HOUR_S: i64 = 3600;

/// Submits a job of a few seconds with its own seed.
fn submit(sandbox: &Sandbox, seed: u64) -> JobView {
    let mut scenario = slow_scenario(10.0);
    scenario["seed"] = json!(seed);
    sandbox.submit(&scenario)
}

fn runs(sandbox: &Sandbox, job: &JobView) {
    sandbox.wait_for_job(job, "the job runs", |job| fraction(job) > 0.0);
}

#[test]
fn changed_clock_expires_no_lease_and_repeats_no_run() {
    let Some(sandbox) = Sandbox::with_clocks() else {
        skip("libfaketime is not installed (Debian package faketime)");
        return;
    };
    let server = sandbox.start_server_with_short_leases();
    let _worker = sandbox.start_worker("worker");
    let mut hours = Vec::new();
    for (seed, offset_s) in [(1, HOUR_S), (2, -HOUR_S)] {
        let job = submit(&sandbox, seed);
        runs(&sandbox, &job);
        sandbox.set_clock("serve", offset_s);
        sandbox.set_clock("worker", -offset_s);
        // Longer than a lease, so that a lease that depended on the clock would have expired.
        std::thread::sleep(Duration::from_millis(2500));
        let job = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1), "{job:?}");
        hours.push((job.ended_at.unwrap().0 - job.started_at.unwrap().0) as f64 / 3.6e6);
    }
    // The change is visible: the first attempt seems to have taken one hour, the second one minus two.
    assert!((hours[0] - 1.0).abs() < 0.1 && (hours[1] + 2.0).abs() < 0.1, "{hours:?}");

    // After a restart, leases count from the current time of the clock, which may be wrong.
    let mut server = server;
    for (seed, offset_s) in [(3, HOUR_S), (4, -HOUR_S)] {
        let job = submit(&sandbox, seed);
        runs(&sandbox, &job);
        server.kill();
        sandbox.set_clock("serve", offset_s);
        server = sandbox.start_server_with_short_leases();
        let job = sandbox.wait_for_job(&job, "the job has ended", |job| job.state.is_ended());
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1), "{job:?}");
    }
    assert_eq!(sandbox.results_recorded(), 4);
}

#[test]
fn clock_that_jumps_ahead_deletes_nothing() {
    const YEAR_S: i64 = 365 * 24 * HOUR_S;
    let Some(sandbox) = Sandbox::with_clocks() else {
        skip("libfaketime is not installed (Debian package faketime)");
        return;
    };
    let server = sandbox.start_server();
    let job = submit(&sandbox, 1);
    sandbox.roost(&["cancel", &job.id.to_string()]);
    sandbox.wait_for_job(&job, "the job is cancelled", |job| job.state == JobState::Cancelled);
    sandbox.set_clock("serve", YEAR_S);
    let prune = || sandbox.roost(&["prune", "--older-than", "30d", "--yes"]);
    let refused = prune();
    assert_eq!(refused.status.code(), Some(1), "{}", transcript(&refused));
    assert!(
        transcript(&refused).contains("clock") && transcript(&refused).contains("nothing was deleted"),
        "{}",
        transcript(&refused)
    );
    assert!(sandbox.job(&job).is_some());
    sandbox.set_clock("serve", 0);
    assert!(prune().status.success(), "the clock is right again");

    // Automatic pruning of a server that starts with a wrong clock.
    server.terminate();
    server.wait();
    sandbox.set_clock("serve", YEAR_S);
    let server = sandbox.start_server_with(&["--prune-after", "30d"]);
    wait_until("it says why", || server.log().contains("automatic deletion is paused").then_some(()));
    assert!(sandbox.job(&job).is_some());
    server.terminate();
    server.wait();
    // With a trusted clock it would be deleted.
    sandbox.set_clock("serve", 0);
    let _server = sandbox.start_server_with(&["--prune-after", "0h"]);
    wait_until("the job is gone", || {
        sandbox.status(&format!("/v1/jobs/{}", job.id)).filter(|status| *status == 404)
    });
}

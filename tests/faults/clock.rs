//! A wall clock that is set by an hour, forth and back, while jobs run and across a restart.

use std::time::Duration;

use roost_api::job::{JobState, JobView};
use serde_json::json;

use crate::support::{Home, fraction, left_out, long, said, until};

const HOUR_S: i64 = 3600;

/// A job that takes a few seconds, each with a result of its own.
fn submit(home: &Home, seed: u64) -> JobView {
    let mut scenario = long(10.0);
    scenario["seed"] = json!(seed);
    home.submit(&scenario)
}

fn runs(home: &Home, job: &JobView) {
    home.job_when(job, "the job runs", |job| fraction(job) > 0.0);
}

#[test]
fn a_clock_that_is_set_ends_no_lease_and_repeats_no_run() {
    let Some(home) = Home::with_clocks() else {
        left_out("libfaketime is not installed (Debian package faketime)");
        return;
    };
    let server = home.serve();
    let _worker = home.work("worker");
    let mut hours = Vec::new();
    for (seed, offset_s) in [(1, HOUR_S), (2, -HOUR_S)] {
        let job = submit(&home, seed);
        runs(&home, &job);
        home.set_clock("serve", offset_s);
        home.set_clock("worker", -offset_s);
        // Longer than a lease, so that one that hangs on the clock has ended.
        std::thread::sleep(Duration::from_millis(2500));
        let job = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1), "{job:?}");
        hours.push((job.ended_at.unwrap().0 - job.started_at.unwrap().0) as f64 / 3.6e6);
    }
    // It has been set: the first run seems to have taken an hour, the second one minus two.
    assert!((hours[0] - 1.0).abs() < 0.1 && (hours[1] + 2.0).abs() < 0.1, "{hours:?}");

    // Leases count anew from what the clock shows when the server starts. It may be far off by then.
    let mut server = server;
    for (seed, offset_s) in [(3, HOUR_S), (4, -HOUR_S)] {
        let job = submit(&home, seed);
        runs(&home, &job);
        server.kill();
        home.set_clock("serve", offset_s);
        server = home.serve();
        let job = home.job_when(&job, "the job has ended", |job| job.state.is_ended());
        assert_eq!((job.state, job.attempt), (JobState::Succeeded, 1), "{job:?}");
    }
    assert_eq!(home.results_recorded(), 4);
}

#[test]
fn a_clock_that_jumps_ahead_has_nothing_deleted() {
    const YEAR_S: i64 = 365 * 24 * HOUR_S;
    let Some(home) = Home::with_clocks() else {
        left_out("libfaketime is not installed (Debian package faketime)");
        return;
    };
    let server = home.serve();
    let job = submit(&home, 1);
    home.roost(&["cancel", &job.id.to_string()]);
    home.job_when(&job, "the job is cancelled", |job| job.state == JobState::Cancelled);
    home.set_clock("serve", YEAR_S);
    let prune = || home.roost(&["prune", "--older-than", "30d", "--yes"]);
    let refused = prune();
    assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
    assert!(
        said(&refused).contains("clock") && said(&refused).contains("nothing was deleted"),
        "{}",
        said(&refused)
    );
    assert!(home.job(&job).is_some());
    home.set_clock("serve", 0);
    assert!(prune().status.success(), "the clock is right again");

    // By itself: a server that starts with a wrong clock.
    server.terminate();
    server.wait();
    home.set_clock("serve", YEAR_S);
    let server = home.serve_with(&["--prune-after", "30d"]);
    until("it says why", || server.log().contains("automatic deletion is paused").then_some(()));
    assert!(home.job(&job).is_some());
    server.terminate();
    server.wait();
    // With a clock that can be trusted it would go.
    home.set_clock("serve", 0);
    let _server = home.serve_with(&["--prune-after", "0h"]);
    until("the job is gone", || home.status(&format!("/v1/jobs/{}", job.id)).filter(|status| *status == 404));
}

//! A full disk under the server: writes are refused with a reason, confirmed data stays, and work continues once there is space.

use std::collections::BTreeMap;

use roost_api::job::{JobState, JobView, MAX_LABELS, MAX_NAME_BYTES};
use serde_json::{Value, json};

use crate::support::small_disk::SmallDisk;
use crate::support::{Sandbox, hopper_scenario, outbox_len, slow_scenario, wait_until};

#[test]
fn full_disk_loses_nothing_and_is_reported() {
    let sandbox = Sandbox::new();
    let Some(disk) = SmallDisk::mount(&sandbox.path("data"), 12) else {
        eprintln!("left out: only root may mount the small disk that this fills");
        return;
    };
    let server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let (running, waiting) = (sandbox.submit(&slow_scenario(12.0)), sandbox.submit(&hopper_scenario(0.3)));
    sandbox.wait_for_job(&running, "the job runs", |job| job.state == JobState::Running);
    disk.fill();

    // Reads succeed. Writes are refused once the existing files have no free space.
    let submit = |seed: u32| {
        let mut scenario = hopper_scenario(0.2);
        scenario["seed"] = json!(seed);
        // The maximum number of labels with the maximum length.
        let labels: BTreeMap<_, _> =
            (0..MAX_LABELS).map(|number| (format!("note {number}"), "x".repeat(MAX_NAME_BYTES))).collect();
        let envelope = json!({"scenario": scenario, "labels": labels});
        sandbox.ask(|client| async move { client.submit_document::<Value>("jobs", &envelope).await })
    };
    let mut confirmed = Vec::new();
    let refusal = (1..1000).find_map(|seed| match submit(seed) {
        Ok(job) => {
            confirmed.push(job["id"].as_str().unwrap().to_owned());
            None
        }
        Err(error) => Some(error),
    });
    let refusal = refusal.expect("the disk is full");
    assert_eq!(refusal.problem_status(), Some(507), "{refusal}");
    assert!(refusal.to_string().contains("disk"), "{refusal}");
    assert!(sandbox.job(&running).is_some());
    wait_until("it says that it is not ready", || (sandbox.status("/readyz") == Some(503)).then_some(()));
    wait_until("the result waits in the outbox", || (outbox_len(&sandbox.path("worker")) > 0).then_some(()));

    // The server is killed with a full disk and restarted.
    server.kill();
    let full = sandbox.spawn_server(&["--lease-s", "2"]);
    let log = wait_until("it says why it does not start, or it answers", || {
        let answers = sandbox.job(&running).is_some();
        (answers || full.log().contains("full")).then(|| full.log())
    });
    assert!(!log.contains("panicked"), "{log}");
    drop(full);
    disk.clear();
    let _server = sandbox.start_server();
    assert_eq!(sandbox.status("/readyz"), Some(200));

    for job in [&running, &waiting] {
        let ended = sandbox.wait_for_job(job, "the job has ended", |job| job.state.is_ended());
        assert_eq!(ended.state, JobState::Succeeded, "{ended:?}");
    }
    // The run was not repeated, since its result was in the outbox.
    assert_eq!(sandbox.job(&running).unwrap().attempt, 1);
    for id in &confirmed {
        let id = id.parse().unwrap();
        wait_until("confirmed jobs have ended", || {
            let job = sandbox.ask(|client| async move { client.job(id).await.ok() });
            job.filter(|job| job.state == JobState::Succeeded)
        });
    }
    let after = submit(5000).expect("there is room again");
    assert_eq!(after["state"], "queued");
    sandbox.wait_for_job(&serde_json::from_value(after).unwrap(), "it runs", |job| {
        job.state == JobState::Succeeded
    });
    assert_eq!(sandbox.results_recorded(), 3 + confirmed.len() as u64);
}

#[test]
fn a_full_disk_keeps_the_last_checkpoint() {
    let sandbox = Sandbox::new();
    let Some(disk) = SmallDisk::mount(&sandbox.path("data"), 24) else {
        eprintln!("left out: only root may mount the small disk that this fills");
        return;
    };
    let _server = sandbox.start_server_with(&["--checkpoint-interval", "1s"]);
    let worker = sandbox.start_worker("worker");
    let job = sandbox.submit(&slow_scenario(600.0));
    sandbox.wait_for_job(&job, "a checkpoint", |job| job.checkpoint.is_some());
    disk.fill();
    wait_until("an upload is refused", || worker.log().contains("checkpoint was not uploaded").then_some(()));
    // One more may come: the space of a replaced checkpoint is free once it is deleted.
    let stored = wait_until("the last one stays", || {
        let stored = sandbox.job(&job).unwrap().checkpoint.expect("the last one stays");
        let attempt = stored.attempt;
        let bytes = sandbox.ask(|client| async move { client.download_checkpoint(job.id, attempt).await });
        (roost_solver::mesh::digest(&bytes.ok()?) == stored.digest).then_some(stored)
    });
    disk.clear();
    let is_later =
        |job: &JobView| job.checkpoint.as_ref().is_some_and(|it| it.simulated_s > stored.simulated_s);
    sandbox.wait_for_job(&job, "a later checkpoint", is_later);
}

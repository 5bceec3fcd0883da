//! A full disk under the server: what cannot be written is refused in words, what was confirmed stays, and when there is room again
//! everything goes on.

use std::collections::BTreeMap;

use roost_api::job::{JobState, MAX_LABELS, MAX_NAME_BYTES};
use serde_json::{Value, json};

use crate::support::small_disk::SmallDisk;
use crate::support::{Home, long, outbox, scenario, until};

#[test]
fn a_full_disk_loses_nothing_and_is_told() {
    let home = Home::new();
    let Some(disk) = SmallDisk::mount(&home.path("data"), 12) else {
        eprintln!("left out: only root may mount the small disk that this fills");
        return;
    };
    let server = home.serve();
    let _worker = home.work("worker");
    let (running, waiting) = (home.submit(&long(6.0)), home.submit(&scenario(0.3)));
    home.job_when(&running, "the job runs", |job| job.state == JobState::Running);
    disk.fill();

    // What is there can be read; what is new is refused, as soon as there is no place left in files that are there already.
    let submit = |seed: u32| {
        let mut scenario = scenario(0.2);
        scenario["seed"] = json!(seed);
        // As many as there may be, and as long.
        let labels: BTreeMap<_, _> =
            (0..MAX_LABELS).map(|number| (format!("note {number}"), "x".repeat(MAX_NAME_BYTES))).collect();
        let envelope = json!({"scenario": scenario, "labels": labels});
        home.ask(|client| async move { client.submit_document::<Value>("jobs", &envelope).await })
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
    assert!(home.job(&running).is_some());
    until("it says that it is not ready", || (home.status("/readyz") == Some(503)).then_some(()));
    until("the result waits in the outbox", || (outbox(&home.path("worker")) > 0).then_some(()));

    // Killed in that state, and started again.
    server.kill();
    let full = home.start_server(&["--lease-s", "2"]);
    let log = until("it says why it does not start, or it answers", || {
        let answers = home.job(&running).is_some();
        (answers || full.log().contains("full")).then(|| full.log())
    });
    assert!(!log.contains("panicked"), "{log}");
    drop(full);
    disk.clear();
    let _server = home.serve();
    assert_eq!(home.status("/readyz"), Some(200));

    for job in [&running, &waiting] {
        let ended = home.job_when(job, "the job has ended", |job| job.state.is_ended());
        assert_eq!(ended.state, JobState::Succeeded, "{ended:?}");
    }
    // The run was not repeated: its result had waited in the outbox.
    assert_eq!(home.job(&running).unwrap().attempt, 1);
    for id in &confirmed {
        let id = id.parse().unwrap();
        until("what was confirmed has ended", || {
            let job = home.ask(|client| async move { client.job(id).await.ok() });
            job.filter(|job| job.state == JobState::Succeeded)
        });
    }
    let after = submit(5000).expect("there is room again");
    assert_eq!(after["state"], "queued");
    home.job_when(&serde_json::from_value(after).unwrap(), "it runs", |job| job.state == JobState::Succeeded);
    assert_eq!(home.results_recorded(), 3 + confirmed.len() as u64);
}

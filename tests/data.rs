//! What is done where the data is: tokens, backup and restore, with a server that runs beside it.

mod support;

use roost_api::job::JobState;
use serde_json::{Value, json};

use support::{Home, roost, run, said, scenario, stdout};

#[test]
fn a_backup_of_a_server_at_work_is_one_moment_and_comes_back_whole() {
    let home = Home::new();
    let server = home.serve();
    let worker = home.work("worker");
    let done = home.submit(&scenario(0.2));
    home.job_when(&done, "the job has ended", |job| job.state == JobState::Succeeded);
    let running = home.submit(&support::long(600.0));
    home.job_when(&running, "the job is under way", |job| job.state == JobState::Running);

    let (data, copy) = (home.path("data").display().to_string(), home.path("copy").display().to_string());
    let told: Value =
        serde_json::from_str(&stdout(&run(&["backup", &copy, "--data", &data, "--json"]))).unwrap();
    assert_eq!((&told["jobs"], &told["results"]), (&json!(2), &json!(1)));
    let files: Vec<_> = std::fs::read_dir(&copy).unwrap().map(|file| file.unwrap().file_name()).collect();
    assert_eq!(files, ["roost.db"], "one file and no log");
    let again = run(&["backup", &copy, "--data", &data]);
    assert!(!again.status.success() && said(&again).contains("already"), "{}", said(&again));
    let later = home.submit(&scenario(0.1));
    drop((server, worker));

    // Back in another folder, with another server.
    let refused = run(&["restore", &copy, "--data", &data]);
    assert!(!refused.status.success() && said(&refused).contains("already"), "{}", said(&refused));
    std::fs::rename(home.path("data"), home.path("lost")).unwrap();
    stdout(&run(&["restore", &copy, "--data", &data]));
    let _server = home.serve();
    assert_eq!(home.job(&done).unwrap().responses, home.job_when(&done, "the job", |_| true).responses);
    assert_eq!(home.job(&done).unwrap().state, JobState::Succeeded);
    assert!(home.job(&later).is_none(), "it came after that moment");
    let back = home.job_when(&running, "its lease has ended", |job| job.state == JobState::Queued);
    assert_eq!(back.attempt, 1);
    let nothing = run(&["backup", &copy, "--data", &home.path("nowhere").display().to_string()]);
    assert!(said(&nothing).contains("there is no roost.db"), "{}", said(&nothing));
}

#[test]
fn a_token_opens_the_server_to_its_bearer_alone() {
    let home = Home::new();
    let data = home.path("data").display().to_string();
    let make = |scope: &str| {
        let made = run(&["token", "create", "--scope", scope, "--name", "me", "--data", &data]);
        stdout(&made).trim().to_owned()
    };
    let (admin, worker, read) = (make("admin"), make("worker"), make("read"));
    let server = home.start_server(&["--lease-s", "2"]);
    support::until("the server answers", || {
        let asked = home.roost(&["list"]);
        (said(&asked).contains("authorization")).then_some(())
    });
    let with = |token: &str, arguments: &[&str]| {
        roost().args(arguments).env("ROOST_SERVER", &home.address).env("ROOST_TOKEN", token).output().unwrap()
    };
    let file = home.file("scenario.json", &scenario(0.1));
    let refused = with(&read, &["submit", &file]);
    assert!(said(&refused).contains("scope submit"), "{}", said(&refused));
    stdout(&with(&admin, &["submit", &file]));

    std::fs::write(home.path("worker.token"), format!("{worker}\n")).unwrap();
    let token_file = home.path("worker.token").display().to_string();
    let worker = home.work_with("worker", &["--token-file", &token_file]);
    support::until("the job has ended", || {
        let listed = stdout(&with(&read, &["list", "--jobs"]));
        listed.contains("succeeded").then_some(())
    });
    let listed = stdout(&run(&["token", "list", "--data", &data]));
    assert!(listed.contains("admin") && !listed.contains(&admin), "{listed}");
    drop((server, worker));
}

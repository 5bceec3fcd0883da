//! Commands on the data folder of a server: tokens, backup, restore and pruning.

mod support;

use roost_api::job::{JobState, JobView};
use serde_json::{Value, json};

use support::stl::{binary, block};
use support::{Sandbox, hopper_scenario, roost, run, stdout, transcript, wait_until};

#[test]
fn backup_of_a_busy_server_is_consistent_and_restores() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let worker = sandbox.start_worker("worker");
    let file = sandbox.file("framed.json", &hopper_scenario(0.2));
    let done = stdout(&sandbox.roost(&["submit", "--json", "--frame-interval", "0.05", &file]));
    let done: JobView = serde_json::from_str(&done).unwrap();
    sandbox.wait_for_job(&done, "the job has ended", |job| job.state == JobState::Succeeded);
    let frames = || {
        let file = sandbox.path("frames").display().to_string();
        stdout(&sandbox.roost(&["results", &done.id.to_string(), "--frames", &file]));
        std::fs::read(file).unwrap()
    };
    let pictures = frames();
    let running = sandbox.submit(&support::slow_scenario(600.0));
    sandbox.wait_for_job(&running, "the job is under way", |job| job.state == JobState::Running);

    let (data, copy) =
        (sandbox.path("data").display().to_string(), sandbox.path("copy").display().to_string());
    let summary: Value =
        serde_json::from_str(&stdout(&run(&["backup", &copy, "--data", &data, "--json"]))).unwrap();
    assert_eq!(
        (&summary["jobs"], &summary["results"], &summary["absent_objects"]),
        (&json!(2), &json!(1), &json!(0))
    );
    let files = std::fs::read_dir(&copy).unwrap().map(|file| file.unwrap().file_name());
    let files: std::collections::BTreeSet<_> = files.collect();
    assert_eq!(files, ["objects".into(), "roost.db".into()].into(), "one file with its frames, and no log");
    let again = run(&["backup", &copy, "--data", &data]);
    assert!(!again.status.success() && transcript(&again).contains("already"), "{}", transcript(&again));
    let later = sandbox.submit(&hopper_scenario(0.1));
    drop((server, worker));

    // Restored into another folder, with another server.
    let refused = run(&["restore", &copy, "--data", &data]);
    assert!(
        !refused.status.success() && transcript(&refused).contains("already"),
        "{}",
        transcript(&refused)
    );
    std::fs::rename(sandbox.path("data"), sandbox.path("lost")).unwrap();
    stdout(&run(&["restore", &copy, "--data", &data]));
    let _server = sandbox.start_server_with_short_leases();
    assert_eq!(
        sandbox.job(&done).unwrap().responses,
        sandbox.wait_for_job(&done, "the job", |_| true).responses
    );
    assert_eq!(sandbox.job(&done).unwrap().state, JobState::Succeeded);
    assert!(frames() == pictures, "{} bytes of frames", pictures.len());
    assert!(sandbox.job(&later).is_none(), "it came after that moment");
    let back = sandbox.wait_for_job(&running, "its lease has ended", |job| job.state == JobState::Queued);
    assert_eq!(back.attempt, 1);
    std::fs::remove_dir_all(sandbox.path("data").join("objects")).unwrap();
    let without = sandbox.path("without frames").display().to_string();
    let without = run(&["backup", &without, "--data", &data]);
    assert!(
        stdout(&without).contains("2 jobs") && transcript(&without).contains("warning: 1 objects"),
        "{}",
        transcript(&without)
    );
    let nothing = run(&["backup", &copy, "--data", &sandbox.path("nowhere").display().to_string()]);
    assert!(transcript(&nothing).contains("there is no roost.db"), "{}", transcript(&nothing));
    assert!(transcript(&nothing).contains("--data"), "{}", transcript(&nothing));
}

#[test]
fn projects_are_made_listed_and_changed() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let project = |args: &[&str]| run(&[&["project"], args, &["--data", &data]].concat());
    let missing = project(&["list"]);
    assert!(transcript(&missing).contains("there is no roost.db"), "{}", transcript(&missing));
    let made = project(&["create", "wax", "--share", "3", "--json"]);
    let made: Value = serde_json::from_str(&stdout(&made)).unwrap();
    let expected = json!({"name": "wax", "share": 3, "budget_core_hours": null, "used_core_hours": 0.0});
    assert_eq!(made, expected);
    let _server = sandbox.start_server();
    let changed = project(&["set", "wax", "--budget-core-hours", "10.5"]);
    assert!(stdout(&changed).contains("10.5"), "{}", transcript(&changed));
    let listed = sandbox.get("/v1/projects");
    assert_eq!(
        (&listed["items"][0]["share"], &listed["items"][0]["budget_core_hours"]),
        (&json!(3), &json!(10.5))
    );
    stdout(&project(&["set", "wax", "--budget-core-hours", "none"]));
    assert_eq!(sandbox.get("/v1/projects")["items"][0]["budget_core_hours"], json!(null));
    let token = ["token", "create", "--scope", "read"];
    let project = ["project"];
    for (command, args, named) in [
        (&project[..], &["create", "wax"][..], "project wax already exists"),
        (&project, &["create", "a b"], "project name \"a b\" is invalid: allowed are 1 to 64"),
        (
            &project,
            &["set", "wox", "--share", "2"],
            "project \"wox\" does not exist: `roost project list` shows all",
        ),
        (&project, &["set", "wax"], "nothing to change: give --share or --budget-core-hours"),
        (&project, &["set", "wax", "--share", "0"], "0 is not in 1..=1000"),
        (&project, &["set", "wax", "--budget-core-hours=-1"], "allowed is a number from 0 to 1e9, or `none`"),
        (&token, &["--project", "wox"], "project \"wox\" does not exist"),
        (&token, &["--user", "a\nb"], "allowed are 1 to 256 bytes without control characters"),
    ] {
        let refused = run(&[command, args, &["--data", &data]].concat());
        let text = transcript(&refused);
        assert!(!refused.status.success() && text.contains(named), "{named}: {text}");
    }
}

#[test]
#[cfg(not(feature = "s3"))]
fn bucket_is_refused_by_a_build_without_bucket_support() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let refused = run(&["serve", "--data", &data, "--objects", "s3://frames/of/roost"]);
    assert!(!sandbox.path("data").exists(), "nothing is made");
    for named in ["--objects", "s3://frames/of/roost", "feature `s3`"] {
        assert!(transcript(&refused).contains(named), "{named}: {}", transcript(&refused));
    }
}

#[test]
fn token_gives_access_to_its_bearer_only() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    // A mistyped folder is not created.
    let listed = run(&["token", "list", "--data", &data]);
    assert_eq!(listed.status.code(), Some(2), "{}", transcript(&listed));
    assert!(
        transcript(&listed).contains("give the data folder of the server with --data"),
        "{}",
        transcript(&listed)
    );
    assert!(!sandbox.path("data").exists());
    let make = |scope: &str| {
        let made = run(&["token", "create", "--scope", scope, "--name", "me", "--data", &data]);
        stdout(&made).trim().to_owned()
    };
    let (admin, worker, read) = (make("admin"), make("worker"), make("read"));
    let server = sandbox.spawn_server(&["--lease-s", "2"]);
    support::wait_until("the server answers", || {
        let asked = sandbox.roost(&["list"]);
        (transcript(&asked).contains("authorization")).then_some(())
    });
    let with = |token: &str, arguments: &[&str]| {
        roost()
            .args(arguments)
            .env("ROOST_SERVER", &sandbox.address)
            .env("ROOST_TOKEN", token)
            .output()
            .unwrap()
    };
    let file = sandbox.file("scenario.json", &hopper_scenario(0.1));
    let refused = with(&read, &["submit", &file]);
    assert!(transcript(&refused).contains("scope submit"), "{}", transcript(&refused));
    stdout(&with(&admin, &["submit", &file]));

    std::fs::write(sandbox.path("worker.token"), format!("{worker}\n")).unwrap();
    let token_file = sandbox.path("worker.token").display().to_string();
    let worker = sandbox.start_worker_with("worker", &["--token-file", &token_file]);
    support::wait_until("the job has ended", || {
        let listed = stdout(&with(&read, &["list", "--jobs"]));
        listed.contains("succeeded").then_some(())
    });
    let listed = stdout(&run(&["token", "list", "--data", &data]));
    assert!(listed.contains("admin") && !listed.contains(&admin), "{listed}");
    drop((server, worker));
}

#[test]
fn prune_deletes_only_what_ended_long_ago() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let with_mesh = |length_mm: f32| {
        std::fs::write(sandbox.path("block.stl"), binary(&block([length_mm, 60.0, 30.0], 2))).unwrap();
        let mut scenario = hopper_scenario(0.02);
        scenario["product"]["mesh"] = json!({"file": "block.stl", "units": "mm"});
        scenario
    };
    let answer = |arguments: &[&str]| -> Value {
        serde_json::from_str(&stdout(&sandbox.roost(&[arguments, &["--json"]].concat()))).unwrap()
    };
    let meshes = || -> Vec<Value> {
        let listed = sandbox.get("/v1/meshes")["items"].clone();
        listed.as_array().unwrap().iter().map(|mesh| mesh["digest"].clone()).collect()
    };
    // A cancelled job has ended; there is no worker.
    let job = sandbox.submit(&with_mesh(120.0));
    sandbox.roost(&["cancel", &job.id.to_string()]);
    let waiting = sandbox.submit(&with_mesh(110.0));
    let sweep = |name: &str| {
        let file = sandbox.file(
            "sweep.json",
            &json!({"name": name, "base": hopper_scenario(0.02), "design": {"kind": "grid"},
            "factors": [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.1, 0.2]}]}),
        );
        answer(&["submit", &file])["id"].as_str().unwrap().to_owned()
    };
    let (old, new) = (sweep("old"), sweep("new"));
    sandbox.roost(&["cancel", &old]);
    let [needed, unneeded] = meshes().try_into().expect("two meshes, newest first");

    let none = answer(&["prune", "--older-than", "1h"]);
    assert_eq!((&none["sweeps"], &none["jobs"], &none["meshes"]), (&json!([]), &json!(0), &json!([])));
    let output = sandbox.roost(&["prune", "--older-than", "0h"]);
    assert!(
        stdout(&output).contains("would delete 1 sweeps, 1 single jobs, 1 meshes"),
        "{}",
        transcript(&output)
    );
    assert!(
        transcript(&output).contains(&format!("{old}  old: 2 jobs")) && transcript(&output).contains("--yes"),
        "{}",
        transcript(&output)
    );
    assert_eq!(answer(&["list"])["items"].as_array().unwrap().len(), 2, "nothing is gone yet");

    let gone = answer(&["prune", "--older-than", "0h", "--yes"]);
    assert_eq!((gone["dry_run"].as_bool(), gone["jobs"].as_u64()), (Some(false), Some(1)), "{gone}");
    assert_eq!(sandbox.roost(&["status", &old]).status.code(), Some(2));
    assert_eq!(sandbox.roost(&["status", &job.id.to_string()]).status.code(), Some(2));
    assert_eq!(answer(&["status", &new])["counts"]["queued"], 2, "unfinished jobs stay");
    assert_eq!((&gone["meshes"], meshes()), (&json!([unneeded]), vec![needed]));
    assert_eq!(answer(&["status", &waiting.id.to_string()])["state"].as_str(), Some("queued"));

    // Automatically, after the next start.
    sandbox.roost(&["cancel", &new]);
    server.terminate();
    server.wait();
    let _server = sandbox.start_server_with(&["--prune-after", "0h"]);
    wait_until("the sweep is gone", || {
        (sandbox.roost(&["status", &new]).status.code() == Some(2)).then_some(())
    });
    assert_eq!(answer(&["status", &waiting.id.to_string()])["state"].as_str(), Some("queued"));
    let wrong = sandbox.roost(&["prune", "--older-than", "30"]);
    assert!(
        wrong.status.code() == Some(2) && transcript(&wrong).contains("such as 12h, 30d or 8w"),
        "{}",
        transcript(&wrong)
    );
}

/// Permissions of a file, or of a folder and everything in it.
fn modes(path: &std::path::Path) -> Vec<(std::path::PathBuf, u32)> {
    use std::os::unix::fs::PermissionsExt;
    let metadata = std::fs::metadata(path).unwrap();
    let mut found = vec![(path.to_owned(), metadata.permissions().mode() & 0o777)];
    if metadata.is_dir() {
        found.extend(std::fs::read_dir(path).unwrap().flat_map(|entry| modes(&entry.unwrap().path())));
    }
    found
}

#[test]
fn data_folder_is_readable_by_its_user_only() {
    use std::os::unix::fs::PermissionsExt;
    let open = |path: &std::path::Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    let sandbox = Sandbox::new();
    let data = sandbox.path("data");
    // A folder of an earlier version.
    drop(sandbox.start_server());
    open(&data, 0o755);
    open(&data.join("roost.db"), 0o644);
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let file = sandbox.file("framed.json", &hopper_scenario(0.2));
    let job = stdout(&sandbox.roost(&["submit", "--json", "--frame-interval", "0.05", &file]));
    let job: JobView = serde_json::from_str(&job).unwrap();
    sandbox.wait_for_job(&job, "the job has ended", |job| job.state == JobState::Succeeded);
    let copy = sandbox.path("copy");
    stdout(&run(&["backup", &copy.display().to_string(), "--data", &data.display().to_string()]));
    for folder in [&data, &copy] {
        let found = modes(folder);
        assert!(found.iter().any(|(path, _)| path.to_string_lossy().contains("objects/")), "{found:?}");
        for (path, mode) in found {
            let wanted = if path.is_dir() { 0o700 } else { 0o600 };
            assert_eq!(mode, wanted, "{}: {mode:o}", path.display());
        }
    }

    // Links lead to other files; `lost+found` belongs to the system.
    let linked = sandbox.path("linked");
    for folder in [&linked, &linked.join("lost+found"), &sandbox.path("disk")] {
        std::fs::create_dir(folder).unwrap();
        open(folder, 0o755);
    }
    std::fs::write(sandbox.path("theirs.txt"), "theirs").unwrap();
    open(&sandbox.path("theirs.txt"), 0o644);
    std::os::unix::fs::symlink(sandbox.path("disk"), linked.join("objects")).unwrap();
    std::os::unix::fs::symlink(sandbox.path("theirs.txt"), linked.join("roost.db-journal")).unwrap();
    std::os::unix::fs::symlink(sandbox.path("nowhere"), linked.join("worker")).unwrap();
    stdout(&run(&["token", "create", "--scope", "read", "--data", &linked.display().to_string()]));
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&linked), 0o700);
    assert_eq!((mode(&sandbox.path("disk")), mode(&sandbox.path("theirs.txt"))), (0o755, 0o644));

    // A folder with other files keeps its permissions.
    let shared = sandbox.path("shared");
    std::fs::create_dir(&shared).unwrap();
    std::fs::write(shared.join("notes.txt"), "mine").unwrap();
    open(&shared, 0o755);
    open(&shared.join("notes.txt"), 0o644);
    let made = run(&["token", "create", "--scope", "read", "--data", &shared.display().to_string()]);
    assert!(transcript(&made).contains("its permissions are not changed"), "{}", transcript(&made));
    let found: std::collections::HashMap<_, _> = modes(&shared).into_iter().collect();
    assert_eq!((found[&shared], found[&shared.join("notes.txt")]), (0o755, 0o644), "{found:?}");
    assert_eq!(found[&shared.join("roost.db")], 0o600, "{found:?}");
}

#[test]
fn revoking_the_last_token_warns() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let create = || {
        let made = stdout(&run(&["token", "create", "--json", "--scope", "read", "--data", &data]));
        let made: Value = serde_json::from_str(&made).unwrap();
        made["view"]["id"].as_str().unwrap().to_owned()
    };
    let made = run(&["token", "create", "--scope", "read", "--data", &data]);
    assert!(transcript(&made).contains("is a new data folder"), "{}", transcript(&made));
    assert!(transcript(&made).contains("every request needs a token"), "{}", transcript(&made));
    let unnamed = stdout(&run(&["token", "list", "--json", "--data", &data]));
    let unnamed: Value = serde_json::from_str(&unnamed).unwrap();
    let (first, last) = (unnamed[0]["id"].as_str().unwrap().to_owned(), create());
    let revoke = |id: &str| transcript(&run(&["token", "revoke", id, "--data", &data]));
    assert!(!revoke(&first).contains("warning"));
    assert!(revoke(&last).contains("warning: no token is valid now"));
    let server = sandbox.spawn_server(&[]);
    wait_until("the server refuses", || (sandbox.status("/v1/jobs") == Some(401)).then_some(()));
    assert!(
        server.log().contains("ERROR") && server.log().contains("no access token is valid"),
        "{}",
        server.log()
    );
}

#[test]
fn server_and_worker_in_one_process_share_a_data_folder_with_tokens() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let make =
        |scope: &str| stdout(&run(&["token", "create", "--scope", scope, "--data", &data])).trim().to_owned();
    let (admin, worker) = (make("admin"), make("worker"));
    let listen = sandbox.address.trim_start_matches("http://").to_owned();
    let up = |token: &str| {
        let mut up = roost();
        up.args(["up", "--threads", "1", "--listen", &listen, "--data", &data]).env("ROOST_TOKEN", token);
        up
    };
    let refused = up("").output().unwrap();
    assert!(
        !refused.status.success() && transcript(&refused).contains("authorization"),
        "{}",
        transcript(&refused)
    );
    let mut running =
        up(&worker).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    wait_until("the server answers", || (sandbox.status("/v1/jobs") == Some(401)).then_some(()));
    let file = sandbox.file("scenario.json", &hopper_scenario(0.05));
    let submitted = roost()
        .args(["submit", "--wait", &file])
        .env("ROOST_SERVER", &sandbox.address)
        .env("ROOST_TOKEN", &admin)
        .output()
        .unwrap();
    support::signal(running.id(), "TERM");
    running.wait().unwrap();
    assert!(submitted.status.success(), "{}", transcript(&submitted));
}

#[test]
fn a_refused_database_address_is_not_quoted() {
    for address in
        ["host=db user=me password=s3cret", "mysql://me:s3cret@db/roost", "postgres://me:s3c/ret@db/roost"]
    {
        for command in [
            vec!["serve", "--database", address],
            vec!["token", "list", "--database", address],
            vec!["copy", "--to", "elsewhere", "--from", address],
        ] {
            let output = run(&command);
            let text = transcript(&output);
            assert!(!output.status.success() && !text.contains("s3c"), "{command:?}: {text}");
        }
    }
}

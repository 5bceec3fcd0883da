//! What is done where the data is: tokens, backup and restore, with a server that runs beside it.

mod support;

use roost_api::job::{JobState, JobView};
use serde_json::{Value, json};

use support::stl::{binary, block};
use support::{Home, roost, run, said, scenario, stdout, until};

#[test]
fn a_backup_of_a_server_at_work_is_one_moment_and_comes_back_whole() {
    let home = Home::new();
    let server = home.serve();
    let worker = home.work("worker");
    let file = home.file("framed.json", &scenario(0.2));
    let done = stdout(&home.roost(&["submit", "--json", "--frame-interval", "0.05", &file]));
    let done: JobView = serde_json::from_str(&done).unwrap();
    home.job_when(&done, "the job has ended", |job| job.state == JobState::Succeeded);
    let frames = || {
        let file = home.path("frames").display().to_string();
        stdout(&home.roost(&["results", &done.id.to_string(), "--frames", &file]));
        std::fs::read(file).unwrap()
    };
    let pictures = frames();
    let running = home.submit(&support::long(600.0));
    home.job_when(&running, "the job is under way", |job| job.state == JobState::Running);

    let (data, copy) = (home.path("data").display().to_string(), home.path("copy").display().to_string());
    let told: Value =
        serde_json::from_str(&stdout(&run(&["backup", &copy, "--data", &data, "--json"]))).unwrap();
    assert_eq!((&told["jobs"], &told["results"], &told["absent_objects"]), (&json!(2), &json!(1), &json!(0)));
    let files = std::fs::read_dir(&copy).unwrap().map(|file| file.unwrap().file_name());
    let files: std::collections::BTreeSet<_> = files.collect();
    assert_eq!(files, ["objects".into(), "roost.db".into()].into(), "one file with its frames, and no log");
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
    assert!(frames() == pictures, "{} bytes of frames", pictures.len());
    assert!(home.job(&later).is_none(), "it came after that moment");
    let back = home.job_when(&running, "its lease has ended", |job| job.state == JobState::Queued);
    assert_eq!(back.attempt, 1);
    std::fs::remove_dir_all(home.path("data").join("objects")).unwrap();
    let without = home.path("without frames").display().to_string();
    let without = run(&["backup", &without, "--data", &data]);
    assert!(
        stdout(&without).contains("2 jobs") && said(&without).contains("not copied: 1"),
        "{}",
        said(&without)
    );
    let nothing = run(&["backup", &copy, "--data", &home.path("nowhere").display().to_string()]);
    assert!(said(&nothing).contains("there is no roost.db"), "{}", said(&nothing));
    assert!(said(&nothing).contains("--data"), "{}", said(&nothing));
}

#[test]
#[cfg(not(feature = "s3"))]
fn a_bucket_needs_a_build_that_knows_buckets() {
    let home = Home::new();
    let data = home.path("data").display().to_string();
    let refused = run(&["serve", "--data", &data, "--objects", "s3://frames/of/roost"]);
    assert!(!home.path("data").exists(), "nothing is made");
    for named in ["--objects", "s3://frames/of/roost", "feature `s3`"] {
        assert!(said(&refused).contains(named), "{named}: {}", said(&refused));
    }
}

#[test]
fn a_token_opens_the_server_to_its_bearer_alone() {
    let home = Home::new();
    let data = home.path("data").display().to_string();
    // A folder that was mistyped is not made.
    let listed = run(&["token", "list", "--data", &data]);
    assert_eq!(listed.status.code(), Some(2), "{}", said(&listed));
    assert!(said(&listed).contains("name the folder of the server with --data"), "{}", said(&listed));
    assert!(!home.path("data").exists());
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

#[test]
fn what_ended_long_ago_goes_and_nothing_else() {
    let home = Home::new();
    let server = home.serve();
    let with_mesh = |length_mm: f32| {
        std::fs::write(home.path("block.stl"), binary(&block([length_mm, 60.0, 30.0], 2))).unwrap();
        let mut scenario = scenario(0.02);
        scenario["product"]["mesh"] = json!({"file": "block.stl", "units": "mm"});
        scenario
    };
    let answer = |arguments: &[&str]| -> Value {
        serde_json::from_str(&stdout(&home.roost(&[arguments, &["--json"]].concat()))).unwrap()
    };
    let meshes = || -> Vec<Value> {
        let listed = home.get("/v1/meshes")["items"].clone();
        listed.as_array().unwrap().iter().map(|mesh| mesh["digest"].clone()).collect()
    };
    // What is cancelled has ended; no worker is there.
    let job = home.submit(&with_mesh(120.0));
    home.roost(&["cancel", &job.id.to_string()]);
    let waiting = home.submit(&with_mesh(110.0));
    let sweep = |name: &str| {
        let file = home.file(
            "sweep.json",
            &json!({"name": name, "base": scenario(0.02), "design": {"kind": "grid"},
            "factors": [{"pointer": "/equipment/belt_speed_m_s", "levels": [0.1, 0.2]}]}),
        );
        answer(&["submit", &file])["id"].as_str().unwrap().to_owned()
    };
    let (old, new) = (sweep("old"), sweep("new"));
    home.roost(&["cancel", &old]);
    let [needed, unneeded] = meshes().try_into().expect("two meshes, newest first");

    let none = answer(&["prune", "--older-than", "1h"]);
    assert_eq!((&none["sweeps"], &none["jobs"], &none["meshes"]), (&json!([]), &json!(0), &json!([])));
    let told = home.roost(&["prune", "--older-than", "0h"]);
    assert!(stdout(&told).contains("would delete 1 sweeps, 1 single jobs, 1 meshes"), "{}", said(&told));
    assert!(
        said(&told).contains(&format!("{old}  old: 2 jobs")) && said(&told).contains("--yes"),
        "{}",
        said(&told)
    );
    assert_eq!(answer(&["list"])["items"].as_array().unwrap().len(), 2, "nothing is gone yet");

    let gone = answer(&["prune", "--older-than", "0h", "--yes"]);
    assert_eq!((gone["dry_run"].as_bool(), gone["jobs"].as_u64()), (Some(false), Some(1)), "{gone}");
    assert_eq!(home.roost(&["status", &old]).status.code(), Some(2));
    assert_eq!(home.roost(&["status", &job.id.to_string()]).status.code(), Some(2));
    assert_eq!(answer(&["status", &new])["counts"]["queued"], 2, "what has not ended stays");
    assert_eq!((&gone["meshes"], meshes()), (&json!([unneeded]), vec![needed]));
    assert_eq!(answer(&["status", &waiting.id.to_string()])["state"].as_str(), Some("queued"));

    // By itself, from the next start on.
    home.roost(&["cancel", &new]);
    server.terminate();
    server.wait();
    let _server = home.serve_with(&["--prune-after", "0h"]);
    until("the sweep is gone", || (home.roost(&["status", &new]).status.code() == Some(2)).then_some(()));
    assert_eq!(answer(&["status", &waiting.id.to_string()])["state"].as_str(), Some("queued"));
    let wrong = home.roost(&["prune", "--older-than", "30"]);
    assert!(
        wrong.status.code() == Some(2) && said(&wrong).contains("such as 12h, 30d or 8w"),
        "{}",
        said(&wrong)
    );
}

/// Permissions of a file or folder, and of everything below it.
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
fn what_a_server_keeps_is_for_its_own_user_alone() {
    use std::os::unix::fs::PermissionsExt;
    let open = |path: &std::path::Path, mode| {
        std::fs::set_permissions(path, std::fs::Permissions::from_mode(mode)).unwrap();
    };
    let home = Home::new();
    let data = home.path("data");
    // A folder as an earlier version left it.
    drop(home.serve());
    open(&data, 0o755);
    open(&data.join("roost.db"), 0o644);
    let _server = home.serve();
    let _worker = home.work("worker");
    let file = home.file("framed.json", &scenario(0.2));
    let job = stdout(&home.roost(&["submit", "--json", "--frame-interval", "0.05", &file]));
    let job: JobView = serde_json::from_str(&job).unwrap();
    home.job_when(&job, "the job has ended", |job| job.state == JobState::Succeeded);
    let copy = home.path("copy");
    stdout(&run(&["backup", &copy.display().to_string(), "--data", &data.display().to_string()]));
    for folder in [&data, &copy] {
        let found = modes(folder);
        assert!(found.iter().any(|(path, _)| path.to_string_lossy().contains("objects/")), "{found:?}");
        for (path, mode) in found {
            let wanted = if path.is_dir() { 0o700 } else { 0o600 };
            assert_eq!(mode, wanted, "{}: {mode:o}", path.display());
        }
    }

    // Links lead to what is somebody else's; `lost+found` is the system's.
    let linked = home.path("linked");
    for folder in [&linked, &linked.join("lost+found"), &home.path("disk")] {
        std::fs::create_dir(folder).unwrap();
        open(folder, 0o755);
    }
    std::fs::write(home.path("theirs.txt"), "theirs").unwrap();
    open(&home.path("theirs.txt"), 0o644);
    std::os::unix::fs::symlink(home.path("disk"), linked.join("objects")).unwrap();
    std::os::unix::fs::symlink(home.path("theirs.txt"), linked.join("roost.db-journal")).unwrap();
    std::os::unix::fs::symlink(home.path("nowhere"), linked.join("worker")).unwrap();
    stdout(&run(&["token", "create", "--scope", "read", "--data", &linked.display().to_string()]));
    let mode = |path: &std::path::Path| std::fs::metadata(path).unwrap().permissions().mode() & 0o777;
    assert_eq!(mode(&linked), 0o700);
    assert_eq!((mode(&home.path("disk")), mode(&home.path("theirs.txt"))), (0o755, 0o644));

    // A folder with other things in it is somebody's own.
    let shared = home.path("shared");
    std::fs::create_dir(&shared).unwrap();
    std::fs::write(shared.join("notes.txt"), "mine").unwrap();
    open(&shared, 0o755);
    open(&shared.join("notes.txt"), 0o644);
    let made = run(&["token", "create", "--scope", "read", "--data", &shared.display().to_string()]);
    assert!(said(&made).contains("its permissions are not changed"), "{}", said(&made));
    let found: std::collections::HashMap<_, _> = modes(&shared).into_iter().collect();
    assert_eq!((found[&shared], found[&shared.join("notes.txt")]), (0o755, 0o644), "{found:?}");
    assert_eq!(found[&shared.join("roost.db")], 0o600, "{found:?}");
}

#[test]
fn a_revoked_last_token_is_warned_of() {
    let home = Home::new();
    let data = home.path("data").display().to_string();
    let create = || {
        let made = stdout(&run(&["token", "create", "--json", "--scope", "read", "--data", &data]));
        let made: Value = serde_json::from_str(&made).unwrap();
        made["view"]["id"].as_str().unwrap().to_owned()
    };
    let made = run(&["token", "create", "--scope", "read", "--data", &data]);
    assert!(said(&made).contains("is a new data folder"), "{}", said(&made));
    assert!(said(&made).contains("every request needs a token"), "{}", said(&made));
    let unnamed = stdout(&run(&["token", "list", "--json", "--data", &data]));
    let unnamed: Value = serde_json::from_str(&unnamed).unwrap();
    let (first, last) = (unnamed[0]["id"].as_str().unwrap().to_owned(), create());
    let revoke = |id: &str| said(&run(&["token", "revoke", id, "--data", &data]));
    assert!(!revoke(&first).contains("warning"));
    assert!(revoke(&last).contains("warning: no token is valid now"));
    let server = home.start_server(&[]);
    until("the server refuses", || (home.status("/v1/jobs") == Some(401)).then_some(()));
    assert!(
        server.log().contains("ERROR") && server.log().contains("no access token is valid"),
        "{}",
        server.log()
    );
}

#[test]
fn server_and_worker_in_one_process_share_a_data_folder_with_tokens() {
    let home = Home::new();
    let data = home.path("data").display().to_string();
    let make =
        |scope: &str| stdout(&run(&["token", "create", "--scope", scope, "--data", &data])).trim().to_owned();
    let (admin, worker) = (make("admin"), make("worker"));
    let listen = home.address.trim_start_matches("http://").to_owned();
    let up = |token: &str| {
        let mut up = roost();
        up.args(["up", "--threads", "1", "--listen", &listen, "--data", &data]).env("ROOST_TOKEN", token);
        up
    };
    let refused = up("").output().unwrap();
    assert!(!refused.status.success() && said(&refused).contains("authorization"), "{}", said(&refused));
    let mut running =
        up(&worker).stdout(std::process::Stdio::null()).stderr(std::process::Stdio::null()).spawn().unwrap();
    until("the server answers", || (home.status("/v1/jobs") == Some(401)).then_some(()));
    let file = home.file("scenario.json", &scenario(0.05));
    let submitted = roost()
        .args(["submit", "--wait", &file])
        .env("ROOST_SERVER", &home.address)
        .env("ROOST_TOKEN", &admin)
        .output()
        .unwrap();
    support::signal(running.id(), "TERM");
    running.wait().unwrap();
    assert!(submitted.status.success(), "{}", said(&submitted));
}

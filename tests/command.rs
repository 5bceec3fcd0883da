//! The command without a server: running a scenario here, and saying clearly what is wrong with bad input.

mod support;

use std::io::Write;
use std::process::Stdio;

use serde_json::{Value, json};
use support::{Home, long, roost, run, said, scenario, stdout};

/// Runs a command that must refuse its input; returns what it said on stderr.
fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(output.stdout.is_empty(), "{}", said(&output));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn run_writes_result_series_and_curve() {
    let home = Home::new();
    let (file, out) = (home.file("small.json", &scenario(0.4)), home.path("out"));
    let folder = out.display().to_string();
    let table = stdout(&run(&["run", &file, "-o", &folder, "--threads", "1", "--seed", "7"]));
    assert!(table.contains("discharged_kg") && table.contains("result.json"), "{table}");

    let result: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["schema"], "roost.result/1");
    assert_eq!(result["end_reason"], "duration");
    assert_eq!(result["scenario"]["seed"], 7);
    let mut csv = csv::Reader::from_path(out.join("series.csv")).unwrap();
    let header = csv.headers().unwrap().clone();
    assert_eq!(&header[0], "t_s");
    assert_eq!(header.len(), 1 + result["series"].as_array().unwrap().len());
    assert!(csv.records().count() > 10);
    assert!(std::fs::read_to_string(out.join("curve.svg")).unwrap().contains("discharged mass (kg)"));
}

#[test]
fn threads_have_a_limit() {
    let home = Home::new();
    let (file, out) = (home.file("small.json", &scenario(0.2)), home.path("out").display().to_string());
    let state = home.path("state").display().to_string();
    for arguments in [
        vec!["run", &file, "-o", &out],
        vec!["work", "--server", &home.address, "--state", &state],
        vec!["up", "--data", &state],
    ] {
        for threads in ["1025", "999999999999"] {
            let text = refused(&[arguments.as_slice(), &["--threads", threads]].concat());
            assert!(text.contains("0..=1024"), "{text}");
        }
    }
    // More than there are processors, which would hardly get anywhere.
    let output = run(&["run", &file, "-o", &out, "--threads", "1024", "--backend", "cpu"]);
    assert!(said(&output).contains("warning: --threads 1024 is more than"), "{}", said(&output));
    stdout(&output);
    let result: Value =
        serde_json::from_slice(&std::fs::read(home.path("out/result.json")).unwrap()).unwrap();
    let processors = std::thread::available_parallelism().unwrap().get();
    assert_eq!(result["solver"]["threads"], json!(processors));
}

#[test]
fn run_reads_stdin_and_prints_json() {
    let home = Home::new();
    let mut child = roost()
        .args(["run", "-", "--json", "--threads", "1", "-o"])
        .arg(home.path("out"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(scenario(0.2).to_string().as_bytes()).unwrap();
    let summary: Value = serde_json::from_str(&stdout(&child.wait_with_output().unwrap())).unwrap();
    assert_eq!(summary["end_reason"], "duration");
    assert!(summary["responses"]["discharged_kg"].is_number(), "{summary}");
}

#[test]
fn ctrl_c_keeps_what_there_is() {
    let home = Home::new();
    let (file, out) = (home.file("long.json", &long(600.0)), home.path("out"));
    let child = roost()
        .args(["run", &file, "--threads", "1", "-o"])
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    support::until("the run has begun", || out.is_dir().then_some(()));
    std::thread::sleep(std::time::Duration::from_millis(500));
    support::signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    let result: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["end_reason"], "cancelled");
    assert_eq!(result["responses"], json!({}), "a cancelled run has no responses");
}

#[test]
fn a_diverging_run_exits_with_3_and_keeps_its_series() {
    let home = Home::new();
    let mut diverging = scenario(0.4);
    diverging["numerics"]["timestep_s"] = json!(0.02);
    diverging["numerics"]["allow_unstable"] = json!(true);
    let (file, out) = (home.file("diverging.json", &diverging), home.path("out"));
    let output = run(&["run", &file, "-o", &out.display().to_string()]);
    assert_eq!(output.status.code(), Some(3), "{}", said(&output));
    let result: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["end_reason"], "unstable");
    assert!(result["instability"]["reason"].is_string());
}

#[test]
fn a_missing_file_is_one_line() {
    for command in ["run", "validate", "submit"] {
        let mut arguments = vec![command, "/no/such/file.json"];
        if command == "run" {
            arguments.extend(["-o", "/tmp/never-made"]);
        }
        let text = refused(&arguments);
        assert_eq!(text, "error: cannot read /no/such/file.json: No such file or directory (os error 2)\n");
    }
}

#[test]
fn what_is_not_json_is_one_line_with_its_place() {
    let home = Home::new();
    let path = home.path("bad.json");
    std::fs::write(&path, "{\"experiment\": \"hopper\",\n \"seed\": NaN}").unwrap();
    let path = path.display().to_string();
    for command in ["validate", "submit"] {
        let text = refused(&[command, &path]);
        assert!(text.starts_with(&format!("error: {path}: not JSON at line 2, column 1")), "{text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

#[test]
fn every_fault_is_listed_at_once() {
    let home = Home::new();
    let mut bad = scenario(0.4);
    bad["product"]["count"] = json!(-3);
    bad["equipment"]["gate_openning_m"] = json!(0.06);
    bad["numerics"]["duration_s"] = json!("long");
    let file = home.file("bad.json", &bad);
    let out = home.path("out").display().to_string();
    for arguments in [vec!["validate", &file], vec!["run", &file, "-o", &out]] {
        let text = refused(&arguments);
        assert!(text.contains("3 faults"), "{text}");
        for part in
            ["/product/count", "-3", "/equipment/gate_openning_m", "gate_opening_m", "/numerics/duration_s"]
        {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
    }
    assert!(!home.path("out").exists(), "nothing is made for a scenario that cannot run");

    let output = run(&["validate", "--json", &file]);
    assert_eq!(output.status.code(), Some(2));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["valid"], false);
    assert_eq!(report["errors"].as_array().unwrap().len(), 3);
}

#[test]
fn labels_and_names_have_limits_that_validation_knows() {
    let home = Home::new();
    let sweep = json!({
        "name": "x".repeat(257), "base": scenario(0.4), "design": {"kind": "grid"}, "factors": [],
        "labels": {"line": "x".repeat(1_000_000)},
    });
    let text = refused(&["validate", &home.file("sweep.json", &sweep)]);
    assert!(text.len() < 2000 && text.contains("2 faults"), "{} bytes: {text:.2000}", text.len());
    for part in ["/name", "/labels/line", "257 bytes", "at most 256 bytes"] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
}

#[test]
fn the_servers_faults_arrive_too() {
    let home = Home::new();
    let _server = home.serve();
    let mut bad = scenario(0.4);
    bad["product"]["count"] = json!(-3);
    let file = home.file("bad.json", &bad);
    let sweep = json!({"name": "bad", "base": bad, "design": {"kind": "grid"}, "factors": []});
    let sweep = home.file("sweep.json", &sweep);
    for (file, pointer) in [(&file, "/product/count"), (&sweep, "/base/product/count")] {
        let output = home.roost(&["submit", file]);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        assert!(String::from_utf8_lossy(&output.stderr).contains(pointer), "{}", said(&output));
    }
    assert!(stdout(&home.roost(&["list"])).is_empty(), "nothing is stored");
    assert!(stdout(&home.roost(&["list", "--jobs"])).is_empty(), "nothing is stored");

    let nobody = "01890000-0000-7000-8000-000000000000";
    let output = home.roost(&["status", nobody]);
    assert_eq!(output.status.code(), Some(2), "{}", said(&output));
    assert!(String::from_utf8_lossy(&output.stderr).contains("no sweep and no job"), "{}", said(&output));
}

#[test]
fn one_fault_is_said_once_with_its_place_in_the_file() {
    let home = Home::new();
    let _server = home.serve();
    let mut bad = scenario(0.4);
    bad["product"]["count"] = json!(-3);
    let mut typo = json!({"name": "s", "base": scenario(0.4), "design": {"kind": "grid"}, "factors": []});
    typo["base"]["product"]["count"] = json!(-3);
    for (document, start) in [
        (bad.clone(), "/product/count: "),
        (json!({"scenario": bad}), "/scenario/product/count: "),
        (typo, "/base/product/count: "),
        (json!([]), "the document: "),
    ] {
        let file = home.file("bad.json", &document);
        let output = home.roost(&["submit", &file]);
        assert_eq!(output.status.code(), Some(2), "{}", said(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert_eq!(lines[0], format!("error: {file}: 1 fault"));
        assert!(lines[1].starts_with(&format!("  {start}")), "{text}");
    }
    let file = home.file("bad.json", &json!([]));
    assert!(refused(&["validate", &file]).contains("\n  the document: "));
}

#[test]
fn a_limit_of_wall_time_is_a_number_above_zero() {
    let home = Home::new();
    let file = home.file("small.json", &scenario(0.2));
    for limit in ["nan", "inf", "0", "-1", "soon"] {
        let text = refused(&["submit", "--server", &home.address, &file, "--max-wall-s", limit]);
        assert!(text.contains("a number of seconds above 0"), "{limit}: {text}");
    }
}

#[test]
fn waiting_ends_with_ctrl_c_even_when_the_server_hangs_and_says_when_it_is_away() {
    let home = Home::new();
    let mut server = home.serve();
    let file = home.file("scenario.json", &scenario(0.2));
    let wait = || {
        let log = home.path("wait.log");
        let child = roost()
            .args(["submit", "--wait", "--server", &home.address, &file])
            .stdout(Stdio::null())
            .stderr(std::fs::File::create(&log).unwrap())
            .spawn()
            .unwrap();
        let said = move || std::fs::read_to_string(&log).unwrap();
        support::until("it waits", || said().contains("queued").then_some(()));
        (child, said)
    };
    let ends = |mut child: std::process::Child| {
        support::signal(child.id(), "INT");
        let started = std::time::Instant::now();
        let status = support::until("it ends", || child.try_wait().unwrap());
        // Less than the time that a client waits for an answer.
        assert!(started.elapsed() < std::time::Duration::from_secs(30), "{:?}", started.elapsed());
        assert_eq!(status.code(), Some(1));
    };

    let (child, said) = wait();
    server.kill();
    support::until("it says so", || said().contains("waiting for the server").then_some(()));
    std::thread::sleep(std::time::Duration::from_millis(1500));
    assert_eq!(said().matches("waiting for the server").count(), 1, "{}", said());
    ends(child);

    server = home.serve();
    let (child, _) = wait();
    server.freeze();
    std::thread::sleep(std::time::Duration::from_millis(1500));
    ends(child);
}

#[test]
fn what_a_server_cannot_use_is_wrong_input() {
    let (home, other) = (Home::new(), Home::new());
    let _server = home.serve();
    let at = |home: &Home| home.address.trim_start_matches("http://").to_owned();
    let (data, elsewhere) =
        (home.path("data").display().to_string(), other.path("data").display().to_string());
    for (command, listen, data, part) in [
        ("serve", at(&home), &elsewhere, "cannot listen on"),
        ("up", at(&home), &elsewhere, "cannot listen on"),
        ("serve", at(&other), &data, "in use by another server"),
        ("serve", "0.0.0.0:0".to_owned(), &elsewhere, "refusing to listen"),
        ("serve", at(&other), &"/dev/null/data".to_owned(), "cannot use the data directory"),
    ] {
        let text = refused(&[command, "--listen", &listen, "--data", data]);
        assert!(text.contains(part), "{text}");
        assert_eq!(text.contains("hint: a server may run there"), part == "cannot listen on", "{text}");
    }
}

#[test]
fn results_that_are_not_there_yet_are_no_wrong_input() {
    let home = Home::new();
    let _server = home.serve();
    let job = home.submit(&scenario(0.2));
    let output = home.roost(&["results", &job.id.to_string()]);
    assert_eq!(output.status.code(), Some(1), "{}", said(&output));
    assert!(
        String::from_utf8_lossy(&output.stderr).starts_with("error: the job is queued: "),
        "{}",
        said(&output)
    );
}

#[test]
fn run_finds_out_beforehand_that_it_cannot_write() {
    let home = Home::new();
    let (file, out) = (home.file("long.json", &long(600.0)), home.path("out"));
    std::fs::create_dir_all(out.join("series.csv")).unwrap();
    std::fs::write(out.join("result.json"), "kept").unwrap();
    let text = refused(&["run", &file, "--threads", "1", "-o", &out.display().to_string()]);
    assert!(text.contains("cannot write") && text.contains("series.csv"), "{text}");
    assert_eq!(std::fs::read_to_string(out.join("result.json")).unwrap(), "kept");
    assert!(!out.join("curve.svg").exists());
}

#[test]
fn a_reader_that_has_seen_enough_is_no_failure() {
    let mut child = roost()
        .arg("validate")
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    child.stdin.take().unwrap().write_all(scenario(0.2).to_string().as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", said(&output));
}

#[test]
fn a_run_that_nobody_listens_to_is_written_all_the_same() {
    let home = Home::new();
    let (file, out) = (home.file("small.json", &scenario(0.2)), home.path("out"));
    let mut child = roost()
        .args(["run", &file, "--threads", "1", "-o", &out.display().to_string()])
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop((child.stdout.take(), child.stderr.take()));
    assert!(child.wait().unwrap().success());
    assert!(out.join("result.json").exists() && out.join("curve.svg").exists());
}

#[test]
fn a_server_that_is_away_is_two_lines() {
    let home = Home::new();
    let output = home.roost(&["list"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with(&format!("error: cannot reach {}", home.address)), "{text}");
    assert!(text.lines().nth(1).is_some_and(|line| line.starts_with("hint: `roost up`")), "{text}");
    assert_eq!(text.lines().count(), 2, "{text}");
}

#[test]
fn what_is_no_id_is_shown_one() {
    let output = run(&["results", "nope"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(said(&output).contains("'nope' for '<ID>': not an id, such as 0"), "{}", said(&output));
    let text = refused(&["drain", "nobody"]);
    assert!(text.contains("not an id, such as 0") && text.contains("`roost list --workers`"), "{text}");
    let text = refused(&["serve", "--listen", "80"]);
    assert!(text.contains("an IP address and a port, such as 127.0.0.1:7373"), "{text}");
}

#[test]
fn validate_says_what_it_would_cost() {
    let home = Home::new();
    let file = home.file("small.json", &scenario(0.4));
    let report: Value = serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap();
    assert_eq!((&report["document"], &report["jobs"]), (&json!("scenario"), &json!(1)));
    assert!(report["estimate"]["subparticles"].as_u64().unwrap() > 20);
    let sweep = json!({
        "name": "s", "base": scenario(0.4), "design": {"kind": "grid"}, "replicates": 3,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}],
    });
    let file = home.file("sweep.json", &sweep);
    let text = stdout(&run(&["validate", &file]));
    assert!(text.contains("sub-particles") && text.contains("6 jobs"), "{text}");
    let report: Value = serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap();
    let (job_s, all_s) = (report["estimate"]["wall_s"].as_f64().unwrap(), report["wall_s"].as_f64().unwrap());
    assert!((5.0..7.0).contains(&(all_s / job_s)), "points differ a little: {report:#}");
}

//! Commands without a server, above all `roost run`, and errors for bad input.

mod support;

use std::io::Write;
use std::process::Stdio;

use serde_json::{Value, json};
use support::{Sandbox, hopper_scenario, roost, run, slow_scenario, stdout, transcript};

/// Runs a command that must refuse its input. Returns its stderr.
fn refused(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    assert!(output.stdout.is_empty(), "{}", transcript(&output));
    String::from_utf8(output.stderr).unwrap()
}

#[test]
fn run_writes_result_series_and_curve() {
    let sandbox = Sandbox::new();
    let (file, out) = (sandbox.file("small.json", &hopper_scenario(0.4)), sandbox.path("out"));
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
    let sandbox = Sandbox::new();
    let (file, out) =
        (sandbox.file("small.json", &hopper_scenario(0.2)), sandbox.path("out").display().to_string());
    let state = sandbox.path("state").display().to_string();
    for arguments in [
        vec!["run", &file, "-o", &out],
        vec!["work", "--server", &sandbox.address, "--state", &state],
        vec!["up", "--data", &state],
    ] {
        for threads in ["1025", "999999999999"] {
            let text = refused(&[arguments.as_slice(), &["--threads", threads]].concat());
            assert!(text.contains("0..=1024"), "{text}");
        }
    }
    // The number of threads is limited to the number of processors.
    let output = run(&["run", &file, "-o", &out, "--threads", "1024", "--backend", "cpu"]);
    assert!(transcript(&output).contains("warning: --threads 1024 is more than"), "{}", transcript(&output));
    stdout(&output);
    let result: Value =
        serde_json::from_slice(&std::fs::read(sandbox.path("out/result.json")).unwrap()).unwrap();
    let processors = std::thread::available_parallelism().unwrap().get();
    assert_eq!(result["solver"]["threads"], json!(processors));
}

#[test]
fn run_reads_stdin_and_prints_json() {
    let sandbox = Sandbox::new();
    let mut child = roost()
        .args(["run", "-", "--json", "--threads", "1", "-o"])
        .arg(sandbox.path("out"))
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    child.stdin.take().unwrap().write_all(hopper_scenario(0.2).to_string().as_bytes()).unwrap();
    let summary: Value = serde_json::from_str(&stdout(&child.wait_with_output().unwrap())).unwrap();
    assert_eq!(summary["end_reason"], "duration");
    assert!(summary["responses"]["discharged_kg"].is_number(), "{summary}");
}

#[test]
fn ctrl_c_writes_the_partial_result() {
    let sandbox = Sandbox::new();
    let (file, out) = (sandbox.file("long.json", &slow_scenario(600.0)), sandbox.path("out"));
    let child = roost()
        .args(["run", &file, "--threads", "1", "-o"])
        .arg(&out)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    support::wait_until("the run has begun", || out.is_dir().then_some(()));
    std::thread::sleep(std::time::Duration::from_millis(500));
    support::signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", transcript(&output));
    let result: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["end_reason"], "cancelled");
    assert_eq!(result["responses"], json!({}), "a cancelled run has no responses");
}

#[test]
fn diverging_run_exits_with_3_and_writes_its_series() {
    let sandbox = Sandbox::new();
    let mut diverging = hopper_scenario(0.4);
    diverging["numerics"]["timestep_s"] = json!(0.02);
    diverging["numerics"]["allow_unstable"] = json!(true);
    let (file, out) = (sandbox.file("diverging.json", &diverging), sandbox.path("out"));
    let output = run(&["run", &file, "-o", &out.display().to_string()]);
    assert_eq!(output.status.code(), Some(3), "{}", transcript(&output));
    let result: Value = serde_json::from_slice(&std::fs::read(out.join("result.json")).unwrap()).unwrap();
    assert_eq!(result["end_reason"], "unstable");
    assert!(result["instability"]["reason"].is_string());
}

#[test]
fn missing_file_is_an_error_of_one_line() {
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
fn invalid_json_is_an_error_of_one_line_with_its_position() {
    let sandbox = Sandbox::new();
    let path = sandbox.path("bad.json");
    std::fs::write(&path, "{\"experiment\": \"hopper\",\n \"seed\": NaN}").unwrap();
    let path = path.display().to_string();
    for command in ["validate", "submit"] {
        let text = refused(&[command, &path]);
        assert!(text.starts_with(&format!("error: {path}: not JSON at line 2, column 1")), "{text}");
        assert_eq!(text.lines().count(), 1, "{text}");
    }
}

#[test]
fn all_faults_are_listed_at_once() {
    let sandbox = Sandbox::new();
    let mut bad = hopper_scenario(0.4);
    bad["product"]["count"] = json!(-3);
    bad["equipment"]["gate_openning_m"] = json!(0.06);
    bad["numerics"]["duration_s"] = json!("long");
    let file = sandbox.file("bad.json", &bad);
    let out = sandbox.path("out").display().to_string();
    for arguments in [vec!["validate", &file], vec!["run", &file, "-o", &out]] {
        let text = refused(&arguments);
        assert!(text.contains("3 faults"), "{text}");
        for part in
            ["/product/count", "-3", "/equipment/gate_openning_m", "gate_opening_m", "/numerics/duration_s"]
        {
            assert!(text.contains(part), "no `{part}` in {text}");
        }
    }
    assert!(!sandbox.path("out").exists(), "nothing is made for a scenario that cannot run");

    let output = run(&["validate", "--json", &file]);
    assert_eq!(output.status.code(), Some(2));
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(report["valid"], false);
    assert_eq!(report["errors"].as_array().unwrap().len(), 3);
}

#[test]
fn validation_limits_labels_and_names() {
    let sandbox = Sandbox::new();
    let sweep = json!({
        "name": "x".repeat(257), "base": hopper_scenario(0.4), "design": {"kind": "grid"}, "factors": [],
        "labels": {"line": "x".repeat(1_000_000)},
    });
    let text = refused(&["validate", &sandbox.file("sweep.json", &sweep)]);
    assert!(text.len() < 2000 && text.contains("2 faults"), "{} bytes: {text:.2000}", text.len());
    for part in ["/name", "/labels/line", "257 bytes", "at most 256 bytes"] {
        assert!(text.contains(part), "no `{part}` in {text}");
    }
}

#[test]
fn faults_from_the_server_are_shown() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut bad = hopper_scenario(0.4);
    bad["product"]["count"] = json!(-3);
    let file = sandbox.file("bad.json", &bad);
    let sweep = json!({"name": "bad", "base": bad, "design": {"kind": "grid"}, "factors": []});
    let sweep = sandbox.file("sweep.json", &sweep);
    for (file, pointer) in [(&file, "/product/count"), (&sweep, "/base/product/count")] {
        let output = sandbox.roost(&["submit", file]);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        assert!(String::from_utf8_lossy(&output.stderr).contains(pointer), "{}", transcript(&output));
    }
    assert!(stdout(&sandbox.roost(&["list"])).is_empty(), "nothing is stored");
    assert!(stdout(&sandbox.roost(&["list", "--jobs"])).is_empty(), "nothing is stored");

    let nobody = "01890000-0000-7000-8000-000000000000";
    let output = sandbox.roost(&["status", nobody]);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    assert!(
        String::from_utf8_lossy(&output.stderr).contains("no sweep and no job"),
        "{}",
        transcript(&output)
    );
}

#[test]
fn fault_is_shown_once_with_its_pointer_in_the_file() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut bad = hopper_scenario(0.4);
    bad["product"]["count"] = json!(-3);
    let mut typo =
        json!({"name": "s", "base": hopper_scenario(0.4), "design": {"kind": "grid"}, "factors": []});
    typo["base"]["product"]["count"] = json!(-3);
    for (document, start) in [
        (bad.clone(), "/product/count: "),
        (json!({"scenario": bad}), "/scenario/product/count: "),
        (typo, "/base/product/count: "),
        (json!([]), "the document: "),
    ] {
        let file = sandbox.file("bad.json", &document);
        let output = sandbox.roost(&["submit", &file]);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        let lines: Vec<_> = text.lines().collect();
        assert_eq!(lines.len(), 2, "{text}");
        assert_eq!(lines[0], format!("error: {file}: 1 fault"));
        assert!(lines[1].starts_with(&format!("  {start}")), "{text}");
    }
    let file = sandbox.file("bad.json", &json!([]));
    assert!(refused(&["validate", &file]).contains("\n  the document: "));
}

#[test]
fn maximum_wall_time_must_be_above_zero() {
    let sandbox = Sandbox::new();
    let file = sandbox.file("small.json", &hopper_scenario(0.2));
    for limit in ["nan", "inf", "0", "-1", "soon"] {
        let text = refused(&["submit", "--server", &sandbox.address, &file, "--max-wall-s", limit]);
        assert!(text.contains("a number of seconds above 0"), "{limit}: {text}");
    }
}

#[test]
fn unusable_address_or_data_folder_is_bad_input() {
    let (sandbox, other) = (Sandbox::new(), Sandbox::new());
    let _server = sandbox.start_server();
    let at = |sandbox: &Sandbox| sandbox.address.trim_start_matches("http://").to_owned();
    let (data, elsewhere) =
        (sandbox.path("data").display().to_string(), other.path("data").display().to_string());
    for (command, listen, data, part) in [
        ("serve", at(&sandbox), &elsewhere, "cannot listen on"),
        ("up", at(&sandbox), &elsewhere, "cannot listen on"),
        ("serve", at(&other), &data, "in use by another server"),
        ("serve", "0.0.0.0:0".to_owned(), &elsewhere, "refusing to listen"),
        ("serve", at(&other), &"/dev/null/data".to_owned(), "cannot use the data directory"),
    ] {
        let text = refused(&[command, "--listen", &listen, "--data", data]);
        assert!(text.contains(part), "{text}");
        assert_eq!(
            text.contains("hint: another server may use this port"),
            part == "cannot listen on",
            "{text}"
        );
    }
}

#[test]
fn missing_results_are_no_bad_input() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let job = sandbox.submit(&hopper_scenario(0.2));
    let output = sandbox.roost(&["results", &job.id.to_string()]);
    assert_eq!(output.status.code(), Some(1), "{}", transcript(&output));
    assert!(
        String::from_utf8_lossy(&output.stderr).starts_with("error: the job is queued: "),
        "{}",
        transcript(&output)
    );
}

#[test]
fn run_checks_that_it_can_write_before_it_simulates() {
    let sandbox = Sandbox::new();
    let (file, out) = (sandbox.file("long.json", &slow_scenario(600.0)), sandbox.path("out"));
    std::fs::create_dir_all(out.join("series.csv")).unwrap();
    std::fs::write(out.join("result.json"), "kept").unwrap();
    let text = refused(&["run", &file, "--threads", "1", "-o", &out.display().to_string()]);
    assert!(text.contains("cannot write") && text.contains("series.csv"), "{text}");
    assert_eq!(std::fs::read_to_string(out.join("result.json")).unwrap(), "kept");
    assert!(!out.join("curve.svg").exists());
}

#[test]
fn closed_pipe_is_no_failure() {
    let mut child = roost()
        .arg("validate")
        .arg("-")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    drop(child.stdout.take());
    child.stdin.take().unwrap().write_all(hopper_scenario(0.2).to_string().as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    assert!(output.status.success() && output.stderr.is_empty(), "{}", transcript(&output));
}

#[test]
fn run_without_readers_writes_its_result() {
    let sandbox = Sandbox::new();
    let (file, out) = (sandbox.file("small.json", &hopper_scenario(0.2)), sandbox.path("out"));
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
fn unreachable_server_is_an_error_with_a_hint() {
    let sandbox = Sandbox::new();
    let output = sandbox.roost(&["list"]);
    assert_eq!(output.status.code(), Some(1));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.starts_with(&format!("error: cannot reach {}", sandbox.address)), "{text}");
    assert!(text.lines().nth(1).is_some_and(|line| line.starts_with("hint: `roost up`")), "{text}");
    assert_eq!(text.lines().count(), 2, "{text}");
}

#[test]
fn invalid_id_is_refused_with_an_example() {
    let output = run(&["results", "nope"]);
    assert_eq!(output.status.code(), Some(2));
    assert!(
        transcript(&output).contains("'nope' for '<ID>': not an id, such as 0"),
        "{}",
        transcript(&output)
    );
    let text = refused(&["drain", "nobody"]);
    assert!(text.contains("not an id, such as 0") && text.contains("`roost list --workers`"), "{text}");
    let text = refused(&["serve", "--listen", "80"]);
    assert!(text.contains("an IP address and a port, such as 127.0.0.1:7373"), "{text}");
}

#[test]
fn validate_prints_the_cost() {
    let sandbox = Sandbox::new();
    let file = sandbox.file("small.json", &hopper_scenario(0.4));
    let report: Value = serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap();
    assert_eq!((&report["document"], &report["jobs"]), (&json!("scenario"), &json!(1)));
    assert!(report["estimate"]["subparticles"].as_u64().unwrap() > 20);
    let sweep = json!({
        "name": "s", "base": hopper_scenario(0.4), "design": {"kind": "grid"}, "replicates": 3,
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": [0.045, 0.06]}],
    });
    let file = sandbox.file("sweep.json", &sweep);
    let text = stdout(&run(&["validate", &file]));
    assert!(text.contains("sub-particles") && text.contains("6 jobs"), "{text}");
    let report: Value = serde_json::from_str(&stdout(&run(&["validate", "--json", &file]))).unwrap();
    let (job_s, all_s) = (report["estimate"]["wall_s"].as_f64().unwrap(), report["wall_s"].as_f64().unwrap());
    assert!((5.0..7.0).contains(&(all_s / job_s)), "points differ a little: {report:#}");
}

#[test]
fn a_study_is_forecast_without_a_server() {
    let sandbox = Sandbox::new();
    let mut study = json!({"name": "gate", "base": hopper_scenario(0.4), "budget": {"max_runs": 40},
        "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.03, "high": 0.09}],
        "goal": {"boundary": {"of": {"probability": "jammed"}, "level": 0.05}}});
    let text = stdout(&run(&["study", "validate", &sandbox.file("small.json", &study)]));
    assert!(text.contains("confidence: the best case needs 59 runs, and the budget is 40"), "{text}");
    study["budget"]["max_runs"] = json!(300);
    let file = sandbox.file("study.json", &study);
    let text = stdout(&run(&["study", "validate", &file]));
    assert!(
        text.contains("forecast: 59 to 300 runs, ") && text.contains(" on this machine, done at "),
        "{text}"
    );
    let report: Value = serde_json::from_str(&stdout(&run(&["study", "validate", "--json", &file]))).unwrap();
    assert_eq!(report["forecast"]["runs"], json!({"least": 59, "most": 300}));
    study["driver"] = json!("client");
    let text = stdout(&run(&["study", "validate", &sandbox.file("client.json", &study)]));
    assert!(text.contains("  at most 300 runs, which clients make; the base scenario:"), "{text}");
    assert!(text.contains("  forecast: 59 to 300 runs\n") && !text.contains("hours of"), "{text}");
    assert!(text.contains("no time of completion: clients choose when its runs are made"), "{text}");
    assert!(
        refused(&["study", "validate", &sandbox.file("scenario.json", &hopper_scenario(0.4))])
            .contains("is no study")
    );
}

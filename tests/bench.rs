//! `roost bench`: all paths on all beds, beds written and read, and errors.

mod support;

use std::path::PathBuf;
use std::process::{Command, Stdio};

use serde_json::{Value, json};
use support::{Sandbox, roost, run, stdout, transcript, wait_until};

/// A scenario of coarse sub-particles in large steps.
fn coarse_scenario_file(sandbox: &Sandbox) -> String {
    sandbox.file(
        "coarse.json",
        &json!({"experiment": "hopper", "product": {"subparticle_radius_m": 0.009}, "numerics": {"timestep_s": "auto"}}),
    )
}

fn bench_arguments(arguments: &[&str]) -> Vec<String> {
    let steps: &[&str] = if arguments.contains(&"--steps") { &[] } else { &["--steps", "10"] };
    [&["bench", "solver", "--threads", "1", "--repeats", "2"], steps, arguments]
        .concat()
        .iter()
        .map(|text| (*text).to_owned())
        .collect()
}

fn rows(arguments: &[&str]) -> Vec<Value> {
    let all = bench_arguments(arguments);
    let all: Vec<&str> = all.iter().map(String::as_str).chain(["--json"]).collect();
    serde_json::from_str(&stdout(&run(&all))).expect("rows")
}

#[test]
fn every_path_is_timed_on_every_bed() {
    let sandbox = Sandbox::new();
    let scenario = coarse_scenario_file(&sandbox);
    // With this many steps, a pause of the machine changes the shares of stages little.
    let steps = ["--steps", "200"];
    let bed = ["--subparticles", "1000", "--paths", "plain,fast", "--scenario", &scenario];
    let measure = || rows(&[&steps[..], &bed].concat());
    let rows = measure();
    let beds: Vec<&str> = rows.iter().filter_map(|row| row["bed"].as_str()).collect();
    assert_eq!(beds, ["loose", "loose", "bonded", "bonded", "hopper", "hopper"]);
    for row in &rows {
        assert_eq!((&row["backend"], &row["threads"]), (&json!("cpu"), &json!(1)));
        let ns = row["ns_per_particle_step"].as_f64().expect("a number");
        assert!(
            (1.0..1e6).contains(&ns) && row["spread"].as_f64().is_some_and(|spread| spread >= 0.0),
            "{row}"
        );
        let shares: f64 =
            row["stages"].as_object().expect("an object").values().filter_map(Value::as_f64).sum();
        assert!((shares - 1.0).abs() < 1e-9, "{row}");
        let subparticles = row["subparticles"].as_f64().expect("a number");
        assert!((subparticles / 1000.0 - 1.0).abs() < 0.2, "{row}");
        // The timed run reuses memory that the settling has freed.
        assert_eq!(row["bytes_per_subparticle"], json!(null), "{row}");
    }
    // Only fillets spend time on bonds.
    let share = |rows: &[Value], row: usize| rows[row]["stages"]["bonds"].as_f64().expect("a share");
    let is_seen = |rows: &[Value]| share(rows, 3) > 0.02 && share(rows, 3) > 3.0 * share(rows, 1);
    // A pause of the machine in another stage hides them: measure again.
    assert!(is_seen(&rows) || (0..3).any(|_| is_seen(&measure())), "{rows:?}");
    assert_eq!((&rows[0]["path"], rows[1]["path"] == rows[0]["path"]), (&json!("plain"), false));
}

#[test]
fn written_bed_can_be_read_and_timed() {
    let sandbox = Sandbox::new();
    let (scenario, folder) = (coarse_scenario_file(&sandbox), sandbox.path("beds").display().to_string());
    let write = ["--beds", "bonded", "--subparticles", "1000", "--scenario", &scenario, "--write", &folder];
    let written = bench_arguments(&write);
    stdout(&run(&written.iter().map(String::as_str).collect::<Vec<_>>()));
    let (bed, bonds) = (format!("{folder}/bonded.csv"), format!("{folder}/bonded_bonds.csv"));
    let count = std::fs::read_to_string(&bed).unwrap().lines().count();
    let own = rows(&["--bed", &bed, "--bonds", &bonds, "--scenario", &scenario]);
    assert_eq!((own.len(), &own[0]["bed"], &own[0]["subparticles"]), (1, &json!("bonded"), &json!(count)));
    assert_eq!(own[0]["contact_between_bonded"], true);
    // For such a small bed the number depends on the size of pages.
    assert!(own[0]["bytes_per_subparticle"].is_number(), "{}", own[0]);
    let off = rows(&[
        "--bed",
        &bed,
        "--bonds",
        &bonds,
        "--scenario",
        &scenario,
        "--without-contact-between-bonded",
    ]);
    assert_eq!(off[0]["contact_between_bonded"], false);
}

#[test]
fn broken_bonds_stay_broken_in_a_written_bed() {
    let sandbox = Sandbox::new();
    let count = |strength: Value| {
        let document = json!({
            "experiment": "hopper",
            "product": {"subparticle_radius_m": 0.009},
            "bonds": {"normal_strength_pa": strength},
            "numerics": {"timestep_s": "auto"},
        });
        let scenario = sandbox.file("strength.json", &document);
        let folder = sandbox.path("broken").display().to_string();
        let write =
            ["--beds", "bonded", "--subparticles", "1000", "--scenario", &scenario, "--write", &folder];
        stdout(&run(&bench_arguments(&write).iter().map(String::as_str).collect::<Vec<_>>()));
        std::fs::read_to_string(format!("{folder}/bonded_bonds.csv")).unwrap().lines().count()
    };
    let (weak, whole) = (count(json!(2e3)), count(json!(null)));
    assert!(weak < whole - 20, "{weak} of {whole} hold");
}

#[test]
fn faulty_beds_are_refused() {
    let sandbox = Sandbox::new();
    let bed = sandbox.path("bed.csv");
    std::fs::write(&bed, "1 0 0 0.1\n2 0.008 0 0.1\n").unwrap();
    let bed = bed.display().to_string();
    let bonds = sandbox.path("bonds.csv");
    for (text, complaint) in [
        ("1 3\n", "bond 1 3: must join two of the sub-particles 1 to 2"),
        ("1 1\n", "bond 1 1: must join two"),
        ("1 1.5\n", "bond 1 1.5: must join two"),
        ("1 2 x\n", "line 1: must be 2 numbers, found \"1 2 x\""),
        ("1 2\n1 x\n", "line 2: must be 2 numbers, found \"1 x\""),
    ] {
        std::fs::write(&bonds, text).unwrap();
        let output = run(&bench_arguments(&["--bed", &bed, "--bonds", &bonds.display().to_string()])
            .iter()
            .map(String::as_str)
            .collect::<Vec<_>>());
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        assert!(transcript(&output).contains(complaint), "{}", transcript(&output));
    }
    let diagonals = sandbox.file("diagonals.json", &json!({"experiment": "hopper", "bonds": {"types": 1}}));
    let folder = sandbox.path("beds").display().to_string();
    let output = run(&["bench", "solver", "--scenario", &diagonals, "--write", &folder]);
    assert!(
        output.status.code() == Some(2) && transcript(&output).contains("/bonds/types is 1; must be 2"),
        "{}",
        transcript(&output)
    );
    let output = run(&["bench", "solver", "--paths", "mmx"]);
    assert!(
        output.status.code() == Some(2) && transcript(&output).contains("must be among plain, fast"),
        "{}",
        transcript(&output)
    );
}

#[test]
fn stopped_bench_removes_its_server_and_its_folder() {
    let sandbox = Sandbox::new();
    let temporary = sandbox.path("temporary");
    std::fs::create_dir_all(&temporary).unwrap();
    let mut bench = roost()
        .args(["bench", "farm", "--only", "claim and result", "--seconds", "600"])
        .env("TMPDIR", &temporary)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    let folders = || -> Vec<PathBuf> {
        std::fs::read_dir(&temporary).unwrap().map(|entry| entry.unwrap().path()).collect()
    };
    let servers = || {
        let here = temporary.display().to_string();
        let lines = std::fs::read_dir("/proc").unwrap().filter_map(|entry| {
            let line = std::fs::read(entry.ok()?.path().join("cmdline")).ok()?;
            Some(String::from_utf8_lossy(&line).into_owned())
        });
        lines.filter(|line| line.contains(&here)).count()
    };
    wait_until("its server has made a database", || {
        folders().iter().any(|folder| folder.join("roost.db").exists()).then_some(())
    });
    assert_eq!(servers(), 1);
    let told = Command::new("kill").args(["-TERM", &bench.id().to_string()]).status().unwrap();
    assert!(told.success());
    assert_eq!(bench.wait().unwrap().code(), Some(1));
    assert_eq!(folders(), Vec::<PathBuf>::new());
    wait_until("its server is gone", || (servers() == 0).then_some(()));
}

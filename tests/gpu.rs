//! The GPU backend in the command, on Mesa's software adapter: it is used when it is asked for and never taken for a GPU.
#![cfg(feature = "gpu")]

mod support;

use serde_json::{Value, json};
use support::{Home, run, said, scenario, stdout};

/// The software adapter, by name: machines with a GPU have it too.
const SOFTWARE: [&str; 3] = ["--device", "llvmpipe", "--allow-software"];

fn is_left_out() -> bool {
    let is_left_out = std::env::var_os("ROOST_SKIP_GPU").is_some();
    if is_left_out {
        eprintln!("left out: ROOST_SKIP_GPU is set");
    }
    is_left_out
}

fn small(home: &Home) -> String {
    home.file(
        "small.json",
        &json!({
            "experiment": "hopper",
            "product": {"count": 2, "subparticle_radius_m": 0.009},
            "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
            "numerics": {"timestep_s": "auto", "duration_s": 0.1},
        }),
    )
}

#[test]
fn a_run_takes_the_adapter_that_is_asked_for_and_no_software_unasked() {
    if is_left_out() {
        return;
    }
    let home = Home::new();
    let (scenario, folder) = (small(&home), home.path("out").display().to_string());
    let with = |more: &[&str]| {
        let arguments = [&["run", &scenario, "--output", &folder, "--json"], more].concat();
        run(&arguments)
    };
    let summary: Value =
        serde_json::from_str(&stdout(&with(&[&["--backend", "gpu"][..], &SOFTWARE].concat())))
            .expect("a summary");
    assert_eq!(summary["solver"]["backend"], "gpu");
    assert!(summary["solver"]["device"].as_str().expect("a name").contains("llvmpipe"), "{summary}");
    assert_eq!(summary["end_reason"], "duration");

    let refused = with(&["--backend", "gpu", "--device", "llvmpipe"]);
    assert_eq!(refused.status.code(), Some(2));
    assert!(said(&refused).contains("none of the adapters will do: llvmpipe"), "{}", said(&refused));
    let mut large = support::scenario(0.1);
    large["product"]["count"] = json!(60);
    large["equipment"]["hopper_width_m"] = json!(1.5);
    let large = home.file("large.json", &large);
    let least =
        [&["run", &large, "-o", &folder, "--backend", "gpu", "--gpu-memory", "1"][..], &SOFTWARE].concat();
    let refused = run(&least);
    assert_eq!(refused.status.code(), Some(1), "{}", said(&refused));
    assert!(said(&refused).contains("no room on the device: "), "{}", said(&refused));
    let refused = with(&["--backend", "cpu", "--gpu-memory", "100"]);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    let refused = with(&["--backend", "cpu", "--allow-software"]);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    let summary: Value = serde_json::from_str(&stdout(&with(&["--backend", "cpu"]))).expect("a summary");
    assert_eq!(summary["solver"]["backend"], "cpu");
}

#[test]
fn each_result_of_a_worker_of_four_slots_is_as_alone() {
    if is_left_out() {
        return;
    }
    let home = Home::new();
    let _server = home.serve();
    // Of its slots no more are taken at a time than there is memory for.
    let few = ["--backend", "gpu", "--slots", "4", "--gpu-memory", "3"];
    let _worker = home.work_told("worker", &[&few[..], &SOFTWARE].concat());
    let openings = [0.03, 0.04, 0.05, 0.06];
    let sweep = json!({
        "name": "small", "base": scenario(0.1), "design": {"kind": "grid"},
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": openings}],
    });
    let view = stdout(&home.roost(&["submit", "--wait", "--json", &home.file("sweep.json", &sweep)]));
    let view: Value = serde_json::from_str(&view).expect("a sweep");
    assert_eq!(view["counts"]["succeeded"], 4, "{view}");
    let workers = home.ask(|client| async move { client.workers(None, 100).await }).expect("workers");
    assert_eq!((workers.items[0].backend.as_str(), workers.items[0].memory_mib), ("gpu", Some(3)));
    let id = view["id"].as_str().expect("an id");
    let table = stdout(&home.roost(&["results", id, "--format", "json"]));
    let table: Value = serde_json::from_str(&table).expect("a table");
    for (trial, opening) in table["trials"].as_array().expect("trials").iter().zip(openings) {
        let mut alone = scenario(0.1);
        alone["equipment"]["gate_opening_m"] = json!(opening);
        let (file, folder) = (home.file("alone.json", &alone), home.path("alone").display().to_string());
        let seed = trial["seed"].to_string();
        let run = ["run", &file, "--seed", &seed, "-o", &folder, "--json", "--backend", "gpu"];
        let summary: Value =
            serde_json::from_str(&stdout(&home.roost(&[&run[..], &SOFTWARE].concat()))).expect("a summary");
        assert_eq!(trial["responses"], summary["responses"], "{opening}");
    }
}

#[test]
fn the_bench_times_batches_and_calls_software_by_its_name() {
    if is_left_out() {
        return;
    }
    let home = Home::new();
    let scenario = small(&home);
    let bench = |more: &[&str]| {
        let own =
            ["bench", "solver", "--paths", "gpu", "--beds", "bonded", "--subparticles", "1000", "--json"];
        let few = ["--scenario", &scenario, "--steps", "20", "--repeats", "1", "--batches", "1,3"];
        run(&[&own[..], &few, more].concat())
    };
    let rows: Vec<Value> = serde_json::from_str(&stdout(&bench(&SOFTWARE))).expect("rows");
    assert_eq!(rows.len(), 2);
    for (row, batch) in rows.iter().zip([1.0, 3.0]) {
        assert_eq!((&row["backend"], &row["path"]), (&json!("software"), &json!("software")), "{row}");
        let number = |name: &str| row[name].as_f64().unwrap_or_else(|| panic!("{name} in {row}"));
        assert_eq!(number("batch"), batch);
        let ns = number("us_per_step") * 1e3 / batch / number("subparticles");
        assert!((ns / number("ns_per_particle_step") - 1.0).abs() < 1e-9, "{row}");
        assert!(number("bytes_copied_meanwhile") > 1.0, "{row}");
    }
    let refused = bench(&["--device", "llvmpipe"]);
    assert_eq!(refused.status.code(), Some(2));
}

#[test]
fn an_adapter_is_held_against_the_plain_path() {
    if is_left_out() {
        return;
    }
    let own = ["bench", "parity", "--subparticles", "1000", "--steps", "100"];
    let parity: Value =
        serde_json::from_str(&stdout(&run(&[&own[..], &SOFTWARE].concat()))).expect("a verdict");
    assert_eq!((&parity["same_bits_until_step"], &parity["farthest_apart_m"]), (&json!(100), &json!(0.0)));
    assert_eq!((&parity["is_software"], &parity["is_within_tolerance"]), (&json!(true), &json!(true)));
}

/// The script that measures on a machine with a GPU, made small.
fn measure(home: &Home, more: &[&str]) -> std::process::Output {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/solver/benches/gpu/measure.sh");
    let scenario = small(home);
    let few = [("SCENARIO", scenario.as_str()), ("SUBPARTICLES", "1000"), ("STEPS", "20")];
    let mut command = std::process::Command::new("sh");
    command.args([script, env!("CARGO_BIN_EXE_roost")]).arg(home.path("figures")).args(more);
    command.envs(few).envs([("REPEATS", "1"), ("BATCHES", "1,3")]).output().expect("a shell")
}

#[test]
fn the_script_says_what_is_asked_of_a_gpu() {
    if is_left_out() {
        return;
    }
    let home = Home::new();
    let done = measure(&home, &SOFTWARE);
    assert!(done.status.success(), "{}", said(&done));
    let figures = std::fs::read_to_string(home.path("figures/figures.txt")).expect("figures");
    let lines: Vec<&str> = figures.lines().collect();
    assert_eq!(lines.len(), 7, "{figures}");
    assert!(
        lines[0].contains("llvmpipe") && lines[1].starts_with("within tolerance of the plain path: true")
    );
    for (line, start) in lines[2..].iter().zip([
        "from fill to end: ",
        "software bonded in a batch of 1: ",
        "software bonded in a batch of 3: ",
        "software hopper in a batch of 1: ",
        "software hopper in a batch of 3: ",
    ]) {
        assert!(line.starts_with(start), "{line}");
        let line = line.replace("174,000", "174000");
        let numbers = line.split([' ', ';', ',']).filter_map(|word| word.parse::<f64>().ok());
        let numbers: Vec<f64> = numbers.collect();
        assert!(numbers.len() >= 4 && numbers.iter().all(|number| *number > 0.0), "{line}");
    }
}

#[test]
fn the_script_stops_at_once_where_there_is_no_gpu() {
    if is_left_out() {
        return;
    }
    let home = Home::new();
    let done = measure(&home, &["--device", "no such adapter"]);
    assert_eq!(done.status.code(), Some(2), "{}", said(&done));
    assert!(
        said(&done).contains("no GPU: ") && said(&done).contains("nothing was measured"),
        "{}",
        said(&done)
    );
    assert!(!home.path("figures/bench.json").exists());
}

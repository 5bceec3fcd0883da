//! The GPU backend in commands, on Mesa's software adapter, which is used only on request and never reported as a GPU.
#![cfg(feature = "gpu")]

mod support;

use serde_json::{Value, json};
use support::{Sandbox, hopper_scenario, run, stdout, transcript};

/// Selects the software adapter by name, for machines with a GPU.
const SOFTWARE: [&str; 3] = ["--device", "llvmpipe", "--allow-software"];

fn is_left_out() -> bool {
    let is_left_out = std::env::var_os("ROOST_SKIP_GPU").is_some();
    if is_left_out {
        eprintln!("left out: ROOST_SKIP_GPU is set");
    }
    is_left_out
}

fn small(sandbox: &Sandbox) -> String {
    sandbox.file(
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
fn run_uses_the_requested_adapter_and_software_only_on_request() {
    if is_left_out() {
        return;
    }
    let sandbox = Sandbox::new();
    let (scenario, folder) = (small(&sandbox), sandbox.path("out").display().to_string());
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
    assert!(
        transcript(&refused).contains("none of the adapters will do: llvmpipe"),
        "{}",
        transcript(&refused)
    );
    let mut large = support::hopper_scenario(0.1);
    large["product"]["count"] = json!(60);
    large["equipment"]["hopper_width_m"] = json!(1.5);
    let large = sandbox.file("large.json", &large);
    let least =
        [&["run", &large, "-o", &folder, "--backend", "gpu", "--gpu-memory", "1"][..], &SOFTWARE].concat();
    let refused = run(&least);
    assert_eq!(refused.status.code(), Some(1), "{}", transcript(&refused));
    assert!(transcript(&refused).contains("no room on the device: "), "{}", transcript(&refused));
    let refused = with(&["--backend", "cpu", "--gpu-memory", "100"]);
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    let refused = with(&["--backend", "cpu", "--allow-software"]);
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    let summary: Value = serde_json::from_str(&stdout(&with(&["--backend", "cpu"]))).expect("a summary");
    assert_eq!(summary["solver"]["backend"], "cpu");
}

#[test]
fn results_of_a_batch_of_four_equal_single_runs() {
    if is_left_out() {
        return;
    }
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    // The worker uses only as many slots as its memory allows.
    let few = ["--backend", "gpu", "--slots", "4", "--gpu-memory", "3"];
    let _worker = sandbox.start_worker_with("worker", &[&few[..], &SOFTWARE].concat());
    let openings = [0.03, 0.04, 0.05, 0.06];
    let sweep = json!({
        "name": "small", "base": hopper_scenario(0.1), "design": {"kind": "grid"},
        "factors": [{"pointer": "/equipment/gate_opening_m", "levels": openings}],
    });
    let view = stdout(&sandbox.roost(&["submit", "--wait", "--json", &sandbox.file("sweep.json", &sweep)]));
    let view: Value = serde_json::from_str(&view).expect("a sweep");
    assert_eq!(view["counts"]["succeeded"], 4, "{view}");
    let workers = sandbox.ask(|client| async move { client.workers(None, 100).await }).expect("workers");
    assert_eq!((workers.items[0].backend.as_str(), workers.items[0].memory_mib), ("gpu", Some(3)));
    let id = view["id"].as_str().expect("an id");
    let table = stdout(&sandbox.roost(&["results", id, "--format", "json"]));
    let table: Value = serde_json::from_str(&table).expect("a table");
    for (trial, opening) in table["trials"].as_array().expect("trials").iter().zip(openings) {
        let mut alone = hopper_scenario(0.1);
        alone["equipment"]["gate_opening_m"] = json!(opening);
        let (file, folder) =
            (sandbox.file("alone.json", &alone), sandbox.path("alone").display().to_string());
        let seed = trial["seed"].to_string();
        let run = ["run", &file, "--seed", &seed, "-o", &folder, "--json", "--backend", "gpu"];
        let summary: Value = serde_json::from_str(&stdout(&sandbox.roost(&[&run[..], &SOFTWARE].concat())))
            .expect("a summary");
        assert_eq!(trial["responses"], summary["responses"], "{opening}");
    }
}

#[test]
fn bench_times_batches_and_marks_software_adapters() {
    if is_left_out() {
        return;
    }
    let sandbox = Sandbox::new();
    let scenario = small(&sandbox);
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
fn adapter_is_compared_with_the_plain_path() {
    if is_left_out() {
        return;
    }
    let own = ["bench", "parity", "--subparticles", "1000", "--steps", "100"];
    let parity: Value =
        serde_json::from_str(&stdout(&run(&[&own[..], &SOFTWARE].concat()))).expect("a verdict");
    assert_eq!((&parity["same_bits_until_step"], &parity["farthest_apart_m"]), (&json!(100), &json!(0.0)));
    assert_eq!((&parity["is_software"], &parity["is_within_tolerance"]), (&json!(true), &json!(true)));
}

/// The measurement script for machines with a GPU, with small sizes.
fn measure(sandbox: &Sandbox, more: &[&str]) -> std::process::Output {
    let script = concat!(env!("CARGO_MANIFEST_DIR"), "/solver/benches/gpu/measure.sh");
    let scenario = small(sandbox);
    let few = [("SCENARIO", scenario.as_str()), ("SUBPARTICLES", "1000"), ("STEPS", "20")];
    let mut command = std::process::Command::new("sh");
    command.args([script, env!("CARGO_BIN_EXE_roost")]).arg(sandbox.path("figures")).args(more);
    command.envs(few).envs([("REPEATS", "1"), ("BATCHES", "1,3")]).output().expect("a shell")
}

#[test]
fn script_lists_the_requirements_of_a_gpu() {
    if is_left_out() {
        return;
    }
    let sandbox = Sandbox::new();
    let done = measure(&sandbox, &SOFTWARE);
    assert!(done.status.success(), "{}", transcript(&done));
    let figures = std::fs::read_to_string(sandbox.path("figures/figures.txt")).expect("figures");
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
fn script_stops_without_a_gpu() {
    if is_left_out() {
        return;
    }
    let sandbox = Sandbox::new();
    let done = measure(&sandbox, &["--device", "no such adapter"]);
    assert_eq!(done.status.code(), Some(2), "{}", transcript(&done));
    assert!(
        transcript(&done).contains("no GPU: ") && transcript(&done).contains("nothing was measured"),
        "{}",
        transcript(&done)
    );
    assert!(!sandbox.path("figures/bench.json").exists());
}

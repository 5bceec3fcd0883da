//! `roost run --frames`: the files of complete, killed, unstable and repeated runs.

mod support;
#[path = "support/vtk.rs"]
mod vtk;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::path::Path;
use std::process::Stdio;

use roost_frames::web::{Frame, Reader};
use roost_solver::engine::scene::Scene;
use serde_json::{Value, json};
use support::{Sandbox, hopper_scenario, roost, run, signal, slow_scenario, transcript, wait_until};
use vtk::PolyData;

/// Three fillets that leave the belt within a second.
fn fast_scenario() -> Value {
    let mut swift = hopper_scenario(1.2);
    swift["product"]["count"] = json!(3);
    swift["equipment"]["belt_speed_m_s"] = json!(1.5);
    swift
}

/// Runs a scenario with frames. Returns the folder, the summary and the messages.
fn record(
    sandbox: &Sandbox,
    scenario: &Value,
    name: &str,
    more: &[&str],
) -> (std::path::PathBuf, Value, String) {
    let (file, folder) = (sandbox.file(&format!("{name}.json"), scenario), sandbox.path(name));
    let (out, frames) =
        (sandbox.path(&format!("{name}-out")).display().to_string(), folder.display().to_string());
    let output = run(&[&["run", &file, "-o", &out, "--frames", &frames, "--json"], more].concat());
    let summary =
        serde_json::from_slice(&output.stdout).unwrap_or_else(|_| panic!("{}", transcript(&output)));
    (folder, summary, String::from_utf8(output.stderr).unwrap())
}

fn stream(folder: &Path) -> Reader<File> {
    Reader::open(File::open(folder.join("run.roostframes")).unwrap()).unwrap()
}

fn frames(reader: &mut Reader<File>) -> Vec<Frame> {
    (0..reader.index().len()).map(|k| reader.frame(k).unwrap()).collect()
}

/// Entries of a collection: time, and files of particles and surfaces.
fn collection(folder: &Path) -> Vec<(f64, [String; 2])> {
    let text = fs::read_to_string(folder.join("frames.pvd")).unwrap();
    let value = |line: &str, name: &str| {
        let rest = line.split_once(&format!("{name}=\"")).unwrap().1;
        rest.split('"').next().unwrap().to_owned()
    };
    let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("<DataSet")).collect();
    let pairs = lines.chunks_exact(2);
    pairs
        .map(|pair| {
            (value(pair[0], "timestep").parse().unwrap(), [pair[0], pair[1]].map(|l| value(l, "file")))
        })
        .collect()
}

fn piece(path: &Path) -> PolyData {
    vtk::read(&fs::read(path).unwrap())
}

/// Every file below a folder, by name.
fn all_files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap().to_owned();
        if path.is_dir() {
            files.extend(
                all_files(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)),
            );
        } else {
            files.insert(name, fs::read(path).unwrap());
        }
    }
    files
}

fn scene_of(scenario: &Value) -> Scene {
    let scenario = roost_solver::scenario::from_value(scenario).unwrap();
    let checked = roost_solver::check(&scenario, &Default::default(), &roost_solver::Limits::NONE).unwrap();
    checked.setup().scene().clone()
}

#[test]
fn both_formats_agree_with_the_result() {
    let sandbox = Sandbox::new();
    let (folder, summary, messages) = record(&sandbox, &fast_scenario(), "both", &["--threads", "1"]);
    assert!(messages.contains("frames: one every 0.06 s (3 samples of 0.02 s)"), "{messages}");
    let result: Value =
        serde_json::from_slice(&fs::read(sandbox.path("both-out/result.json")).unwrap()).unwrap();
    let mut reader = stream(&folder);
    assert!(reader.is_complete());
    assert_eq!(json!(reader.header().scenario_digest), result["scenario_digest"]);
    let frames = frames(&mut reader);
    assert_eq!(summary["frames"]["frames"], json!(frames.len()));

    // Both formats have the same times and positions. The belt start is one of the times, and later ones follow in whole intervals.
    let listed = collection(&folder);
    let start = reader.start_s().unwrap();
    assert_eq!(listed.len(), frames.len());
    for ((time_s, [particles, surfaces]), frame) in listed.iter().zip(&frames) {
        assert!((time_s - (frame.simulated_s - start)).abs() < 1e-9);
        let piece = piece(&folder.join(particles));
        let points = &piece.points;
        assert_eq!(points.len(), 3 * frame.positions.len());
        let apart = points.iter().zip(frame.positions.iter().flat_map(|x| x.to_array()));
        let most = frame.error_m.max_element() + 1e-6;
        assert!(apart.into_iter().all(|(a, b)| (a - b).abs() < most), "{time_s}");
        assert!(!vtk::read(&fs::read(folder.join(surfaces)).unwrap()).polygons.is_empty());
    }
    let started: Vec<f64> =
        listed.iter().map(|(time_s, _)| *time_s).filter(|&time_s| time_s >= 0.0).collect();
    let expected: Vec<f64> = (0..started.len()).map(|k| 0.06 * k as f64).collect();
    let dt = result["solver"]["timestep_s"].as_f64().unwrap();
    assert!(started.len() > 15 && listed[0].0 < -0.5, "{started:?}");
    assert!(started.iter().zip(expected).all(|(a, b)| (a - b).abs() <= dt), "{started:?}");

    // Fillets behind the gate in the frames have the discharged mass of the result.
    let scene = scene_of(&fast_scenario());
    let mass = |body: usize| scene.kinds[scene.bodies[body].kind].subparticle_mass_kg;
    let loaded: f64 =
        (0..3).map(|body| mass(body) * scene.kinds[scene.bodies[body].kind].meta.points.len() as f64).sum();
    let series =
        result["series"].as_array().unwrap().iter().find(|s| s["name"] == "discharged_mass").unwrap();
    let discharged = |time_s: f64| {
        let times: Vec<f64> = serde_json::from_value(series["t_s"].clone()).unwrap();
        let k = times.iter().position(|t| (t - time_s).abs() < 1e-6).unwrap();
        series["values"][k].as_f64().unwrap()
    };
    let mut partly = 0;
    for (time_s, [particles, _]) in listed.iter().filter(|(time_s, _)| *time_s >= 0.0) {
        let piece = piece(&folder.join(particles));
        let x = piece.points.chunks_exact(3).map(|point| point[0]);
        let bodies = PolyData::numbers(&piece.of_points, "body");
        let inside: f64 = x.zip(bodies).filter(|(x, _)| *x <= 0.0).map(|(_, b)| mass(*b as usize)).sum();
        assert!((loaded - inside - discharged(*time_s)).abs() < 1e-6, "{time_s}: {inside}");
        partly += u32::from(inside > 0.0 && inside < loaded);
    }
    assert!(partly > 2, "frames in the midst of the discharge");

    // Fillets that have left are in no later frame; the last frame has none.
    let counts: Vec<usize> = frames.iter().map(|frame| frame.bodies.len()).collect();
    assert!(counts.is_sorted_by(|a, b| a >= b) && counts[0] == 3, "{counts:?}");
    assert_eq!(counts.last(), Some(&0), "{counts:?}");
}

#[test]
fn first_frame_without_a_filling_phase_is_at_belt_time_0() {
    let sandbox = Sandbox::new();
    let drop = json!({"experiment": "drop", "product": {"count": 1, "subparticle_radius_m": 0.009},
                      "numerics": {"timestep_s": "auto", "duration_s": 0.1}});
    let (folder, ..) = record(&sandbox, &drop, "drop", &["--threads", "1"]);
    let times: Vec<Option<f64>> =
        frames(&mut stream(&folder)).iter().map(|frame| frame.belt_time_s).collect();
    assert_eq!(times[0], Some(0.0), "{times:?}");
    assert!(times.windows(2).all(|pair| pair[0] < pair[1]), "{times:?}");
}

#[test]
fn same_scenario_gives_the_same_bytes() {
    let sandbox = Sandbox::new();
    let once = all_files(&record(&sandbox, &fast_scenario(), "once", &["--threads", "1"]).0);
    let again = all_files(&record(&sandbox, &fast_scenario(), "again", &["--threads", "2"]).0);
    assert!(once.len() > 30, "{:?}", once.keys());
    let names = once.keys().chain(again.keys());
    let differing: Vec<&String> = names.filter(|name| once.get(*name) != again.get(*name)).collect();
    assert!(differing.is_empty(), "{differing:?}");
}

#[test]
fn killed_run_leaves_all_complete_frames() {
    let sandbox = Sandbox::new();
    let (file, folder) = (sandbox.file("long.json", &slow_scenario(600.0)), sandbox.path("frames"));
    let mut child = roost()
        .args(["run", &file, "--threads", "1", "--frame-interval", "0.02", "-o"])
        .arg(sandbox.path("out"))
        .arg("--frames")
        .arg(&folder)
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    wait_until("there are frames", || folder.join("vtk/particles_000005.vtp").exists().then_some(()));
    child.kill().unwrap();
    child.wait().unwrap();

    let mut reader = stream(&folder);
    assert!(!reader.is_complete());
    let frames = frames(&mut reader);
    assert!(frames.len() >= 5 && frames.iter().all(|frame| frame.bodies.len() == 2), "{}", frames.len());
    let listed = collection(&folder);
    assert!(listed.len() >= 5 && listed.last().unwrap().0 == 0.0, "no belt has started: times end at 0");
    for path in listed.iter().flat_map(|(_, files)| files) {
        assert!(!piece(&folder.join(path)).points.is_empty());
    }
}

#[test]
fn unstable_run_keeps_its_frames() {
    let sandbox = Sandbox::new();
    let mut diverging = hopper_scenario(0.4);
    diverging["numerics"]["timestep_s"] = json!(0.02);
    diverging["numerics"]["allow_unstable"] = json!(true);
    let (folder, summary, _) = record(&sandbox, &diverging, "unstable", &["--frame-format", "web"]);
    assert_eq!(summary["end_reason"], "unstable");
    let mut reader = stream(&folder);
    assert!(reader.is_complete() && !reader.index().is_empty());
    assert_eq!(frames(&mut reader)[0].bodies.len(), 2);
    assert!(!folder.join("frames.pvd").exists(), "only the requested files");
}

#[test]
fn forecast_above_the_limit_is_refused_with_its_numbers() {
    let sandbox = Sandbox::new();
    let mut bulk = hopper_scenario(4.0);
    bulk["product"] = json!({"count": 40, "subparticle_radius_m": 0.004});
    bulk["equipment"] = json!({});
    let (file, out) = (sandbox.file("bulk.json", &bulk), sandbox.path("out").display().to_string());
    let frames = sandbox.path("frames");
    let folder = frames.display().to_string();
    let common = ["run", &file, "-o", &out, "--frames", &folder, "--frame-limit-mb", "3"];
    let output = run(&common);
    assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    let text = String::from_utf8(output.stderr).unwrap();
    assert!(text.contains("more than --frame-limit-mb 3") && text.contains("--frame-format web"), "{text}");
    assert!(!frames.exists(), "refused before anything is made");
}

#[test]
fn options_out_of_range_are_refused() {
    let sandbox = Sandbox::new();
    let (file, out) =
        (sandbox.file("small.json", &hopper_scenario(0.2)), sandbox.path("out").display().to_string());
    let (frames, blocked) = (sandbox.path("frames").display().to_string(), sandbox.file("a-file", &json!(1)));
    let cases: [(&[&str], &str); 5] = [
        (&["--frames", &frames, "--frame-interval", "-1"], "above 0"),
        (&["--frames", &frames, "--frame-interval", "NaN"], "above 0"),
        (&["--frames", &frames, "--frame-limit-mb", "0"], "1..=1000000000"),
        (&["--frame-interval", "0.1"], "--frames"),
        (&["--frames", &blocked], "cannot write frames"),
    ];
    for (options, expected) in cases {
        let output = run(&[&["run", &file, "-o", &out], options].concat());
        assert_eq!(output.status.code(), Some(2), "{options:?} {}", transcript(&output));
        let text = String::from_utf8(output.stderr).unwrap();
        assert!(text.contains(expected), "{options:?} {text}");
    }
}

#[test]
fn run_continues_with_a_warning_if_frames_cannot_be_written() {
    let sandbox = Sandbox::new();
    let (file, folder, out) =
        (sandbox.file("long.json", &slow_scenario(600.0)), sandbox.path("frames"), sandbox.path("out"));
    let log = sandbox.path("stderr.log");
    let child = roost()
        .args(["run", &file, "--threads", "1", "--json", "-o"])
        .arg(&out)
        .arg("--frames")
        .arg(&folder)
        .stdout(Stdio::piped())
        .stderr(File::create(&log).unwrap())
        .spawn()
        .unwrap();
    wait_until("there are frames", || folder.join("vtk/particles_000002.vtp").exists().then_some(()));
    // A file that is written meanwhile keeps the folder.
    wait_until("the folder is removed", || fs::remove_dir_all(folder.join("vtk")).is_ok().then_some(()));
    let told = || fs::read_to_string(&log).unwrap();
    wait_until("the frames have ended", || told().contains("continues without frames").then_some(()));
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    let text = told();
    assert!(text.contains("warning: frames end at"), "{text}");
    let summary: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(summary["end_reason"], "cancelled", "it was still running");
    assert!(summary["frames"]["stopped"].is_string());
    assert!(stream(&folder).is_complete());
}

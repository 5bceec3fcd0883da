//! `roost reproduce`: its report, and that finished runs are not repeated.

mod support;

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant, SystemTime};

use serde_json::{Value, json};
use support::{Sandbox, roost, run, signal, stdout, transcript};

/// Runs parts of the smallest profile. Returns stdout.
fn reproduce(folder: &Path, parts: &[&str]) -> String {
    let folder = folder.display().to_string();
    let arguments = ["reproduce", "--profile", "tiny", "--threads", "2", "-o", &folder];
    stdout(&run(&[&arguments, parts].concat()))
}

fn report(folder: &Path) -> Value {
    serde_json::from_slice(&fs::read(folder.join("report.json")).unwrap()).unwrap()
}

fn rows(report: &Value) -> &Vec<Value> {
    report["rows"].as_array().unwrap()
}

/// Name and modification time of each record.
fn records(folder: &Path) -> BTreeMap<String, SystemTime> {
    let entries = fs::read_dir(folder.join("runs")).into_iter().flatten().flatten();
    let whole = entries.filter(|entry| entry.path().extension().is_some_and(|extension| extension == "json"));
    whole
        .map(|entry| {
            (entry.file_name().into_string().unwrap(), entry.metadata().unwrap().modified().unwrap())
        })
        .collect()
}

fn bytes(folder: &Path) -> [Vec<u8>; 2] {
    ["report.html", "report.json"].map(|name| fs::read(folder.join(name)).unwrap())
}

#[test]
fn full_report_has_every_figure_and_depends_on_its_records_only() {
    let sandbox = Sandbox::new();
    let folder = sandbox.path("report");
    let summary = reproduce(&folder, &[]);

    let document = report(&folder);
    assert_eq!(document["schema"], "roost.report/1");
    assert_eq!((&document["profile"], &document["complete"]), (&json!("tiny"), &json!(true)));
    assert_eq!(document["version"], env!("CARGO_PKG_VERSION"));
    let read = roost_reproduce::Document::from_json(&document.to_string()).unwrap();
    assert_eq!(read.faults("tiny"), Vec::<String>::new(), "the rows that the profile defines");
    assert!(document["machine"].as_str().unwrap().contains("cpu"), "{}", document["machine"]);
    for row in rows(&document) {
        let fields = ["figure", "quantity", "unit", "paper", "measured", "demand", "holds", "note"];
        assert!(fields.iter().all(|name| row.get(name).is_some()), "{row}");
        assert!(
            row["measured"].is_number() || row["measured"].is_string() || row["measured"].is_null(),
            "{row}"
        );
        assert_eq!(row["demand"].is_null(), row["holds"].is_null(), "{row}");
    }
    let is_circular = |row: &&Value| row["note"].as_str().unwrap().contains("does not validate the model");
    let circular: Vec<_> = rows(&document).iter().filter(is_circular).collect();
    // The mass at 4 s, and its share of the loaded mass.
    assert_eq!(circular.len(), 2);
    assert!(circular.iter().all(|row| row["figure"] == "Fig. 14"));
    assert_eq!(circular[0]["paper"], 33.2);
    assert!(rows(&document).iter().all(|row| row["paper"] != ""), "what the paper does not say is null");

    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    let figures = [
        "Table 1",
        "Fig. 2, 3",
        "Table 2",
        "Fig. 6",
        "Fig. 7",
        "Fig. 8",
        "Fig. 9",
        "Fig. 10",
        "Fig. 11",
        "Fig. 12",
        "Table 3",
        "Fig. 13",
        "Fig. 14",
        "Time step",
    ];
    for figure in figures {
        assert!(rows(&document).iter().any(|row| row["figure"] == figure), "no row of {figure}");
        assert!(summary.contains(figure), "{summary}");
    }
    assert!(page.matches("<svg").count() > 20, "{} plots and pictures", page.matches("<svg").count());
    assert!(!page.contains("<script") && !page.contains("src="), "one file, no network");
    assert!(!page.contains("failed: "), "a run failed");

    // A repetition simulates nothing and writes the same bytes.
    let (before, written) = (bytes(&folder), records(&folder));
    assert_eq!(reproduce(&folder, &[]), summary);
    assert_eq!(records(&folder), written);
    assert!(bytes(&folder) == before, "the report is a function of its records");
}

#[test]
fn only_missing_runs_are_simulated() {
    let sandbox = Sandbox::new();
    let folder = sandbox.path("report");
    reproduce(&folder, &["compress"]);
    let before = records(&folder);
    let (lost, _) = before.first_key_value().unwrap();
    fs::remove_file(folder.join("runs").join(lost)).unwrap();
    reproduce(&folder, &["compress"]);
    let after = records(&folder);
    assert_eq!(before.keys().collect::<Vec<_>>(), after.keys().collect::<Vec<_>>());
    let rewritten: Vec<_> = after.iter().filter(|(name, written)| before[*name] != **written).collect();
    assert_eq!(rewritten.len(), 1, "{rewritten:?}");
    assert_eq!(rewritten[0].0, lost);
}

#[test]
fn failed_demand_is_reported() {
    let sandbox = Sandbox::new();
    let folder = sandbox.path("report");
    reproduce(&folder, &["compress"]);
    let of = |document: &Value| {
        let row = rows(document)
            .iter()
            .find(|row| row["quantity"].as_str().unwrap().contains("S_n π R/2"))
            .cloned();
        row.unwrap()
    };
    for name in records(&folder).keys() {
        let path = folder.join("runs").join(name);
        let mut record: Value = serde_json::from_slice(&fs::read(&path).unwrap()).unwrap();
        record["result"]["responses"]["modulus_lattice_pa"] = json!(1.0);
        fs::write(&path, record.to_string()).unwrap();
    }
    let summary = reproduce(&folder, &["compress"]);
    let row = of(&report(&folder));
    assert_eq!(row["holds"], false, "{row}");
    assert!(summary.contains("S_n π R/2"), "named among those that do not hold: {summary}");
    assert!(fs::read_to_string(folder.join("report.html")).unwrap().contains("✗ no"));
}

#[test]
fn ctrl_c_keeps_finished_runs_and_the_next_call_continues() {
    let sandbox = Sandbox::new();
    let folder = sandbox.path("report");
    let mut child = roost()
        .args(["reproduce", "--profile", "tiny", "--threads", "1", "hopper", "-o"])
        .arg(&folder)
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let since = Instant::now();
    while records(&folder).is_empty() && child.try_wait().unwrap().is_none() {
        assert!(since.elapsed() < Duration::from_secs(180), "no run ends");
        std::thread::sleep(Duration::from_millis(5));
    }
    signal(child.id(), "INT");
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(1), "{}", transcript(&output));
    let kept = records(&folder);
    let document = report(&folder);
    assert_eq!(document["complete"], false);
    // Runs that have ended since the last complete figure count too.
    let page = fs::read_to_string(folder.join("report.html")).unwrap();
    assert!(page.contains(&format!("Not run yet: {} of", kept.len())), "{} runs", kept.len());

    reproduce(&folder, &["hopper"]);
    assert_eq!(report(&folder)["complete"], true);
    let all = records(&folder);
    assert!(all.len() > kept.len());
    assert!(kept.iter().all(|(name, written)| all[name] == *written), "what was kept did not run again");
}

#[test]
fn invalid_arguments_are_refused() {
    let sandbox = Sandbox::new();
    let file = sandbox.file("file", &json!({}));
    for (arguments, word) in [
        (vec!["reproduce", "everything"], "everything"),
        (vec!["reproduce", "--quick", "--full"], "--full"),
        (vec!["reproduce", "model", "-o", &file], "cannot create"),
    ] {
        let output = run(&arguments);
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
        assert!(transcript(&output).contains(word), "{}", transcript(&output));
    }
}

#[test]
fn plan_simulates_nothing() {
    let sandbox = Sandbox::new();
    let folder = sandbox.path("report").display().to_string();
    for size in ["--quick", "--standard", "--full"] {
        let plan = stdout(&run(&["reproduce", size, "--plan", "-o", &folder]));
        assert!(plan.contains("Fig. 14"), "{plan}");
    }
    assert!(records(&sandbox.path("report")).is_empty());
}

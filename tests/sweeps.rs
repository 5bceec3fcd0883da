//! A sweep on the command line: designs from files, extension, results in all formats, effects, and deletion.

mod support;

use calamine::{Reader, Xlsx};
use roost_api::sweep::{Deletion, SweepView};
use roost_api::table::{SweepEffects, SweepPoints};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use support::{Sandbox, hopper_scenario, stdout, transcript};

/// The output of a command with `--json`.
fn answer<T: DeserializeOwned>(sandbox: &Sandbox, arguments: &[&str]) -> T {
    serde_json::from_str(&stdout(&sandbox.roost(&[arguments, &["--json"]].concat()))).unwrap()
}

fn belt(design: Value, factors: Value) -> Value {
    json!({"name": "belts", "base": hopper_scenario(0.2), "design": design, "factors": factors, "replicates": 2})
}

#[test]
fn sweep_is_extended_evaluated_and_deleted() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let range = json!([{"pointer": "/equipment/belt_speed_m_s", "low": 0.1, "high": 0.4}]);
    let file = sandbox.file("sweep.json", &belt(json!({"kind": "sobol", "points": 2}), range));
    let view: SweepView = answer(&sandbox, &["submit", "--wait", &file]);
    let id = view.id.to_string();
    assert_eq!((view.points, view.counts.succeeded), (2, 4));

    let grown: SweepView = answer(&sandbox, &["extend", &id, "--points", "2"]);
    assert_eq!((grown.points, grown.counts.total()), (4, 8));
    support::wait_until("the sweep has ended", || {
        let sweep = sandbox.ask(|client| async move { client.sweep(view.id).await }).unwrap();
        sweep.counts.is_ended().then_some(())
    });

    let points = sandbox.path("points.json").display().to_string();
    stdout(&sandbox.roost(&["results", &id, "--by", "point", "--format", "json", "-o", &points]));
    let points: SweepPoints = serde_json::from_slice(&std::fs::read(points).unwrap()).unwrap();
    let discharged = &points.points[3].responses["discharged_kg"];
    assert_eq!(points.points.len(), 4);
    assert!(discharged.n == 2 && discharged.low_95.unwrap() <= discharged.mean.unwrap(), "{discharged:?}");
    let table = stdout(&sandbox.roost(&["results", &id, "--by", "point"]));
    let heads: Vec<&str> = table.lines().next().unwrap().split_whitespace().collect();
    assert_eq!(heads[..4], ["point", "belt_speed_m_s", "done", "unstable"], "{table}");
    assert!(table.contains("2 of 2"), "{table}");
    let file = sandbox.path("results.parquet");
    stdout(&sandbox.roost(&["results", &id, "--format", "parquet", "-o", &file.display().to_string()]));
    assert_eq!(&std::fs::read(file).unwrap()[..4], b"PAR1");
    let file = sandbox.path("results.xlsx");
    stdout(&sandbox.roost(&["results", &id, "--format", "xlsx", "-o", &file.display().to_string()]));
    let mut workbook: Xlsx<_> = calamine::open_workbook(file).unwrap();
    let speeds = workbook.worksheet_range("jobs").unwrap();
    assert_eq!(speeds.rows().next().unwrap()[4], "belt_speed_m_s");
    assert_eq!(speeds.height(), 9, "a header and eight jobs");
    let csv = ["results", &id, "--format", "csv", "--names", "short", "--units", "--by", "point"];
    let csv = stdout(&sandbox.roost(&csv));
    assert!(csv.starts_with("point,belt_speed_m_s,trials,"), "{csv}");
    assert!(csv.lines().nth(1).unwrap().starts_with(",m/s,,"), "{csv}");
    for refused in [["--names", "short", "--format", "json"], ["--format", "xlsx", "--units", "--by=point"]] {
        let output = sandbox.roost(&[&["results", &id], &refused[..]].concat());
        assert_eq!(output.status.code(), Some(2), "{}", transcript(&output));
    }

    let effects: SweepEffects = answer(&sandbox, &["effects", &id]);
    let effect = effects.responses.iter().find(|of| of.response == "discharged_kg").unwrap();
    assert_eq!((effect.points, effect.factors[0].factor.as_str()), (4, "/equipment/belt_speed_m_s"));
    let table = stdout(&sandbox.roost(&["effects", &id]));
    assert!(
        table.lines().any(|line| line.starts_with("discharged_kg") && line.contains("belt_speed_m_s")),
        "{table}"
    );

    let would: Deletion = answer(&sandbox, &["delete", &id]);
    assert_eq!((would.dry_run, would.jobs, would.results), (true, 8, 8));
    let output = sandbox.roost(&["delete", &id]);
    assert!(
        String::from_utf8_lossy(&output.stderr).contains(&format!("roost delete {id} --yes")),
        "{}",
        transcript(&output)
    );
    let gone: Deletion = answer(&sandbox, &["delete", &id, "--yes"]);
    assert!(!gone.dry_run);
    assert_eq!(sandbox.roost(&["status", &id]).status.code(), Some(2));
}

#[test]
fn csv_design_is_submitted_and_extended() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let name = "/equipment/belt_speed_m_s";
    std::fs::write(sandbox.path("points.csv"), format!("{name},/contact/condition\n0.2,dry\n0.25,wet\n"))
        .unwrap();
    let file = sandbox.file("sweep.json", &belt(json!({"kind": "csv", "file": "points.csv"}), json!([])));
    assert!(stdout(&sandbox.roost(&["validate", &file])).contains("4 jobs"));
    let view: SweepView = answer(&sandbox, &["submit", &file]);
    assert_eq!(view.factors, [name, "/contact/condition"]);
    let id = view.id.to_string();

    std::fs::write(sandbox.path("more.csv"), format!("/contact/condition,{name}\nwet,0.3\n")).unwrap();
    let more = sandbox.path("more.csv").display().to_string();
    let grown: SweepView = answer(&sandbox, &["extend", &id, "--rows", &more, "--replicates", "1"]);
    assert_eq!((grown.points, grown.replicates, grown.counts.queued), (3, 3, 9));
    let twice = sandbox.roost(&["extend", &id, "--rows", &more]);
    assert_eq!(twice.status.code(), Some(2), "{}", transcript(&twice));
    assert!(
        String::from_utf8_lossy(&twice.stderr).contains("a point of the sweep already"),
        "{}",
        transcript(&twice)
    );
    assert_eq!(sandbox.roost(&["extend", &id]).status.code(), Some(2), "nothing to add is wrong usage");

    let cancelled: SweepView = answer(&sandbox, &["cancel", &id]);
    assert_eq!(cancelled.counts.cancelled, 9);
    let messages = |arguments: &[&str]| transcript(&sandbox.roost(arguments));
    assert!(messages(&["cancel", &id]).contains("nothing to cancel"));
    assert!(
        messages(&["retry", &id, "--class", "lost"]).contains("nothing to retry: no job has failed as lost")
    );
    let none: SweepView = answer(&sandbox, &["status", &id]);
    assert_eq!(none.counts.queued, 0);
    assert!(!messages(&["retry", &id]).contains("nothing"));
    let again: SweepView = answer(&sandbox, &["status", &id]);
    assert_eq!(again.counts.queued, 9);
    assert!(messages(&["retry", &id]).contains("nothing to retry: no job has failed or was cancelled"));

    let missing = sandbox.file("missing.json", &belt(json!({"kind": "csv", "file": "none.csv"}), json!([])));
    let refused = sandbox.roost(&["submit", &missing]);
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    let stderr = String::from_utf8_lossy(&refused.stderr);
    assert!(stderr.contains("/design/file") && stderr.contains("none.csv"), "{stderr}");
}

#[test]
fn faults_of_a_sweep_have_value_and_allowed_values() {
    let sandbox = Sandbox::new();
    let factors = json!([{"pointer": "/equipment/belt_speed_m_s", "levles": [0.1]}, {"levels": [1]}]);
    let file = sandbox.file("sweep.json", &belt(json!({"kind": "sobol"}), factors));
    let output = sandbox.roost(&["validate", &file]);
    let text = String::from_utf8_lossy(&output.stderr);
    for part in [
        "/factors/0/levles",
        "did you mean levels",
        "/factors/1/pointer: a factor needs a field",
        "/design/points",
    ] {
        assert!(text.contains(part), "{part}\n{text}");
    }
    assert!(!text.contains("found null"), "{text}");
}

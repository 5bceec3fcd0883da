//! A sweep by the command line: designs from files, growth, results in every form, what mattered, and its end.

mod support;

use roost_api::sweep::{Deletion, SweepView};
use roost_api::table::{SweepEffects, SweepPoints};
use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use support::{Home, said, scenario, stdout};

/// What a command answers with `--json`.
fn answer<T: DeserializeOwned>(home: &Home, arguments: &[&str]) -> T {
    serde_json::from_str(&stdout(&home.roost(&[arguments, &["--json"]].concat()))).unwrap()
}

fn belt(design: Value, factors: Value) -> Value {
    json!({"name": "belts", "base": scenario(0.2), "design": design, "factors": factors, "replicates": 2})
}

#[test]
fn a_sweep_grows_shows_what_matters_and_goes() {
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("worker");
    let range = json!([{"pointer": "/equipment/belt_speed_m_s", "low": 0.1, "high": 0.4}]);
    let file = home.file("sweep.json", &belt(json!({"kind": "sobol", "points": 2}), range));
    let view: SweepView = answer(&home, &["submit", "--wait", &file]);
    let id = view.id.to_string();
    assert_eq!((view.points, view.counts.succeeded), (2, 4));

    let grown: SweepView = answer(&home, &["extend", &id, "--points", "2"]);
    assert_eq!((grown.points, grown.counts.total()), (4, 8));
    support::until("the sweep has ended", || {
        let sweep = home.ask(|client| async move { client.sweep(view.id).await }).unwrap();
        sweep.counts.is_ended().then_some(())
    });

    let points = home.path("points.json").display().to_string();
    stdout(&home.roost(&["results", &id, "--by", "point", "--format", "json", "-o", &points]));
    let points: SweepPoints = serde_json::from_slice(&std::fs::read(points).unwrap()).unwrap();
    let discharged = &points.points[3].responses["discharged_kg"];
    assert_eq!(points.points.len(), 4);
    assert!(discharged.n == 2 && discharged.low_95.unwrap() <= discharged.mean.unwrap(), "{discharged:?}");
    let table = stdout(&home.roost(&["results", &id, "--by", "point"]));
    let heads: Vec<&str> = table.lines().next().unwrap().split_whitespace().collect();
    assert_eq!(heads[..4], ["point", "belt_speed_m_s", "done", "unstable"], "{table}");
    assert!(table.contains("2 of 2"), "{table}");
    let file = home.path("results.parquet");
    stdout(&home.roost(&["results", &id, "--format", "parquet", "-o", &file.display().to_string()]));
    assert_eq!(&std::fs::read(file).unwrap()[..4], b"PAR1");

    let effects: SweepEffects = answer(&home, &["effects", &id]);
    let effect = effects.responses.iter().find(|of| of.response == "discharged_kg").unwrap();
    assert_eq!((effect.points, effect.factors[0].factor.as_str()), (4, "/equipment/belt_speed_m_s"));
    let table = stdout(&home.roost(&["effects", &id]));
    assert!(
        table.lines().any(|line| line.starts_with("discharged_kg") && line.contains("belt_speed_m_s")),
        "{table}"
    );

    let would: Deletion = answer(&home, &["delete", &id]);
    assert_eq!((would.dry_run, would.jobs, would.results), (true, 8, 8));
    let told = home.roost(&["delete", &id]);
    assert!(
        String::from_utf8_lossy(&told.stderr).contains(&format!("roost delete {id} --yes")),
        "{}",
        said(&told)
    );
    let gone: Deletion = answer(&home, &["delete", &id, "--yes"]);
    assert!(!gone.dry_run);
    assert_eq!(home.roost(&["status", &id]).status.code(), Some(2));
}

#[test]
fn points_come_from_a_table_and_more_of_them_later() {
    let home = Home::new();
    let _server = home.serve();
    let name = "/equipment/belt_speed_m_s";
    std::fs::write(home.path("points.csv"), format!("{name},/contact/condition\n0.2,dry\n0.25,wet\n"))
        .unwrap();
    let file = home.file("sweep.json", &belt(json!({"kind": "csv", "file": "points.csv"}), json!([])));
    assert!(stdout(&home.roost(&["validate", &file])).contains("4 jobs"));
    let view: SweepView = answer(&home, &["submit", &file]);
    assert_eq!(view.factors, [name, "/contact/condition"]);
    let id = view.id.to_string();

    std::fs::write(home.path("more.csv"), format!("/contact/condition,{name}\nwet,0.3\n")).unwrap();
    let more = home.path("more.csv").display().to_string();
    let grown: SweepView = answer(&home, &["extend", &id, "--rows", &more, "--replicates", "1"]);
    assert_eq!((grown.points, grown.replicates, grown.counts.queued), (3, 3, 9));
    let twice = home.roost(&["extend", &id, "--rows", &more]);
    assert_eq!(twice.status.code(), Some(2), "{}", said(&twice));
    assert!(
        String::from_utf8_lossy(&twice.stderr).contains("a point of the sweep already"),
        "{}",
        said(&twice)
    );
    assert_eq!(home.roost(&["extend", &id]).status.code(), Some(2), "nothing to add is wrong usage");

    let cancelled: SweepView = answer(&home, &["cancel", &id]);
    assert_eq!(cancelled.counts.cancelled, 9);
    let told = |arguments: &[&str]| said(&home.roost(arguments));
    assert!(told(&["cancel", &id]).contains("nothing to cancel"));
    assert!(told(&["retry", &id, "--class", "lost"]).contains("nothing to retry: no job has failed as lost"));
    let none: SweepView = answer(&home, &["status", &id]);
    assert_eq!(none.counts.queued, 0);
    assert!(!told(&["retry", &id]).contains("nothing"));
    let again: SweepView = answer(&home, &["status", &id]);
    assert_eq!(again.counts.queued, 9);
    assert!(told(&["retry", &id]).contains("nothing to retry: no job has failed or was cancelled"));

    let missing = home.file("missing.json", &belt(json!({"kind": "csv", "file": "none.csv"}), json!([])));
    let refused = home.roost(&["submit", &missing]);
    assert_eq!(refused.status.code(), Some(2), "{}", said(&refused));
    let told = String::from_utf8_lossy(&refused.stderr);
    assert!(told.contains("/design/file") && told.contains("none.csv"), "{told}");
}

#[test]
fn faults_of_a_sweep_say_what_stands_there_and_what_should() {
    let home = Home::new();
    let factors = json!([{"pointer": "/equipment/belt_speed_m_s", "levles": [0.1]}, {"levels": [1]}]);
    let file = home.file("sweep.json", &belt(json!({"kind": "sobol"}), factors));
    let told = home.roost(&["validate", &file]);
    let text = String::from_utf8_lossy(&told.stderr);
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

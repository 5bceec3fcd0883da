//! `roost study run`: a question that one process answers, repeats of the command, a kill, and changes of the question. `roost study ask`
//! and `tell`: a script makes the runs.

mod support;

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use roost_worker::client::Client;
use serde_json::{Value, json};
use support::{Process, Sandbox, hopper_scenario, roost, slow_scenario, stdout, transcript, wait_until};
use tempfile::TempDir;

/// Runs that answer the question: five at each of two points. A study with several workers may make some more.
const RUNS: u64 = 10;

/// Two gate openings, each with as many runs as an interval of a mean needs.
fn question(base: Value) -> Value {
    json!({
        "name": "two gates", "base": base,
        "factors": [{"pointer": "/equipment/gate_opening_m", "low": 0.05, "high": 0.1}],
        "goal": {"estimate": {"points": [[0.06], [0.08]], "intervals": [{"of": {"mean": "fill_duration_s"}, "width": 100.0}]}},
        "budget": {"max_runs": 20}
    })
}

/// A file with a question, and a folder for its study.
struct Place {
    folder: TempDir,
}

impl Place {
    fn new(question: &Value) -> Self {
        let place = Self { folder: tempfile::tempdir().unwrap() };
        place.write(question);
        place
    }

    fn write(&self, question: &Value) {
        std::fs::write(self.file(), question.to_string()).unwrap();
    }

    fn file(&self) -> PathBuf {
        self.folder.path().join("question.json")
    }

    fn output(&self) -> PathBuf {
        self.folder.path().join("out")
    }

    fn command(&self) -> Command {
        let mut command = roost();
        command.args(["study", "run"]).arg(self.file()).arg("-o").arg(self.output());
        command.args(["--backend", "cpu", "--threads", "2"]);
        command
    }

    fn run(&self) -> Output {
        self.command().output().unwrap()
    }

    fn answer(&self) -> Value {
        serde_json::from_slice(&std::fs::read(self.output().join("answer.json")).unwrap()).unwrap()
    }
}

/// Number of runs with a result.
fn done(answer: &Value) -> u64 {
    answer["study"]["runs"]["done"].as_u64().unwrap()
}

/// The factor and the seed of each run in a table, which tell runs apart.
fn runs_in(table: &Path) -> Vec<(String, String)> {
    let mut reader = csv::Reader::from_path(table).unwrap();
    let heads = reader.headers().unwrap().clone();
    let column = |name: &str| heads.iter().position(|head| head.contains(name)).unwrap();
    let (gate, seed) = (column("gate_opening_m"), column("seed"));
    let rows = reader.records().map(Result::unwrap);
    rows.map(|row| (row[gate].to_owned(), row[seed].to_owned())).collect()
}

#[test]
fn question_is_answered_and_a_repeat_has_the_same_answer() {
    let mut asked = question(hopper_scenario(0.1));
    let place = Place::new(&asked);
    let first = stdout(&place.run());
    let answer = place.answer();
    assert_eq!(answer["study"]["finished"], "by_rule", "{answer:#}");
    assert!(done(&answer) >= RUNS, "{answer:#}");
    assert!(first.contains(answer["study"]["question"].as_str().unwrap()), "{first}");
    for sentence in answer["study"]["answer"].as_array().unwrap() {
        assert!(first.contains(sentence.as_str().unwrap()), "no `{sentence}` in {first}");
    }
    let picture = std::fs::read_to_string(place.output().join("answer.svg")).unwrap();
    roxmltree::Document::parse(&picture).unwrap();
    assert!(picture.contains("gate opening (m)"));
    let table = place.output().join("results.csv");
    let runs = runs_in(&table);
    assert!(runs.len() as u64 >= RUNS, "{runs:?}");

    // The folder has the answer: nothing is simulated again.
    std::fs::remove_file(&table).unwrap();
    let again = place.run();
    // A run that the end of the study met under way is cancelled later.
    let words = |text: &str| {
        text.lines().filter(|line| !line.starts_with("finished")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(words(&stdout(&again)), words(&first));
    assert_eq!(place.answer()["answer"], answer["answer"]);
    for part in ["question", "answer", "finished"] {
        assert_eq!(place.answer()["study"][part], answer["study"][part]);
    }
    assert_eq!(runs_in(&table), runs);

    // Another question belongs into another folder.
    asked["base"]["seed"] = json!(5);
    place.write(&asked);
    let refused = place.run();
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    assert!(transcript(&refused).contains("/base/seed: "), "{}", transcript(&refused));
    asked["base"].as_object_mut().unwrap().remove("seed");
    asked["budget"]["max_runs"] = json!(15);
    place.write(&asked);
    let refused = place.run();
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    assert!(transcript(&refused).contains("/budget/max_runs: "), "{}", transcript(&refused));

    asked["budget"]["max_runs"] = json!(40);
    place.write(&asked);
    stdout(&place.run());
    assert_eq!(place.answer()["study"]["runs"]["max_runs"], 40);
}

#[test]
fn a_script_makes_the_runs_of_a_study() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut asked = question(hopper_scenario(0.1));
    asked["driver"] = json!("client");
    let id = stdout(&sandbox.roost(&["study", "submit", &sandbox.file("question.json", &asked)]));
    let id = id.trim();
    let table = stdout(&sandbox.roost(&["study", "ask", id, "--count", "2"]));
    let lines: Vec<&str> = table.lines().collect();
    assert!(lines.len() == 4 && lines[0].contains("/equipment/gate_opening_m"), "{table}");
    assert!(lines[2].trim_start().starts_with("1 ") && lines[3].trim_start().starts_with("2 "), "{table}");
    let more = sandbox.json_output(&["study", "ask", id, "--count", "100"]);
    let runs = more["runs"].as_array().unwrap();
    assert_eq!((runs.len(), &runs[0]["run"]), (8, &json!(3)), "ten runs answer the question: {more:#}");
    assert_eq!(runs[0]["scenario"]["seed"], runs[0]["seed"]);
    let none = transcript(&sandbox.roost(&["study", "ask", id]));
    assert!(none.contains("before the outcomes of 10 in flight are told: roost study tell"), "{none}");

    let outcome = |run: u64, value: f64| json!({"run": run, "responses": {"fill_duration_s": value}});
    let told: Vec<Value> = (1..=10).map(|run| outcome(run, 0.5 + run as f64)).collect();
    let file = sandbox.file("outcomes.json", &json!({"outcomes": told[..9]}));
    let text = stdout(&sandbox.roost(&["study", "tell", id, &file]));
    assert_eq!(text, "9 recorded; 9 of 20 runs, 1 pending\n");
    // The last one comes through stdin, beside known ones.
    let mut command = roost();
    command.args(["study", "tell", id, "-", "--json"]).env("ROOST_SERVER", &sandbox.address);
    let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(json!({"outcomes": told}).to_string().as_bytes()).unwrap();
    let reply: Value = serde_json::from_str(&stdout(&child.wait_with_output().unwrap())).unwrap();
    assert_eq!((&reply["recorded"], &reply["repeated"]), (&json!(1), &json!(9)));
    wait_until("the study is finished", || {
        (sandbox.get(&format!("/v1/studies/{id}"))["state"] == "finished").then_some(())
    });
    let none = transcript(&sandbox.roost(&["study", "ask", id]));
    assert!(none.contains("the study is finished: roost study show"), "{none}");

    let refused = |document: Value, parts: &[&str]| {
        let output = sandbox.roost(&["study", "tell", id, &sandbox.file("faulty.json", &document)]);
        let text = transcript(&output);
        assert_eq!(output.status.code(), Some(2), "{text}");
        assert!(parts.iter().all(|part| text.contains(part)), "{parts:?}: {text}");
    };
    refused(
        json!({"outcomes": [outcome(1, 7.0)]}),
        &["/outcomes/0", "another outcome", r#"{"fill_duration_s":1.5}"#],
    );
    refused(json!({"outcomes": [outcome(77, 7.0)]}), &["/outcomes/0/run", "no such run was handed out"]);
    refused(json!([outcome(1, 1.5)]), &["has no `outcomes`: write {\"outcomes\": [{\"run\": 1"]);
    let many = transcript(&sandbox.roost(&["study", "ask", id, "--count", "101"]));
    assert!(many.contains("101 is not in 1..=100"), "{many}");
}

#[test]
fn faulty_question_is_refused_and_can_be_corrected() {
    let mut asked = question(hopper_scenario(0.1));
    asked["goal"]["estimate"]["intervals"][0]["of"]["mean"] = json!("filled_kgs");
    let place = Place::new(&asked);
    let refused = place.run();
    assert_eq!(refused.status.code(), Some(2), "{}", transcript(&refused));
    assert!(transcript(&refused).contains("filled_kgs"), "{}", transcript(&refused));
    place.write(&question(hopper_scenario(0.1)));
    stdout(&place.run());
}

#[tokio::test]
async fn killed_study_continues_when_repeated() {
    let place = Place::new(&question(slow_scenario(3.0)));
    let log = place.folder.path().join("first.log");
    let killed = Process::start(&mut place.command(), log);
    let address = wait_until("the server has an address", || {
        let log = killed.log();
        let rest = log.split("server at ").nth(1)?;
        rest.split(',').next().filter(|_| rest.contains('\n')).map(str::to_owned)
    });
    let client = Client::new(&address).unwrap();
    let since = Instant::now();
    let study = loop {
        assert!(since.elapsed() < Duration::from_secs(120), "no two runs have ended: {}", killed.log());
        let studies = client.studies(None, 1).await.map(|page| page.items).unwrap_or_default();
        if let Some(study) = studies.into_iter().find(|study| study.runs.done >= 2) {
            break study;
        }
        tokio::time::sleep(Duration::from_millis(50)).await;
    };
    killed.kill();
    assert!(study.runs.done < RUNS, "it was killed midway");
    assert!(!place.output().join("answer.json").exists());
    let output = place.run();
    stdout(&output);
    assert!(transcript(&output).contains(&format!("going on with study {}", study.id)));
    let answer = place.answer();
    assert_eq!(answer["study"]["id"], json!(study.id));
    assert!(done(&answer) >= RUNS, "{answer:#}");
    let runs = runs_in(&place.output().join("results.csv"));
    assert_eq!(runs.iter().collect::<BTreeSet<_>>().len(), runs.len(), "nothing ran twice: {runs:?}");
}

#[test]
fn interrupted_study_prints_how_to_continue() {
    let place = Place::new(&question(slow_scenario(60.0)));
    let process = Process::start(&mut place.command(), place.folder.path().join("first.log"));
    wait_until("the study has begun", || process.log().contains("study ").then_some(()));
    process.terminate();
    let log = place.folder.path().join("first.log");
    let (status, _) = process.wait();
    let log = std::fs::read_to_string(log).unwrap();
    assert_eq!(status.code(), Some(1), "{log}");
    assert!(log.contains("the same command goes on with the study"), "{log}");
}

/// The example questions with small hoppers, few runs and wide intervals, and their goals. `calibrate.rs` has the calibration.
fn small_examples() -> Vec<(String, &'static str, Value)> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs/examples/studies");
    let files = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let small = |file: PathBuf| {
        let mut asked: Value = serde_json::from_slice(&std::fs::read(&file).unwrap()).unwrap();
        asked["base"]["product"] = json!({"count": 16, "subparticle_radius_m": 0.012});
        let goals = ["boundary", "estimate", "optimise", "sensitivity"];
        let goal = goals.into_iter().find(|goal| asked["goal"].get(goal).is_some()).unwrap();
        if goal == "sensitivity" {
            // Effects of eight factors from 16 trajectories, instead of 64 rows of indices.
            asked["goal"][goal]["method"] = json!("morris");
        }
        if let Some(constraints) = asked["goal"][goal].get_mut("constraints").and_then(Value::as_array_mut) {
            // A share of at most 30 % needs fewer runs for its confirmation than one of 5 %.
            let chance =
                constraints.iter_mut().find(|constraint| constraint["of"].get("probability").is_some());
            chance.unwrap()["at_most"] = json!(0.3);
        }
        let runs = BTreeMap::from([("boundary", 40), ("optimise", 100), ("sensitivity", 160)]);
        asked["budget"]["max_runs"] = json!(runs[goal]);
        (file.file_stem().unwrap().to_str().unwrap().to_owned(), goal, asked)
    };
    let is_small = |file: &PathBuf| {
        file.extension().is_some_and(|extension| extension == "json")
            && !file.ends_with("paper-calibration.json")
    };
    files.filter(is_small).map(small).collect()
}

#[test]
fn example_questions_are_answered() {
    let examples = small_examples();
    assert_eq!(examples.len(), 6);
    for (name, goal, asked) in examples {
        let place = Place::new(&asked);
        let printed = stdout(&place.run());
        let answer = place.answer();
        assert_eq!(answer["study"]["state"], "finished", "{name}: {answer:#}");
        assert!(done(&answer) >= 20, "{name}: {answer:#}");
        assert!(answer["answer"]["finding"].get(goal).is_some(), "{name}: {answer:#}");
        let sentences = answer["study"]["answer"].as_array().unwrap();
        assert!(sentences.len() >= 3, "{name}: {sentences:?}");
        for sentence in sentences {
            assert!(printed.contains(sentence.as_str().unwrap()), "{name}: no `{sentence}` in {printed}");
        }
        let picture = std::fs::read_to_string(place.output().join("answer.svg")).unwrap();
        roxmltree::Document::parse(&picture).unwrap();
        let runs = runs_in(&place.output().join("results.csv"));
        assert_eq!(runs.iter().collect::<BTreeSet<_>>().len(), runs.len(), "{name}: nothing ran twice");
    }
}

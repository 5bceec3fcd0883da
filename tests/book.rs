//! The shell blocks of the pages for users: each names the test that runs it, or the reason why none does.
//!
//! The tests run the blocks with smaller simulations. Every replaced word must be on the page.

mod support;

use std::path::Path;
use std::process::Command;

use serde_json::json;
use support::{Sandbox, hopper_scenario, stl};

/// A shell block, with the comment before it.
struct Block<'a> {
    mark: &'a str,
    shell: &'a str,
}

fn blocks(page: &str) -> Vec<Block<'_>> {
    let mut found = Vec::new();
    let mut at = 0;
    while let Some(start) = page[at..].find("\n```sh\n").map(|start| at + start) {
        let shell = page[start + 7..].split("\n```").next().expect("an end");
        found.push(Block { mark: page[..start].lines().last().unwrap_or_default(), shell });
        at = start + 7 + shell.len();
    }
    found
}

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// The pages with shell blocks for users: the how-to pages and those of the tutorial, by name.
fn pages() -> Vec<(String, String)> {
    let folder = std::fs::read_dir(root().join("docs/howto")).unwrap();
    let names =
        folder.map(|entry| format!("docs/howto/{}", entry.unwrap().file_name().into_string().unwrap()));
    let names =
        names.chain(["tutorial", "studies", "sweeps", "reproduce"].map(|name| format!("docs/{name}.md")));
    names.map(|name| (name.clone(), std::fs::read_to_string(root().join(name)).unwrap())).collect()
}

/// The tests that a mark names, as `tests/book.rs: the_tutorial_runs`; they must exist.
fn tests_of(mark: &str) -> Vec<String> {
    let words: Vec<&str> = mark.split_whitespace().collect();
    let named = words.windows(2).filter(|pair| pair[0].starts_with("tests/") && pair[0].ends_with(".rs:"));
    named.map(|pair| format!("{} {}", pair[0], pair[1].trim_end_matches(';'))).collect()
}

/// The fault of the mark of a block, if it has one.
fn fault(mark: &str) -> Option<String> {
    let (is_tested, is_not) = (mark.starts_with("<!-- tested by "), mark.starts_with("<!-- not tested: "));
    if !(is_tested || is_not) || !mark.ends_with(" -->") {
        return Some("it has neither `tested by` nor `not tested` before it".to_owned());
    }
    let tests = tests_of(mark);
    if is_tested && tests.len() != 1 {
        return Some(format!("it names {} tests", tests.len()));
    }
    tests.iter().find_map(|test| {
        let (file, name) = test.split_once(": ").expect("a file and a name");
        let text = std::fs::read_to_string(root().join(file)).unwrap_or_default();
        (!text.contains(&format!("fn {name}("))).then(|| format!("{file} has no test {name}"))
    })
}

#[test]
fn every_shell_block_names_its_test_or_a_reason() {
    let mut count = 0;
    for (name, page) in &pages() {
        for block in blocks(page) {
            count += 1;
            let fault = fault(block.mark);
            assert!(fault.is_none(), "{name}: {}\n{}\n{}", fault.unwrap(), block.mark, block.shell);
        }
    }
    assert!(count > 15, "{count}");
}

#[test]
fn wrong_mark_is_reported() {
    assert!(fault("Text.").is_some());
    assert!(fault("<!-- tested by tests/book.rs: no_such_test -->").is_some());
    assert!(fault("<!-- tested by somebody -->").is_some());
    assert_eq!(fault("<!-- not tested: it needs a cluster -->"), None);
    assert_eq!(fault("<!-- tested by tests/book.rs: wrong_mark_is_reported -->"), None);
}

/// Runs the blocks of a page that name this test, in their order, with words replaced. `before` runs first.
fn run(sandbox: &Sandbox, page: &str, test: &str, replaced: &[(&str, &str)], before: &str) {
    let output = output_of(sandbox, page, test, replaced, before);
    assert!(output.status.success(), "{page}: {}", support::transcript(&output));
}

/// The output of the same.
fn output_of(
    sandbox: &Sandbox,
    page: &str,
    test: &str,
    replaced: &[(&str, &str)],
    before: &str,
) -> std::process::Output {
    let text = std::fs::read_to_string(root().join(page)).unwrap();
    let mark = format!("<!-- tested by tests/book.rs: {test} -->");
    let own = blocks(&text).into_iter().filter(|block| block.mark == mark);
    let mut shell: String = own.map(|block| format!("{}\n", block.shell)).collect();
    assert!(!shell.is_empty(), "{page} has no block for {test}");
    for (from, to) in replaced {
        assert!(shell.contains(from), "{page} does not have {from}");
        shell = shell.replace(from, to);
    }
    let bin = Path::new(env!("CARGO_BIN_EXE_roost")).parent().unwrap();
    let path = format!("{}:{}", bin.display(), std::env::var("PATH").unwrap());
    Command::new("bash")
        .args(["-c", &format!("set -euo pipefail\n{before}\n{shell}")])
        .current_dir(sandbox.folder.path())
        .env("PATH", path)
        .env("ROOST_SERVER", &sandbox.address)
        .output()
        .unwrap()
}

/// The hopper of the pages, coarser and with fewer fillets.
const SMALL: (&str, &str) = (r#""subparticle_radius_m": 0.008"#, r#""subparticle_radius_m": 0.009"#);
const FEW: (&str, &str) = (r#""count": 48"#, r#""count": 3"#);
const ONE: &str = r#""replicates": 1"#;

#[test]
fn the_first_runs_run() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let whole = (r#""subparticle_radius_m": 0.006"#, r#""count": 4, "subparticle_radius_m": 0.009"#);
    let replaced = [whole, SMALL, FEW, (r#""replicates": 3"#, ONE)];
    run(&sandbox, "docs/howto/first-runs.md", "the_first_runs_run", &replaced, "");
    assert!(sandbox.path("out/curve.svg").exists());
}

#[test]
fn a_study_is_answered_on_a_server_and_widened() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let file = "docs/examples/studies/gate-and-speed.json";
    let mut asked: serde_json::Value =
        serde_json::from_slice(&std::fs::read(root().join(file)).unwrap()).unwrap();
    asked["base"]["product"] = json!({"count": 16, "subparticle_radius_m": 0.012});
    asked["budget"]["max_runs"] = json!(40);
    let small = sandbox.path(file);
    std::fs::create_dir_all(small.parent().unwrap()).unwrap();
    std::fs::write(small, asked.to_string()).unwrap();
    run(&sandbox, "docs/studies.md", "a_study_is_answered_on_a_server_and_widened", &[], "");
    assert!(sandbox.path("map/answer.svg").exists());
}

#[test]
fn the_tutorial_runs() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let whole = (r#""subparticle_radius_m": 0.006"#, r#""count": 4, "subparticle_radius_m": 0.009"#);
    let replaced = [whole, SMALL, FEW, (r#""replicates": 4"#, ONE), (r#""replicates": 12"#, ONE)];
    run(&sandbox, "docs/tutorial.md", "the_tutorial_runs", &replaced, "");
    assert!(sandbox.path("out/curve.svg").exists());
    assert!(std::fs::metadata(sandbox.path("run.roostframes")).unwrap().len() > 1000);
}

#[test]
fn a_hopper_from_an_stl_file_runs() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    for (name, height) in [("hopper.stl", 500.0), ("hopper-b.stl", 480.0)] {
        std::fs::write(sandbox.path(name), stl::ascii(&stl::hopper([300.0, 150.0, height], 60.0))).unwrap();
    }
    let page = "docs/howto/hopper-from-stl.md";
    run(&sandbox, page, "a_hopper_from_an_stl_file_runs", &[SMALL, FEW], "");
    let result = std::fs::read_to_string(sandbox.path("own-hopper/result.json")).unwrap();
    let result: serde_json::Value = serde_json::from_str(&result).unwrap();
    assert_eq!(result["responses"]["escaped_kg"], 0.0);
    assert_eq!(result["scenario"]["equipment"]["parametric"], false);
}

#[test]
fn a_gate_is_chosen() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    for (name, opening) in [("gate-60.stl", 60.0), ("gate-80.stl", 80.0), ("no-gate.stl", 499.0)] {
        std::fs::write(sandbox.path(name), stl::ascii(&stl::hopper([300.0, 150.0, 500.0], opening))).unwrap();
    }
    let replaced = [SMALL, FEW, (r#""replicates": 4"#, ONE), (r#""replicates": 59"#, r#""replicates": 2"#)];
    run(&sandbox, "docs/howto/choose-a-gate.md", "a_gate_is_chosen", &replaced, "");
    let table = std::fs::read_to_string(sandbox.path("confirm.csv")).unwrap();
    assert_eq!(table.lines().count(), 5, "two openings with two replicates: {table}");
    assert!(!table.contains("failed"), "{table}");
}

#[test]
fn an_own_product_runs() {
    let sandbox = Sandbox::new();
    let coarser = ["0.004", "0.006"].map(|radius| format!(r#""subparticle_radius_m": {radius}"#));
    let coarse = SMALL.1;
    let replaced = [(coarser[0].as_str(), coarse), (&coarser[1], coarse), (r#""count": 60"#, FEW.1)];
    run(&sandbox, "docs/howto/own-product.md", "an_own_product_runs", &replaced, "");
    for (folder, response) in [("tilt", "critical_angle_deg"), ("own", "regime")] {
        let result = std::fs::read_to_string(sandbox.path(&format!("{folder}/result.json"))).unwrap();
        let result: serde_json::Value = serde_json::from_str(&result).unwrap();
        assert!(!result["responses"][response].is_null(), "{result}");
    }
}

#[test]
fn measurements_are_checked() {
    let sandbox = Sandbox::new();
    let page = "docs/howto/measurements.md";
    // The curve's last number in the unit of the result, as the page has it.
    let (replaced, printed) =
        (("roost validate lab.json", "roost validate lab.json > report"), "mean 450 Pa");
    run(&sandbox, page, "measurements_are_checked", &[replaced], "");
    let report = std::fs::read_to_string(sandbox.path("report")).unwrap();
    let text = std::fs::read_to_string(root().join(page)).unwrap();
    assert!(report.contains(printed) && text.contains(printed), "{report}");
}

#[test]
fn kitchen_tests_are_checked() {
    let sandbox = Sandbox::new();
    let page = "docs/howto/kitchen-tests.md";
    let replaced = ("roost validate kitchen.json", "roost validate kitchen.json > report");
    run(&sandbox, page, "kitchen_tests_are_checked", &[replaced], "");
    let report = std::fs::read_to_string(sandbox.path("report")).unwrap();
    for printed in
        ["mean 22 °, standard", "mean 0.192 s", "mean 48400 Pa", "mean 922 kg/m³", "discharged_mass"]
    {
        assert!(report.contains(printed), "{printed}: {report}");
    }
}

#[test]
fn a_sweep_gets_more_replicates() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let fewer = ("--replicates 55", "--replicates 1");
    let replaced = [SMALL, FEW, (r#""replicates": 4"#, ONE), fewer];
    run(&sandbox, "docs/howto/replicates.md", "a_sweep_gets_more_replicates", &replaced, "");
    assert_eq!(sandbox.get("/v1/sweeps")["items"][0]["replicates"], 2);
}

/// A sweep of two small jobs, in `sweep.json`.
fn sandbox_with_sweep_file() -> Sandbox {
    let sandbox = Sandbox::new();
    let factors = json!([{"pointer": "/equipment/gate_opening_m", "levels": [0.05, 0.06]}]);
    let sweep =
        json!({"name": "two", "base": hopper_scenario(0.2), "design": {"kind": "grid"}, "factors": factors});
    sandbox.file("sweep.json", &sweep);
    sandbox
}

#[test]
fn results_come_as_files() {
    let sandbox = sandbox_with_sweep_file();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("worker");
    let before = "ID=$(roost submit sweep.json --wait)";
    run(&sandbox, "docs/howto/results.md", "results_come_as_files", &[], before);
    let table = std::fs::read_to_string(sandbox.path("results.csv")).unwrap();
    let columns =
        "job_id,point,replicate,seed,/equipment/gate_opening_m,state,failure_class,backend,solver_revision,";
    assert!(table.starts_with(columns), "{table}");
    assert_eq!(table.lines().count(), 3);
    for name in ["results.parquet", "results.xlsx", "short.csv", "points.json", "effects.json"] {
        assert!(std::fs::metadata(sandbox.path(name)).unwrap().len() > 100, "{name}");
    }
}

#[test]
fn a_run_leaves_frames_for_paraview() {
    let sandbox = Sandbox::new();
    sandbox.file("scenario.json", &hopper_scenario(0.2));
    run(&sandbox, "docs/howto/paraview.md", "a_run_leaves_frames_for_paraview", &[], "");
    assert!(sandbox.path("frames/frames.pvd").exists());
}

#[test]
fn tokens_are_made_and_listed() {
    let sandbox = Sandbox::new();
    run(&sandbox, "docs/howto/deploy.md", "tokens_are_made_and_listed", &[], "");
    for name in ["admin.token", "worker.token"] {
        assert!(std::fs::read_to_string(sandbox.path(name)).unwrap().len() > 20, "{name}");
    }
}

#[test]
fn a_server_is_backed_up_and_gets_a_new_token() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let data = sandbox.path("data").display().to_string();
    let old = support::run(&["token", "create", "--scope", "worker", "--json", "--data", &data]);
    let old: serde_json::Value = serde_json::from_str(&support::stdout(&old)).unwrap();
    let revoke = format!("revoke {}", old["view"]["id"].as_str().unwrap());
    let page = "docs/howto/operate.md";
    let replaced = [("backups/2026-03-01", "backups/*"), ("revoke ID", revoke.as_str())];
    run(&sandbox, page, "a_server_is_backed_up_and_gets_a_new_token", &replaced, "");
    assert!(sandbox.path("restored/roost.db").exists());
    let tokens = support::stdout(&support::run(&["token", "list", "--json", "--data", &data]));
    let tokens: Vec<serde_json::Value> = serde_json::from_str(&tokens).unwrap();
    let valid: Vec<_> = tokens.iter().filter(|token| token["revoked_at"].is_null()).collect();
    assert_eq!((tokens.len(), valid.len()), (2, 1));
    assert_eq!(valid[0]["name"], "workers-2");
}

#[test]
fn a_server_has_projects_with_shares_and_budgets() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    run(&sandbox, "docs/howto/users.md", "a_server_has_projects_with_shares_and_budgets", &[], "");
    let data = sandbox.path("data").display().to_string();
    let listed = |what| support::stdout(&support::run(&[what, "list", "--json", "--data", &data]));
    let projects: serde_json::Value = serde_json::from_str(&listed("project")).unwrap();
    let project = &projects[0];
    assert_eq!((&project["name"], &project["share"]), (&"coatings".into(), &2.into()), "{projects}");
    assert_eq!(project["budget_core_hours"], 800.0);
    let tokens: serde_json::Value = serde_json::from_str(&listed("token")).unwrap();
    let token = &tokens[0];
    assert_eq!((&token["user"], &token["project"]), (&"Ada".into(), &"coatings".into()), "{tokens}");
}

#[test]
fn old_backups_are_deleted_after_a_new_one_only() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let old = sandbox.path("kept/2020-01-01");
    std::fs::create_dir_all(&old).unwrap();
    let try_with = |data: &str, copies: &str| {
        // The script itself must stop at a failure.
        let before =
            format!("touch -t 202001010000 kept/2020-01-01\nrsync() {{ {copies}; }}\nset +euo pipefail");
        let words = [
            ("backups=/srv/roost-backups", "backups=kept"),
            ("/usr/local/bin/roost", "roost"),
            ("/var/lib/roost-server", data),
        ];
        let test = "old_backups_are_deleted_after_a_new_one_only";
        output_of(&sandbox, "docs/howto/operate.md", test, &words, &before).status.success()
    };
    assert!(!try_with("missing", "true") && old.exists(), "no backup");
    assert!(!try_with("data", "false") && old.exists(), "no copy on the other machine");
    let made = || std::fs::read_dir(sandbox.path("kept")).unwrap().map(|entry| entry.unwrap().path());
    for backup in made().filter(|path| *path != old) {
        std::fs::remove_dir_all(backup).unwrap();
    }
    assert!(try_with("data", "true") && !old.exists());
    assert!(made().all(|path| path.join("roost.db").exists()) && made().count() == 1);
}

#[test]
fn a_lost_disk_is_replaced_by_a_backup() {
    let sandbox = Sandbox::new();
    let data = sandbox.path("data").display().to_string();
    let job = {
        let _server = sandbox.start_server();
        let _worker = sandbox.start_worker("worker");
        let job = sandbox.submit(&support::hopper_scenario(0.05));
        sandbox.wait_for_job(&job, "it ends", |job| job.state == roost_api::job::JobState::Succeeded);
        let backup = sandbox.path("backup").display().to_string();
        support::stdout(&support::run(&["backup", &backup, "--data", &data]));
        job
    };
    let replaced = [("backups/2026-03-01", "backup")];
    run(&sandbox, "docs/howto/operate.md", "a_lost_disk_is_replaced_by_a_backup", &replaced, "");
    let _server = sandbox.start_server();
    let restored = sandbox.get(&format!("/v1/jobs/{}", job.id));
    assert_eq!(restored["state"], "succeeded", "{restored}");
}

#[test]
fn a_client_submits_and_reads() {
    let sandbox = sandbox_with_sweep_file();
    let _server = sandbox.start_server();
    let page = "docs/howto/api-client.md";
    run(&sandbox, page, "a_client_submits_and_reads", &[("http://127.0.0.1:7373", &sandbox.address)], "");
    assert!(std::fs::read_to_string(sandbox.path("results.csv")).unwrap().starts_with("job_id,"));
    assert_eq!(sandbox.get("/v1/sweeps")["items"].as_array().unwrap().len(), 1);
}

//! `roost pool`: a server, a pool and a Slurm of a folder. `tests/slurm/pool.sh` is the same with Debian's Slurm, by hand.

mod support;

use std::process::{Command, Output};

use roost_api::job::JobState;
use serde_json::{Value, json};
use support::slurm::FakeSlurm;
use support::{Process, Sandbox, hopper_scenario, roost, slow_scenario, stdout, transcript, wait_until};

/// A sandbox with a Slurm.
fn cluster() -> (Sandbox, FakeSlurm) {
    let sandbox = Sandbox::new();
    let slurm = FakeSlurm::new(&sandbox.path("slurm"));
    (sandbox, slurm)
}

/// A pool with quick looks, as a command that is not started.
fn pool(sandbox: &Sandbox, slurm: &FakeSlurm, arguments: &[&str]) -> Command {
    let mut command = roost();
    command.args(["pool", "slurm", "--server", &sandbox.address, "--interval", "1s", "--idle-timeout", "8s"]);
    command.arg("--state").arg(sandbox.path("pool")).args(arguments).env("PATH", slurm.path());
    // Variables of the user that would hide jobs, or submit several.
    command.env("SQUEUE_PARTITION", "other").env("SBATCH_ARRAY_INX", "1-4").env("SLURM_CLUSTERS", "other");
    command
}

fn start(sandbox: &Sandbox, slurm: &FakeSlurm, name: &str, arguments: &[&str]) -> Process {
    Process::start(&mut pool(sandbox, slurm, arguments), sandbox.path(&format!("{name}.log")))
}

/// The ledger of the pool, without allocations before its first look.
fn list(sandbox: &Sandbox) -> Value {
    let output =
        roost().args(["pool", "list", "--json", "--state"]).arg(sandbox.path("pool")).output().unwrap();
    if output.status.success() {
        serde_json::from_str(&stdout(&output)).unwrap()
    } else {
        json!({"allocations": []})
    }
}

fn states(ledger: &Value) -> Vec<&str> {
    ledger["allocations"].as_array().unwrap().iter().map(|one| one["state"].as_str().unwrap()).collect()
}

fn stderr(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A sweep of jobs that differ by their seed; returns its id.
fn submit_sweep(sandbox: &Sandbox, base: &Value, jobs: u32) -> String {
    let sweep = json!({"name": "seeds", "base": base, "factors": [], "design": {"kind": "grid"}, "replicates": jobs,
                       "cache": "bypass", "shared_fill": false});
    let file = sandbox.file("sweep.json", &sweep);
    let answer: Value = serde_json::from_str(&stdout(&sandbox.roost(&["submit", "--json", &file]))).unwrap();
    answer["id"].as_str().unwrap().to_owned()
}

fn count(sandbox: &Sandbox, sweep: &str, state: &str) -> u64 {
    sandbox.json_output(&["status", sweep])["counts"][state].as_u64().unwrap()
}

#[test]
fn a_dry_run_prints_script_command_and_decision() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    submit_sweep(&sandbox, &slow_scenario(600.0), 6);
    let arguments = ["--dry-run", "--backlog", "3", "--", "--partition=gpu", "--gres=gpu:1"];
    let output = pool(&sandbox, &slurm, &arguments).output().unwrap();
    let text = stdout(&output);
    assert!(text.starts_with("#!/usr/bin/env bash\n#SBATCH --nodes=1\n"), "{text}");
    assert!(text.contains(&format!("work --server {} --idle-timeout 8s", sandbox.address)), "{text}");
    assert!(text.contains("--signal=B:TERM@60 --no-requeue --output="), "{text}");
    assert!(text.contains("--partition=gpu --gres=gpu:1 < the script above\n"), "{text}");
    assert!(text.ends_with("decision: submit 3 allocations: 6 jobs wait\n"), "{text}");
    assert!(stderr(&output).contains("is an address of this machine"), "{}", transcript(&output));
    assert!(
        slurm.all("state").is_empty() && !sandbox.path("pool").exists(),
        "nothing is submitted or written"
    );
}

#[test]
fn bad_input_names_option_value_and_range() {
    let (sandbox, slurm) = cluster();
    for (arguments, parts) in [
        (&["--backlog", "0"][..], &["--backlog", "'0'", "1 to 1000"][..]),
        (&["--max-workers", "many"], &["--max-workers", "'many'", "1 to 100000"]),
        (&["--workers-per-alloc", "2000"], &["--workers-per-alloc", "'2000'", "1 to 1024"]),
        (&["--max-workers", "2", "--workers-per-alloc", "4"], &["--max-workers", "'2'", "4 to 100000"]),
        (&["--time-limit", "59s"], &["--time-limit", "'59s'", "from 1m to 168h"]),
        (&["--idle-timeout", "0"], &["--idle-timeout", "'0'", "from 1s to 168h"]),
        (&["--grace", "55"], &["--grace", "'55'", "0 to 50"]),
        (
            &["--grace", "40", "--time-limit", "3m"],
            &["--grace", "'40'", "0 to 35", "45 s before the time limit"],
        ),
        (&["--grace", "21", "--time-limit", "1m"], &["--grace", "'21'", "0 to 20", "30 s after its signal"]),
        (&["--slots", "0"], &["--slots", "'0'", "1 to 1024"]),
        (&["--", "--time=10"], &["'--time=10'", "use --time-limit"]),
        (&["--", "job.sh"], &["'job.sh'", "--partition=gpu"]),
        (&["--token-file", "/no/such/file"], &["/no/such/file"]),
        (&["--server", "head"], &["`head` is not a server address"]),
    ] {
        let output = roost()
            .args(["pool", "slurm", "--dry-run", "--state"])
            .arg(sandbox.path("pool"))
            .args(arguments)
            .env("PATH", slurm.path())
            .output()
            .unwrap();
        let text = stderr(&output);
        assert!(
            !output.status.success() && parts.iter().all(|part| text.contains(part)),
            "{arguments:?}: {text}"
        );
    }
    let empty = sandbox.path("none");
    let output = roost().args(["pool", "slurm", "--state"]).arg(&empty).env("PATH", &empty).output().unwrap();
    assert!(stderr(&output).contains("sbatch is not installed on this machine"), "{}", transcript(&output));
    assert_eq!(output.status.code(), Some(2));
    let output = roost().args(["pool", "list", "--state"]).arg(&empty).output().unwrap();
    assert!(stderr(&output).contains("no pool has used the folder"), "{}", transcript(&output));
    assert_eq!(output.status.code(), Some(2));
    let output = roost().args(["pool", "list"]).env("ROOST_STATE", &empty).output().unwrap();
    let folder = empty.join("pool").display().to_string();
    assert!(stderr(&output).contains(&folder), "the state folder of `roost work`: {}", transcript(&output));
}

#[test]
fn allocations_run_all_jobs_and_end_when_idle() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    let sweep = submit_sweep(&sandbox, &hopper_scenario(0.2), 6);
    let running = start(
        &sandbox,
        &slurm,
        "pool",
        &["--max-workers", "2", "--start-within", "1s", "--", "--partition=main"],
    );
    wait_until("all jobs succeed", || (count(&sandbox, &sweep, "succeeded") == 6).then_some(()));
    // Workers exit, and the pool sees the ends of their allocations.
    let ledger = wait_until("all allocations end", || {
        Some(list(&sandbox)).filter(|ledger| {
            !states(ledger).is_empty() && states(ledger).iter().all(|state| *state == "completed")
        })
    });
    assert_eq!(ledger["running"], true);
    assert!(
        ledger["allocations"].as_array().unwrap().iter().all(|one| one["registered"] == true),
        "{ledger}"
    );
    assert_eq!((&ledger["worker"]["backend"], &ledger["worker"]["slots"]), (&json!("cpu"), &json!(1)));
    assert!(slurm.all("options").iter().all(|options| options.ends_with(" --partition=main")));
    let text = stdout(&roost().args(["pool", "list", "--state"]).arg(sandbox.path("pool")).output().unwrap());
    assert!(text.contains("completed  registered") && text.contains("no job waits"), "{text}");
    running.terminate();
    assert!(running.wait().0.success());
    assert_eq!(list(&sandbox)["running"], false);
}

#[test]
fn waiting_allocations_are_adopted_after_a_restart_and_cancelled_with_the_queue() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    let sweep = submit_sweep(&sandbox, &slow_scenario(600.0), 6);
    slurm.set("hold", Some(""));
    let first = start(&sandbox, &slurm, "first", &["--backlog", "3"]);
    wait_until("three wait", || (states(&list(&sandbox)) == ["waiting"; 3]).then_some(()));
    let second = pool(&sandbox, &slurm, &[]).output().unwrap();
    assert!(stderr(&second).contains("another pool runs on the folder"), "{}", transcript(&second));
    first.kill();
    // The pool died between `sbatch` and its note.
    let path = sandbox.path("pool/pool.json");
    let mut ledger: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
    ledger["allocations"].as_array_mut().unwrap().pop();
    std::fs::write(&path, ledger.to_string()).unwrap();
    let again = start(&sandbox, &slurm, "again", &["--backlog", "3"]);
    wait_until("the third is adopted", || (states(&list(&sandbox)) == ["waiting"; 3]).then_some(()));
    assert!(again.log().contains("adopted allocation 103"), "{}", again.log());
    stdout(&sandbox.roost(&["cancel", &sweep]));
    wait_until("all are cancelled", || (states(&list(&sandbox)) == ["cancelled"; 3]).then_some(()));
    assert_eq!(slurm.all("state"), ["CANCELLED"; 3]);
    again.terminate();
    assert!(again.wait().0.success());
}

#[test]
fn repeated_failures_pause_the_pool_and_the_list_says_why() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    submit_sweep(&sandbox, &slow_scenario(600.0), 6);
    slurm.set("refuse", Some("invalid partition specified: gpu"));
    let options = |pause| ["--retry-pause", pause, "--roost", "/no/such/roost"];
    let running = start(&sandbox, &slurm, "pool", &options("1h"));
    let ledger =
        wait_until("it pauses", || Some(list(&sandbox)).filter(|list| list["paused_until"].is_string()));
    assert_eq!(ledger["failures"]["in_a_row"], 3);
    assert_eq!(ledger["failures"]["why"], "sbatch: error: invalid partition specified: gpu");
    let text = stdout(&roost().args(["pool", "list", "--state"]).arg(sandbox.path("pool")).output().unwrap());
    assert!(text.contains("paused until") && text.contains("invalid partition"), "{text}");
    // Slurm takes it now, but the binary is not there: the trial fails, and the next pause is longer.
    slurm.set("refuse", None);
    running.kill();
    let running = start(&sandbox, &slurm, "again", &options("5s"));
    let ledger = wait_until("the trial fails", || {
        Some(list(&sandbox)).filter(|list| list["failures"]["in_a_row"] == 4 && !states(list).is_empty())
    });
    assert_eq!(states(&ledger), ["failed"], "one, as a trial");
    let why = ledger["failures"]["why"].as_str().unwrap();
    assert!(why.starts_with("allocation 101 failed before its worker had registered: "), "{why}");
    assert!(why.contains("/no/such/roost"), "the last line of its log: {why}");
    running.kill();
    // With a corrected option the pool submits at once.
    let running = start(&sandbox, &slurm, "mended", &["--retry-pause", "1h"]);
    wait_until("a worker registers", || {
        let list = list(&sandbox);
        let is_registered = |one: &Value| one["registered"] == true;
        list["allocations"].as_array().unwrap().iter().any(is_registered).then_some(())
    });
    assert_eq!(list(&sandbox)["failures"]["in_a_row"], 0);
    running.terminate();
    assert!(running.wait().0.success());
}

#[test]
fn a_cancelled_allocation_hands_its_job_back_with_a_checkpoint() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server_with(&["--lease-s", "60"]);
    let job = sandbox.submit(&slow_scenario(600.0));
    let arguments = ["--cancel-on-exit", "--grace", "1"];
    let running = start(&sandbox, &slurm, "pool", &arguments);
    sandbox.wait_for_job(&job, "it is under way", |job| support::fraction(job) > 0.0);
    running.terminate();
    assert!(running.wait().0.success());
    let queued = sandbox.wait_for_job(&job, "it is handed back", |job| job.state == JobState::Queued);
    let preempted = r#"roost_attempts_total{outcome="preempted"} 1"#;
    wait_until("it is counted", || sandbox.text("/metrics").contains(preempted).then_some(()));
    assert!(queued.checkpoint.is_some_and(|stored| stored.simulated_s > 0.0));
    assert_eq!(slurm.all("state"), ["CANCELLED"]);
}

#[test]
fn several_workers_share_an_allocation() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server_with(&["--lease-s", "60"]);
    let sweep = submit_sweep(&sandbox, &slow_scenario(600.0), 2);
    let arguments = ["--workers-per-alloc", "2", "--cancel-on-exit", "--grace", "0"];
    let running = start(&sandbox, &slurm, "pool", &arguments);
    wait_until("both jobs run", || (count(&sandbox, &sweep, "running") == 2).then_some(()));
    wait_until("it works", || {
        list(&sandbox)["allocations"][0]["registered"].as_bool().filter(|is_so| *is_so)
    });
    running.terminate();
    assert!(running.wait().0.success());
    wait_until("both are handed back", || (count(&sandbox, &sweep, "queued") == 2).then_some(()));
    assert_eq!(slurm.all("state"), ["CANCELLED"]);
}

/// Slurm signals the batch shell alone before the time limit: each worker must hand its job back.
fn hand_back_before_the_time_limit(workers: u32) {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server_with(&["--lease-s", "10"]);
    let sweep = submit_sweep(&sandbox, &slow_scenario(600.0), workers);
    let number = workers.to_string();
    let arguments = ["--workers-per-alloc", &number, "--max-workers", &number, "--grace", "0"];
    let running = start(&sandbox, &slurm, "pool", &arguments);
    wait_until("all jobs run", || (count(&sandbox, &sweep, "running") == u64::from(workers)).then_some(()));
    wait_until("all workers have registered", || {
        let list = list(&sandbox);
        let found = list["allocations"][0]["workers"].as_array().map_or(0, Vec::len);
        (found == workers as usize).then_some(())
    });
    slurm.set("hold", Some(""));
    slurm.signal_batch_shells();
    wait_until("all are handed back", || {
        (count(&sandbox, &sweep, "queued") == u64::from(workers)).then_some(())
    });
    let preempted = format!(r#"roost_attempts_total{{outcome="preempted"}} {workers}"#);
    wait_until("they are counted", || sandbox.text("/metrics").contains(&preempted).then_some(()));
    // Until its lease ends, a worker that has ended counts as one with free slots.
    wait_until("the next one waits", || (states(&list(&sandbox)) == ["completed", "waiting"]).then_some(()));
    running.terminate();
    assert!(running.wait().0.success());
}

#[test]
fn a_worker_hands_its_job_back_before_the_time_limit() {
    hand_back_before_the_time_limit(1);
}

#[test]
fn several_workers_hand_their_jobs_back_before_the_time_limit() {
    hand_back_before_the_time_limit(2);
}

#[test]
fn allocations_are_forgotten_only_when_slurm_does_not_know_their_ids() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    submit_sweep(&sandbox, &slow_scenario(600.0), 6);
    slurm.set("hold", Some(""));
    let running = start(&sandbox, &slurm, "pool", &["--backlog", "2", "--retry-pause", "1h"]);
    wait_until("two wait", || (states(&list(&sandbox)) == ["waiting"; 2]).then_some(()));
    for hidden in ["unnamed", "purged"] {
        slurm.set(hidden, Some(""));
        for _ in 0..2 {
            let before = list(&sandbox)["updated_at"].clone();
            wait_until("another look", || (list(&sandbox)["updated_at"] != before).then_some(()));
        }
        assert_eq!(states(&list(&sandbox)), ["waiting"; 2], "{hidden}");
        assert_eq!(slurm.all("state").len(), 2, "{hidden}");
    }
    // Slurm loses every allocation: the pool must not submit without end.
    slurm.set("lost", Some(""));
    let ledger =
        wait_until("it pauses", || Some(list(&sandbox)).filter(|list| list["paused_until"].is_string()));
    let found = states(&ledger);
    // Two in each of three looks; Slurm may lose them in the middle of a look, which then misses one.
    assert!((5..=6).contains(&found.len()) && found.iter().all(|state| *state == "forgotten"), "{found:?}");
    let why = ledger["failures"]["why"].as_str().unwrap();
    assert!(why.ends_with("is unknown to Slurm, and its worker had not registered"), "{why}");
    running.terminate();
    assert!(running.wait().0.success());
}

#[test]
fn a_pool_that_is_to_end_submits_no_more_and_cancels_even_what_it_did_not_record() {
    let (sandbox, slurm) = cluster();
    let _server = sandbox.start_server();
    submit_sweep(&sandbox, &slow_scenario(600.0), 30);
    slurm.set("hold", Some(""));
    slurm.set("slow", Some(""));
    let running = start(&sandbox, &slurm, "pool", &["--backlog", "20", "--cancel-on-exit"]);
    wait_until("it submits", || (!slurm.all("state").is_empty()).then_some(()));
    running.terminate();
    assert!(running.wait().0.success());
    let states = slurm.all("state");
    assert!(states.len() <= 6 && states.iter().all(|state| state == "CANCELLED"), "{states:?}");
    // It cannot store its state any more.
    slurm.set("slow", None);
    let running = start(&sandbox, &slurm, "again", &["--cancel-on-exit", "--backlog", "1"]);
    wait_until("it submits", || slurm.all("state").contains(&"PENDING".to_owned()).then_some(()));
    std::fs::rename(sandbox.path("pool"), sandbox.path("moved")).unwrap();
    assert!(!running.wait().0.success());
    assert!(slurm.all("state").iter().all(|state| state == "CANCELLED"), "{:?}", slurm.all("state"));
}

#[test]
fn an_idle_worker_exits_by_itself() {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let job = sandbox.submit(&hopper_scenario(0.2));
    let worker = sandbox.start_worker_with("idle", &["--idle-timeout", "8s"]);
    assert!(worker.wait().0.success());
    assert_eq!(sandbox.job(&job).unwrap().state, JobState::Succeeded);
    drop(server);
    let worker = sandbox.start_worker_with("alone", &["--idle-timeout", "1s"]);
    let log = sandbox.path("3-alone.log");
    assert!(!worker.wait().0.success());
    let said = std::fs::read_to_string(log).unwrap();
    assert!(said.contains("did not answer within the idle timeout"), "{said}");
}

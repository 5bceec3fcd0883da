//! Random faults at the same time: servers and workers are killed, stopped and restarted, and their clocks are set. The network
//! drops, delays and repeats messages. No job may be lost, no result recorded twice, no stale write accepted.
//!
//! `ROOST_KILLS=1000 cargo test --test faults -- --nocapture` runs longer; `ROOST_SEED` selects another sequence of faults.

use std::collections::{BTreeMap, BTreeSet};
use std::time::{Duration, Instant};

use roost_api::job::JobState;
use serde_json::{Value, json};

use crate::cluster::Cluster;
use crate::servers::pair_of_sandboxes;
use crate::support::flaky::{Flaky, Passed};
use crate::support::{self, Process, Sandbox, hopper_scenario};

/// Number of kills by default.
const KILLS: u64 = 20;
const WORKERS: usize = 3;
/// Number of unfinished jobs at any time, so that every kill hits running jobs.
const OPEN: usize = 8;

fn from_environment(name: &str, usual: u64) -> u64 {
    std::env::var(name).map_or(usual, |text| text.parse().expect("a number"))
}

/// Processes and clocks that the test disturbs.
struct Farm {
    /// One per server; the first is that of the workers too.
    sandboxes: Vec<Sandbox>,
    network: Flaky,
    random: fastrand::Rng,
    /// The servers, then the workers; none while it is down.
    processes: Vec<Option<Process>>,
    /// Stopped processes, and the time of their continuation.
    frozen: Vec<(usize, Instant)>,
    submitted: BTreeSet<String>,
    /// A PostgreSQL that crashes too, and the address of the servers' database in it.
    postgres: Option<(Cluster, String)>,
    /// Whether a server may be stopped for longer than a leader may be silent.
    has_long_stops: bool,
}

impl Farm {
    /// Sandbox and name of a process.
    fn place(&self, index: usize) -> (&Sandbox, String) {
        match self.sandboxes.get(index) {
            Some(sandbox) => (sandbox, "serve".to_owned()),
            None => (&self.sandboxes[0], format!("worker-{index}")),
        }
    }

    fn start(&mut self, index: usize) {
        // Without a limit of attempts, only a result ends a job.
        let mut options = vec!["--worker-attempts", "0", "--lost-attempts", "0", "--lease-s", "1"];
        if let Some((_, database)) = &self.postgres {
            options.extend(["--database", database]);
        }
        let (sandbox, name) = self.place(index);
        let is_last = index + 1 == self.processes.len();
        let process = match index < self.sandboxes.len() {
            true => sandbox.start_server_with(&options),
            // The results of several slots go together.
            false => sandbox.start_worker_at(&self.network.address, &name, if is_last { "4" } else { "1" }),
        };
        self.processes[index] = Some(process);
    }

    fn kill(&mut self) {
        // A stopped server holds its connection: PostgreSQL is killed only where the server notices.
        if let Some((postgres, _)) = &self.postgres
            && !self.is_any_server_frozen()
            && self.random.u32(0..4) == 0
        {
            return postgres.kill();
        }
        // Most stopped processes continue, and report stale attempts.
        let index = self.random.usize(0..self.processes.len());
        if self.is_frozen(index) && self.random.u32(0..5) != 0 {
            return self.kill();
        }
        self.frozen.retain(|(frozen, _)| *frozen != index);
        if let Some(process) = self.processes[index].take() {
            process.kill();
        }
        self.start(index);
    }

    fn is_frozen(&self, index: usize) -> bool {
        self.frozen.iter().any(|(frozen, _)| *frozen == index)
    }

    fn is_any_server_frozen(&self) -> bool {
        (0..self.sandboxes.len()).any(|index| self.is_frozen(index))
    }

    /// Stops a process, for longer than a lease or shorter.
    fn freeze(&mut self) {
        let index = self.random.usize(0..self.processes.len());
        if !self.is_frozen(index) {
            self.processes[index].as_ref().unwrap().freeze();
            // By hand also for so long that another server takes the lead.
            let is_long = index < self.sandboxes.len() && self.has_long_stops && self.random.u32(0..4) == 0;
            let time_ms = if is_long { self.random.u64(16_000..25_000) } else { self.random.u64(100..3000) };
            self.frozen.push((index, Instant::now() + Duration::from_millis(time_ms)));
        }
    }

    fn thaw(&mut self, all: bool) {
        let due: Vec<_> = self.frozen.extract_if(.., |(_, until)| all || *until <= Instant::now()).collect();
        due.iter().for_each(|(index, _)| self.processes[*index].as_ref().unwrap().thaw());
    }

    /// Sets the clock of a random process by up to an hour.
    fn set_random_clock(&mut self) {
        let index = self.random.usize(0..self.processes.len());
        let offset_s = self.random.i64(-3600..=3600);
        let (sandbox, name) = self.place(index);
        sandbox.set_clock(&name, offset_s);
    }

    /// Keeps the queue filled; unconfirmed submissions may exist or not.
    fn submit(&mut self, jobs: &[Value]) {
        let open = jobs.iter().filter(|job| job["state"] == "queued" || job["state"] == "running").count();
        for _ in open..OPEN {
            let mut scenario = hopper_scenario(0.6);
            scenario["seed"] = json!(self.random.u32(..));
            let envelope = json!({"scenario": scenario, "cache": "bypass"});
            // Any server takes it.
            let sent = self.sandboxes[self.random.usize(0..self.sandboxes.len())]
                .ask(|client| async move { client.submit_document::<Value>("jobs", &envelope).await });
            let Ok(job) = sent else { return };
            self.submitted.insert(job["id"].as_str().unwrap().to_owned());
        }
    }

    /// All jobs, if the server responds.
    fn jobs(&self, state: Option<JobState>) -> Option<Vec<Value>> {
        let (mut all, mut cursor) = (Vec::new(), None::<String>);
        loop {
            let at = cursor.clone();
            let page =
                self.sandboxes[0].ask(|client| async move { client.jobs(state, at.as_deref(), 500).await });
            let page = page.ok()?;
            all.extend(page.items.iter().map(|job| json!(job)));
            cursor = page.next_cursor;
            if cursor.is_none() {
                return Some(all);
            }
        }
    }
}

#[test]
fn random_kills_lose_no_job_and_record_no_result_twice() {
    disturb(None);
}

#[test]
fn random_kills_of_postgresql_too_lose_no_job_and_record_no_result_twice() {
    disturb(Some(postgres()));
}

#[test]
fn random_kills_of_two_servers_and_postgresql_lose_no_job_and_record_no_result_twice() {
    disturb_servers(2, Some(postgres()));
}

fn postgres() -> (Cluster, String) {
    // On a disk, with flushes: what is acknowledged must survive.
    let postgres = Cluster::start(&std::env::temp_dir(), "");
    let database = postgres.create("roost");
    (postgres, database)
}

fn disturb(postgres: Option<(Cluster, String)>) {
    disturb_servers(1, postgres);
}

fn disturb_servers(servers: usize, postgres: Option<(Cluster, String)>) {
    let (kills, seed) = (from_environment("ROOST_KILLS", KILLS), from_environment("ROOST_SEED", 1));
    let has_clocks = Sandbox::with_clocks().is_some();
    let new = || if has_clocks { Sandbox::with_clocks().expect("as before") } else { Sandbox::new() };
    let sandboxes = if servers == 2 { Vec::from(pair_of_sandboxes(new)) } else { vec![new()] };
    if !has_clocks {
        eprintln!("no clock will be set: libfaketime is not installed (Debian package faketime)");
    }
    let addresses: Vec<&str> = sandboxes.iter().map(|sandbox| &*sandbox.address).collect();
    let network = Flaky::to(&addresses, seed);
    let processes = servers + WORKERS;
    let mut farm = Farm {
        sandboxes,
        network: network.clone(),
        random: fastrand::Rng::with_seed(seed),
        processes: (0..processes).map(|_| None).collect(),
        frozen: Vec::new(),
        submitted: BTreeSet::new(),
        postgres,
        has_long_stops: servers > 1 && kills > KILLS,
    };
    (0..processes).for_each(|index| farm.start(index));
    let started = Instant::now();
    let (mut done, mut stops, mut set) = (0, 0, 0);
    while done < kills {
        std::thread::sleep(Duration::from_millis(farm.random.u64(20..300)));
        farm.thaw(false);
        if has_clocks && farm.random.u32(0..4) == 0 {
            farm.set_random_clock();
            set += 1;
        }
        if farm.random.u32(0..4) == 0 {
            farm.freeze();
            stops += 1;
        } else {
            farm.kill();
            done += 1;
        }
        // A stopped server would not respond, whether it leads or is asked.
        if !farm.is_any_server_frozen() {
            let open: Vec<_> = [JobState::Queued, JobState::Running]
                .into_iter()
                .filter_map(|s| farm.jobs(Some(s)))
                .flatten()
                .collect();
            farm.submit(&open);
        }
    }

    network.stop_faults();
    farm.thaw(true);
    for index in 0..processes {
        if farm.processes[index].is_none() {
            farm.start(index);
        }
    }
    let jobs = support::wait_until("every job has ended", || {
        let jobs = farm.jobs(None)?;
        jobs.iter().all(|job| job["state"] != "queued" && job["state"] != "running").then_some(jobs)
    });
    assert_nothing_lost(&farm, &jobs);
    let refused = network.journal().iter().filter(|passed| **passed == Passed::Refused).count();
    let claimed = network.journal().iter().filter(|passed| matches!(passed, Passed::Claimed { .. })).count();
    let together = network.journal().iter().filter(|passed| **passed == Passed::Together).count();
    eprintln!(
        "{done} kills, {stops} stops and {set} clocks set in {:.0} s: {} jobs in {claimed} claims, {refused} stale writes refused, \
         {together} requests with several results",
        started.elapsed().as_secs_f64(),
        jobs.len()
    );
}

fn assert_nothing_lost(farm: &Farm, jobs: &[Value]) {
    let ids: BTreeSet<String> = jobs.iter().map(|job| job["id"].as_str().unwrap().to_owned()).collect();
    let lost: Vec<_> = farm.submitted.difference(&ids).collect();
    assert!(lost.is_empty(), "confirmed and gone: {lost:?}");
    let failed: Vec<_> = jobs.iter().filter(|job| job["state"] != "succeeded").collect();
    assert!(failed.is_empty(), "not succeeded: {failed:?}");

    let (mut newest, mut recorded) = (BTreeMap::<String, u64>::new(), BTreeMap::<String, Vec<u64>>::new());
    for passed in farm.network.journal().iter().cloned() {
        match passed {
            Passed::Claimed { job, attempt } => {
                let newest = newest.entry(job).or_default();
                *newest = attempt.max(*newest);
            }
            Passed::Recorded { job, attempt } => recorded.entry(job).or_default().push(attempt),
            Passed::Refused | Passed::Together => {}
        }
    }
    let twice: Vec<_> = recorded.iter().filter(|(_, attempts)| attempts.len() > 1).collect();
    assert!(twice.is_empty(), "recorded twice: {twice:?}");
    let stale: Vec<_> = recorded
        .iter()
        .filter(|(job, attempts)| newest.get(*job).is_some_and(|n| attempts[0] < *n))
        .collect();
    assert!(stale.is_empty(), "stale and accepted: {stale:?}");
    for job in jobs {
        let (id, attempt) = (job["id"].as_str().unwrap(), job["attempt"].as_u64().unwrap());
        // The response to the recorded write may be lost before the network.
        assert!(recorded.get(id).is_none_or(|attempts| attempts[0] == attempt), "{job}: {:?}", recorded[id]);
        assert!(job["responses"]["discharged_kg"].is_number(), "{job}");
    }
    assert!(
        recorded.len() * 5 > jobs.len(),
        "the journal has many of them: {} of {}",
        recorded.len(),
        jobs.len()
    );
    assert_eq!(farm.sandboxes[0].results_recorded(), jobs.len() as u64, "attempts that brought a result");
}

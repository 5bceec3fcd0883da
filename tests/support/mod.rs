//! Black-box tests of real processes: servers and workers that tests start, kill and restart.

#![allow(dead_code, reason = "each test binary uses a part of this module")]

pub(crate) mod flaky;
mod process;
pub(crate) mod provider;
pub(crate) mod proxy;
pub(crate) mod slurm;
pub(crate) mod small_disk;
pub(crate) mod stl;
pub(crate) mod turn;
pub(crate) mod wall_clock;

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};

use roost_api::job::JobView;
use roost_worker::client::{Client, prepare_tls};
use serde_json::{Value, json};
use tempfile::TempDir;
use wall_clock::WallClock;

pub(crate) use process::Process;

/// Maximum time of a wait, even on a busy machine.
const TIMEOUT: Duration = Duration::from_secs(120);

/// Ports of test servers.
const PORTS: std::ops::Range<u16> = 20_000..32_000;

/// The binary under test.
pub(crate) fn roost() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roost"));
    command
        .env_remove("ROOST_SERVER")
        .env_remove("ROOST_TOKEN")
        .env_remove("ROOST_LOG")
        .env_remove("ROOST_LOG_FORMAT")
        // No test may depend on what another one has filled.
        .env("ROOST_FILLS", "")
        .stdin(Stdio::null());
    command
}

/// Runs the binary to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    roost().args(arguments).output().expect("the binary starts")
}

/// Status, stdout and stderr of a process, for messages of failed tests.
pub(crate) fn transcript(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    format!("{}\nstdout: {}\nstderr: {}", output.status, text(&output.stdout), text(&output.stderr))
}

/// Stdout of a process that must have succeeded.
pub(crate) fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", transcript(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// A scenario with a few coarse fillets in a small hopper. It runs for this time even if the hopper is empty before.
pub(crate) fn hopper_scenario(duration_s: f64) -> Value {
    json!({
        "experiment": "hopper",
        "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s, "stop": {"when_empty": false}},
    })
}

/// The same with a slow belt, on which the fillets stay, and small steps: some seconds of wall time for ten simulated seconds.
pub(crate) fn slow_scenario(duration_s: f64) -> Value {
    let mut scenario = hopper_scenario(duration_s);
    scenario["equipment"]["belt_speed_m_s"] = json!(0.005);
    scenario["numerics"]["timestep_s"] = json!(2e-5);
    scenario
}

/// Reports that a test is skipped, and fails in CI.
pub(crate) fn skip(reason: &str) {
    assert!(std::env::var_os("CI").is_none(), "skipped in CI: {reason}");
    eprintln!("skipped: {reason}");
}

/// Sends a signal by name.
pub(crate) fn signal(process: u32, name: &str) {
    let status = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap();
    assert!(status.success());
}

/// Calls a function until it returns a value.
pub(crate) fn wait_until<T>(event: &str, mut poll: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(value) = poll() {
            return value;
        }
        assert!(started.elapsed() < TIMEOUT, "timeout: {event}");
        std::thread::sleep(Duration::from_millis(30));
    }
}

/// A port that stays free while its server is down: it is below the ports of outgoing connections, and used once per process.
fn free_port() -> u16 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    (0..PORTS.len())
        .map(|_| NEXT.fetch_add(1, Ordering::Relaxed).wrapping_add(std::process::id().wrapping_mul(97)))
        .map(|number| PORTS.start + (number % PORTS.len() as u32) as u16)
        .find(|port| std::net::TcpListener::bind(("127.0.0.1", *port)).is_ok())
        .expect("a free port")
}

/// A temporary folder and an address for a server and its workers. Both stay the same after a restart.
pub(crate) struct Sandbox {
    pub(crate) folder: TempDir,
    pub(crate) address: String,
    starts: std::cell::Cell<u32>,
    /// Whether the test can set the wall clock of each process.
    has_clocks: bool,
    /// Environment variables of every process.
    variables: Vec<(&'static str, String)>,
    runtime: tokio::runtime::Runtime,
    /// Held until all the rest is gone.
    turn: std::rc::Rc<turn::Turn>,
}

impl Sandbox {
    pub(crate) fn new() -> Self {
        let turn = turn::beside();
        // For requests before the first `Client`.
        prepare_tls();
        Self {
            folder: tempfile::tempdir().unwrap(),
            address: format!("http://127.0.0.1:{}", free_port()),
            starts: std::cell::Cell::new(0),
            has_clocks: false,
            variables: Vec::new(),
            runtime: tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap(),
            turn,
        }
    }

    /// A sandbox in which the wall clock of each process can be set; none if libfaketime is missing.
    pub(crate) fn with_clocks() -> Option<Self> {
        let sandbox = Self { has_clocks: true, ..Self::new() };
        sandbox.clock("any").is_some().then_some(sandbox)
    }

    /// Sets an environment variable of all servers and workers that start later.
    pub(crate) fn set_variable(&mut self, name: &'static str, value: &str) {
        self.variables.push((name, value.to_owned()));
    }

    /// Sets the offset of the wall clock of the server (`serve`) or of a worker from the true time.
    pub(crate) fn set_clock(&self, name: &str, offset_s: i64) {
        self.clock(name).expect("a clock").set(offset_s);
    }

    fn clock(&self, name: &str) -> Option<WallClock> {
        WallClock::new(self.path(&format!("{name}.clock"))).filter(|_| self.has_clocks)
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// Writes a document and returns its path.
    pub(crate) fn file(&self, name: &str, document: &Value) -> String {
        let path = self.path(name);
        std::fs::write(&path, document.to_string()).unwrap();
        path.display().to_string()
    }

    /// Starts a server and waits until it responds. No pause of a busy machine is as long as its leases.
    pub(crate) fn start_server(&self) -> Process {
        self.start_server_with(&["--lease-s", "30"])
    }

    /// Starts a server whose leases end soon after the death of their worker.
    pub(crate) fn start_server_with_short_leases(&self) -> Process {
        self.start_server_with(&["--lease-s", "2"])
    }

    /// Starts a server with further arguments and waits until it responds.
    pub(crate) fn start_server_with(&self, arguments: &[&str]) -> Process {
        let server = self.spawn_server(arguments);
        wait_until("the server responds", || {
            self.ask(|client| async move { client.sweeps(None, 1).await.ok() })
        });
        server
    }

    /// Starts a server without waiting.
    pub(crate) fn spawn_server(&self, arguments: &[&str]) -> Process {
        let listen = self.address.trim_start_matches("http://");
        let mut command = roost();
        command.args([
            "serve",
            "--listen",
            listen,
            "--heartbeat-s",
            "0.2",
            "--retry-pause-s",
            "0.1",
            "--data",
        ]);
        self.start("serve", command.arg(self.path("data")).args(arguments))
    }

    /// Starts a worker with its own state folder.
    pub(crate) fn start_worker(&self, name: &str) -> Process {
        self.start_worker_in(name, &self.path(name))
    }

    /// Starts a worker with further arguments.
    pub(crate) fn start_worker_with(&self, name: &str, arguments: &[&str]) -> Process {
        let mut command = roost();
        command.args(["work", "--server", &self.address, "--threads", "1", "--name", name]).args(arguments);
        self.start(name, command.arg("--state").arg(self.path(name)))
    }

    /// Starts a worker with a state folder that another worker may have used.
    pub(crate) fn start_worker_in(&self, name: &str, state: &Path) -> Process {
        let mut command = roost();
        command.args(["work", "--server", &self.address, "--threads", "1", "--name", name, "--state"]);
        self.start(name, command.arg(state))
    }

    /// Starts a worker with a number of slots and another address of the server.
    pub(crate) fn start_worker_at(&self, address: &str, name: &str, slots: &str) -> Process {
        let mut command = roost();
        command.args(["work", "--server", address, "--threads", "1", "--slots", slots, "--name", name]);
        self.start(name, command.arg("--state").arg(self.path(name)))
    }

    /// Runs a client command with this server.
    pub(crate) fn roost(&self, arguments: &[&str]) -> Output {
        roost().args(arguments).env("ROOST_SERVER", &self.address).output().unwrap()
    }

    /// The output of a client command with `--json`.
    pub(crate) fn json_output(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&stdout(&self.roost(&[arguments, &["--json"]].concat()))).unwrap()
    }

    /// The response of the API to a GET.
    pub(crate) fn get(&self, path: &str) -> Value {
        serde_json::from_str(&self.text(path)).unwrap()
    }

    /// The same as text.
    pub(crate) fn text(&self, path: &str) -> String {
        self.runtime.block_on(async {
            let answer = reqwest::get(format!("{}{path}", self.address)).await.unwrap();
            answer.error_for_status().unwrap().text().await.unwrap()
        })
    }

    /// Whether the response to a GET has this status.
    pub(crate) fn answers(&self, path: &str, status: u16) -> bool {
        let url = format!("{}{path}", self.address);
        self.runtime.block_on(async { reqwest::get(url).await.is_ok_and(|answer| answer.status() == status) })
    }

    /// Submits a scenario. Returns the job.
    pub(crate) fn submit(&self, scenario: &Value) -> JobView {
        let file = self.file("scenario.json", scenario);
        let answer = stdout(&self.roost(&["submit", "--json", &file]));
        serde_json::from_str(&answer).unwrap()
    }

    /// Makes one API call.
    pub(crate) fn ask<T, F: Future<Output = T>>(&self, call: impl FnOnce(Client) -> F) -> T {
        let client = Client::new(&self.address).unwrap();
        self.runtime.block_on(call(client))
    }

    /// The current state of a job; none while the server is unreachable.
    pub(crate) fn job(&self, job: &JobView) -> Option<JobView> {
        let id = job.id;
        self.ask(|client| async move { client.job(id).await.ok() })
    }

    /// Waits until a job meets a condition.
    pub(crate) fn wait_for_job(
        &self,
        job: &JobView,
        event: &str,
        condition: impl Fn(&JobView) -> bool,
    ) -> JobView {
        wait_until(event, || self.job(job).filter(|job| condition(job)))
    }

    /// The status of a GET; none while the server is unreachable.
    pub(crate) fn status(&self, path: &str) -> Option<u16> {
        let url = format!("{}{path}", self.address);
        let output =
            Command::new("curl").args(["-s", "-o", "/dev/null", "-w", "%{http_code}", &url]).output();
        String::from_utf8(output.ok()?.stdout).ok()?.parse().ok().filter(|status| *status > 0)
    }

    /// Number of attempts of all workers with a result.
    pub(crate) fn results_recorded(&self) -> u64 {
        let (mut sum, mut cursor) = (0, None::<String>);
        loop {
            let at = cursor.clone();
            let page = self.ask(|client| async move { client.workers(at.as_deref(), 500).await }).unwrap();
            sum += page.items.iter().map(|worker| worker.succeeded).sum::<u64>();
            cursor = page.next_cursor;
            if cursor.is_none() {
                return sum;
            }
        }
    }

    fn start(&self, name: &str, command: &mut Command) -> Process {
        self.starts.set(self.starts.get() + 1);
        if let Some(clock) = self.clock(name) {
            clock.give_to(command);
        }
        command.envs(self.variables.iter().map(|(name, value)| (name, value)));
        Process::start(command, self.path(&format!("{}-{name}.log", self.starts.get())))
    }
}

/// Fraction done of the running attempt.
pub(crate) fn fraction(job: &JobView) -> f64 {
    job.progress.as_ref().map_or(0.0, |progress| progress.fraction)
}

/// Number of complete deliveries in the outbox of a worker.
pub(crate) fn outbox_len(state: &Path) -> usize {
    let folders = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten();
    folders(&state.join("outbox"))
        .flat_map(|server| folders(&server.path()))
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "json"))
        .count()
}

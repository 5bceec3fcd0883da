//! Real processes for black-box tests: the binary as users have it, killed and restarted as life does.

#![allow(dead_code, reason = "each test binary uses its own part")]

pub(crate) mod flaky;
pub(crate) mod proxy;
pub(crate) mod small_disk;
pub(crate) mod stl;
pub(crate) mod wall_clock;

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, ExitStatus, Output, Stdio};
use std::sync::atomic::{AtomicU32, Ordering};
use std::sync::{Mutex, MutexGuard};
use std::time::{Duration, Instant};

use roost_api::job::JobView;
use roost_worker::client::Client;
use serde_json::{Value, json};
use tempfile::TempDir;
use wall_clock::WallClock;

/// Nothing here takes longer, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(120);

/// Where test servers listen.
const PORTS: std::ops::Range<u16> = 20_000..32_000;

/// The binary under test.
pub(crate) fn roost() -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_roost"));
    command
        .env_remove("ROOST_SERVER")
        .env_remove("ROOST_TOKEN")
        .env_remove("ROOST_LOG")
        .env_remove("ROOST_LOG_FORMAT")
        .stdin(Stdio::null());
    command
}

/// Runs it to its end.
pub(crate) fn run(arguments: &[&str]) -> Output {
    roost().args(arguments).output().expect("the binary starts")
}

/// What it said, for messages of failed tests.
pub(crate) fn said(output: &Output) -> String {
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).into_owned();
    format!("{}\nstdout: {}\nstderr: {}", output.status, text(&output.stdout), text(&output.stderr))
}

/// Standard output of a run that must succeed.
pub(crate) fn stdout(output: &Output) -> String {
    assert!(output.status.success(), "{}", said(output));
    String::from_utf8(output.stdout.clone()).unwrap()
}

/// A few coarse fillets in a small hopper that runs for so long, whether it empties or not.
pub(crate) fn scenario(duration_s: f64) -> Value {
    json!({
        "experiment": "hopper",
        "product": {"count": 2, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": duration_s, "stop": {"when_empty": false}},
    })
}

/// The same on a belt so slow that the fillets stay, in small steps: some seconds of wall time for ten that are simulated.
pub(crate) fn long(duration_s: f64) -> Value {
    let mut long = scenario(duration_s);
    long["equipment"]["belt_speed_m_s"] = json!(0.005);
    long["numerics"]["timestep_s"] = json!(2e-5);
    long
}

/// A process that is killed when the test is over, and shows its log when the test has failed.
pub(crate) struct Process {
    child: Child,
    log: PathBuf,
}

impl Process {
    pub(crate) fn start(command: &mut Command, log: PathBuf) -> Self {
        let file = File::create(&log).unwrap();
        let child = command.stdout(file.try_clone().unwrap()).stderr(file).spawn().unwrap();
        Self { child, log }
    }

    /// Its number in the system.
    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// SIGKILL: no goodbye.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// SIGSTOP: it is there, its connections are open, and it answers nothing.
    pub(crate) fn freeze(&self) {
        signal(self.child.id(), "STOP");
    }

    /// SIGCONT: it goes on as if nothing had been.
    pub(crate) fn thaw(&self) {
        signal(self.child.id(), "CONT");
    }

    /// SIGTERM.
    pub(crate) fn terminate(&self) {
        signal(self.child.id(), "TERM");
    }

    /// Waits for the end; says how it ended and how long that took.
    pub(crate) fn wait(mut self) -> (ExitStatus, Duration) {
        let started = Instant::now();
        let status = until("the process ends", || self.child.try_wait().unwrap());
        (status, started.elapsed())
    }

    pub(crate) fn log(&self) -> String {
        std::fs::read_to_string(&self.log).unwrap_or_default()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
        WallClock::tidy_after(self.child.id());
        if std::thread::panicking() {
            eprintln!("--- {}\n{}", self.log.display(), self.log());
        }
    }
}

/// Says that a test is left out, which in CI it must not be.
pub(crate) fn left_out(why: &str) {
    assert!(std::env::var_os("CI").is_none(), "left out in CI: {why}");
    eprintln!("left out: {why}");
}

/// Sends a signal by name.
pub(crate) fn signal(process: u32, name: &str) {
    let status = Command::new("kill").args([&format!("-{name}"), &process.to_string()]).status().unwrap();
    assert!(status.success());
}

/// Asks over and over until there is an answer.
pub(crate) fn until<T>(what: &str, mut ask: impl FnMut() -> Option<T>) -> T {
    let started = Instant::now();
    loop {
        if let Some(answer) = ask() {
            return answer;
        }
        assert!(started.elapsed() < PATIENCE, "waited in vain: {what}");
        std::thread::sleep(Duration::from_millis(30));
    }
}

/// A port that stays free while its server is down: below those that the system gives to outgoing connections,
/// and no two of one process the same.
fn free_port() -> u16 {
    static NEXT: AtomicU32 = AtomicU32::new(0);
    (0..PORTS.len())
        .map(|_| NEXT.fetch_add(1, Ordering::Relaxed).wrapping_add(std::process::id().wrapping_mul(97)))
        .map(|number| PORTS.start + (number % PORTS.len() as u32) as u16)
        .find(|port| std::net::TcpListener::bind(("127.0.0.1", *port)).is_ok())
        .expect("a free port")
}

/// For tests that measure time: one at a time, so that they do not measure each other.
pub(crate) fn undisturbed() -> MutexGuard<'static, ()> {
    static ONE: Mutex<()> = Mutex::new(());
    ONE.lock().unwrap_or_else(|poisoned| poisoned.into_inner())
}

/// A server's home: data directory and address stay the same from start to start.
pub(crate) struct Home {
    pub(crate) folder: TempDir,
    pub(crate) address: String,
    starts: std::cell::Cell<u32>,
    /// Whether every process has a wall clock of its own, which can be set.
    has_clocks: bool,
    /// Variables that every process gets.
    variables: Vec<(&'static str, String)>,
    runtime: tokio::runtime::Runtime,
}

impl Home {
    pub(crate) fn new() -> Self {
        Self {
            folder: tempfile::tempdir().unwrap(),
            address: format!("http://127.0.0.1:{}", free_port()),
            starts: std::cell::Cell::new(0),
            has_clocks: false,
            variables: Vec::new(),
            runtime: tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap(),
        }
    }

    /// A home whose processes have wall clocks that can be set; none where they cannot.
    pub(crate) fn with_clocks() -> Option<Self> {
        let home = Self { has_clocks: true, ..Self::new() };
        home.clock("any").is_some().then_some(home)
    }

    /// Gives a variable to every server and worker from now on.
    pub(crate) fn set_variable(&mut self, name: &'static str, value: &str) {
        self.variables.push((name, value.to_owned()));
    }

    /// Sets the wall clock of the server (`serve`) or of a worker, so many seconds from the true time.
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

    /// Starts a server with short leases and waits until it answers.
    pub(crate) fn serve(&self) -> Process {
        self.serve_with(&["--lease-s", "2"])
    }

    /// The same, with arguments of its own.
    pub(crate) fn serve_with(&self, arguments: &[&str]) -> Process {
        let server = self.start_server(arguments);
        until("the server answers", || self.ask(|client| async move { client.sweeps(None, 1).await.ok() }));
        server
    }

    /// Starts a server and waits for nothing.
    pub(crate) fn start_server(&self, arguments: &[&str]) -> Process {
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

    /// Starts a worker of its own state directory.
    pub(crate) fn work(&self, name: &str) -> Process {
        self.work_in(name, &self.path(name))
    }

    /// The same, with arguments of its own.
    pub(crate) fn work_with(&self, name: &str, arguments: &[&str]) -> Process {
        let mut command = roost();
        command.args(["work", "--server", &self.address, "--threads", "1", "--name", name]).args(arguments);
        self.start(name, command.arg("--state").arg(self.path(name)))
    }

    /// Starts a worker in a state directory that another may have used.
    pub(crate) fn work_in(&self, name: &str, state: &Path) -> Process {
        let mut command = roost();
        command.args(["work", "--server", &self.address, "--threads", "1", "--name", name, "--state"]);
        self.start(name, command.arg(state))
    }

    /// Starts a worker that is told more.
    pub(crate) fn work_told(&self, name: &str, more: &[&str]) -> Process {
        let mut command = roost();
        command.args(["work", "--server", &self.address, "--threads", "1", "--name", name]).args(more);
        self.start(name, command.arg("--state").arg(self.path(name)))
    }

    /// Starts a worker of so many slots that reaches the server by another address.
    pub(crate) fn work_by(&self, address: &str, name: &str, slots: &str) -> Process {
        let mut command = roost();
        command.args(["work", "--server", address, "--threads", "1", "--slots", slots, "--name", name]);
        self.start(name, command.arg("--state").arg(self.path(name)))
    }

    /// Runs a client command against this server.
    pub(crate) fn roost(&self, arguments: &[&str]) -> Output {
        roost().args(arguments).env("ROOST_SERVER", &self.address).output().unwrap()
    }

    /// What a client command says with `--json`.
    pub(crate) fn answered(&self, arguments: &[&str]) -> Value {
        serde_json::from_str(&stdout(&self.roost(&[arguments, &["--json"]].concat()))).unwrap()
    }

    /// What the API answers to a GET.
    pub(crate) fn get(&self, path: &str) -> Value {
        let text = self.runtime.block_on(async {
            let answer = reqwest::get(format!("{}{path}", self.address)).await.unwrap();
            answer.error_for_status().unwrap().text().await.unwrap()
        });
        serde_json::from_str(&text).unwrap()
    }

    /// Whether a GET is answered with this status.
    pub(crate) fn answers(&self, path: &str, status: u16) -> bool {
        let url = format!("{}{path}", self.address);
        self.runtime.block_on(async { reqwest::get(url).await.is_ok_and(|answer| answer.status() == status) })
    }

    /// Submits a scenario; returns the job as the server shows it.
    pub(crate) fn submit(&self, scenario: &Value) -> JobView {
        let file = self.file("scenario.json", scenario);
        let answer = stdout(&self.roost(&["submit", "--json", &file]));
        serde_json::from_str(&answer).unwrap()
    }

    /// One call through the API.
    pub(crate) fn ask<T, F: Future<Output = T>>(&self, call: impl FnOnce(Client) -> F) -> T {
        let client = Client::new(&self.address).unwrap();
        self.runtime.block_on(call(client))
    }

    /// The job now; `None` while the server is away.
    pub(crate) fn job(&self, job: &JobView) -> Option<JobView> {
        let id = job.id;
        self.ask(|client| async move { client.job(id).await.ok() })
    }

    /// Waits until the job looks as asked.
    pub(crate) fn job_when(&self, job: &JobView, what: &str, is_so: impl Fn(&JobView) -> bool) -> JobView {
        until(what, || self.job(job).filter(|job| is_so(job)))
    }

    /// The status of a GET, whatever it is; `None` while the server is away.
    pub(crate) fn status(&self, path: &str) -> Option<u16> {
        let url = format!("{}{path}", self.address);
        let output =
            Command::new("curl").args(["-s", "-o", "/dev/null", "-w", "%{http_code}", &url]).output();
        String::from_utf8(output.ok()?.stdout).ok()?.parse().ok().filter(|status| *status > 0)
    }

    /// How many attempts all workers together have brought to a result.
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

/// How far the running attempt has come.
pub(crate) fn fraction(job: &JobView) -> f64 {
    job.progress.as_ref().map_or(0.0, |progress| progress.fraction)
}

/// Deliveries that wait in a worker's outbox; one that is still being written is none yet.
pub(crate) fn outbox(state: &Path) -> usize {
    let folders = |folder: &Path| std::fs::read_dir(folder).into_iter().flatten().flatten();
    folders(&state.join("outbox"))
        .flat_map(|server| folders(&server.path()))
        .filter(|entry| entry.path().extension().is_some_and(|extension| extension == "json"))
        .count()
}

//! A PostgreSQL of its own for tests: Debian's programs, in a temporary folder, reached by a socket there.
//!
//! A shell starts it and waits for the end of the test's process, however it ends: the pipe to the shell then closes. The shell stops
//! PostgreSQL and removes the folder.

use std::io;
use std::os::unix::fs::{PermissionsExt, chown};
use std::os::unix::process::CommandExt;
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// The user nobody: PostgreSQL refuses to run as root.
const NOBODY: u32 = 65534;

/// Starts PostgreSQL again whenever it ends, until the input ends.
const SUPERVISE: &str = r#"
umask 077
if [ -e "$DIR/base.tar" ]; then
    mkdir "$DIR/data" && tar x -C "$DIR/data" -f "$DIR/base.tar" >"$DIR/log" 2>&1 && touch "$DIR/data/recovery.signal" || exit 1
    echo "$SETTINGS" >>"$DIR/data/postgresql.auto.conf"
    SETTINGS=
else
    "$BIN/initdb" -D "$DIR/data" -U roost --auth=trust --encoding=UTF8 --locale=C --no-sync >"$DIR/log" 2>&1 </dev/null || exit 1
fi
touch "$DIR/run"
while [ -e "$DIR/run" ]; do
    if [ -e "$DIR/hold" ]; then sleep 0.1; continue; fi
    "$BIN/postgres" -D "$DIR/data" -k "$DIR" -c listen_addresses= -c max_connections=200 $SETTINGS >>"$DIR/log" 2>&1 </dev/null &
    echo $! >"$DIR/pid"
    wait $!
    sleep 0.1
done &
cat >/dev/null
rm -f "$DIR/run"
kill -INT "$(cat "$DIR/pid")" 2>/dev/null
wait
rm -rf "$DIR"
"#;

/// A running PostgreSQL.
pub(crate) struct Cluster {
    folder: PathBuf,
    programs: PathBuf,
    shell: Mutex<(Child, Option<ChildStdin>)>,
}

impl Cluster {
    /// Starts one below a folder. `settings` are options of `postgres`.
    pub(crate) fn start(below: &Path, settings: &str) -> Self {
        Self::start_from(None, below, settings)
    }

    /// Starts one from the archive `base.tar` of a base backup. `settings` are lines of its configuration, which say how to recover it.
    #[allow(dead_code, reason = "the tests of the store recover none")]
    pub(crate) fn recover(base: &Path, below: &Path, settings: &str) -> Self {
        Self::start_from(Some(base), below, settings)
    }

    fn start_from(base: Option<&Path>, below: &Path, settings: &str) -> Self {
        let programs = programs();
        let folder = tempfile::Builder::new().prefix("roost-postgres-").tempdir_in(below).unwrap().keep();
        let is_root =
            std::fs::metadata("/proc/self").is_ok_and(|it| std::os::unix::fs::MetadataExt::uid(&it) == 0);
        if let Some(base) = base {
            let copy = folder.join("base.tar");
            std::fs::copy(base, &copy).unwrap();
            std::fs::set_permissions(&copy, std::fs::Permissions::from_mode(0o644)).unwrap();
        }
        let mut command = match is_root {
            true => {
                chown(&folder, Some(NOBODY), Some(NOBODY)).unwrap();
                // A test that runs as root reaches the socket in it.
                std::fs::set_permissions(&folder, std::fs::Permissions::from_mode(0o700)).unwrap();
                let mut command = Command::new("setpriv");
                let (user, group) = (format!("--reuid={NOBODY}"), format!("--regid={NOBODY}"));
                command.args([&user, &group, "--clear-groups", "sh"]);
                command
            }
            false => Command::new("sh"),
        };
        let mut shell = command
            .args(["-c", SUPERVISE])
            .current_dir("/")
            .envs([("BIN", programs.as_path()), ("DIR", &folder)])
            .env("SETTINGS", settings)
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            // An interrupt of the tests does not interrupt the cleaning.
            .process_group(0)
            .spawn()
            .expect("sh and setpriv start");
        let input = shell.stdin.take();
        let cluster = Self { folder, programs, shell: Mutex::new((shell, input)) };
        cluster.wait();
        cluster
    }

    /// Waits until it accepts connections.
    pub(crate) fn wait(&self) {
        let started = Instant::now();
        while !self.run("pg_isready", &["-q"]).is_ok_and(|done| done) {
            let log = || std::fs::read_to_string(self.folder.join("log")).unwrap_or_default();
            assert!(started.elapsed() < Duration::from_secs(60), "PostgreSQL does not start:\n{}", log());
            std::thread::sleep(Duration::from_millis(50));
        }
    }

    /// Creates an empty database, and returns its address.
    pub(crate) fn create(&self, name: &str) -> String {
        assert!(self.run("createdb", &["-U", "roost", name]).unwrap(), "the database {name} is not created");
        self.address(name)
    }

    /// The address of a database.
    pub(crate) fn address(&self, name: &str) -> String {
        format!("postgres://roost@localhost/{name}?host={}", self.folder.display())
    }

    /// Kills it like a crash, and returns when it runs again.
    #[allow(dead_code, reason = "the tests of the server kill none")]
    pub(crate) fn kill(&self) {
        let number = std::fs::read_to_string(self.folder.join("pid")).unwrap();
        let killed = Command::new("kill").args(["-9", number.trim()]).status().unwrap();
        assert!(killed.success());
        std::thread::sleep(Duration::from_millis(200));
        self.wait();
    }

    /// Stops it, until [`Self::start_again`].
    #[allow(dead_code, reason = "the tests of the store stop none")]
    pub(crate) fn stop(&self) {
        std::fs::write(self.folder.join("hold"), "").unwrap();
        let number = std::fs::read_to_string(self.folder.join("pid")).unwrap();
        let stopped = Command::new("kill").args(["-INT", number.trim()]).status().unwrap();
        assert!(stopped.success());
        for _ in 0..1500 {
            if !self.folder.join("data/postmaster.pid").exists() {
                return;
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        panic!("PostgreSQL does not stop");
    }

    /// Starts it after a stop, and returns when it runs.
    #[allow(dead_code, reason = "the tests of the store stop none")]
    pub(crate) fn start_again(&self) {
        std::fs::remove_file(self.folder.join("hold")).unwrap();
        self.wait();
    }

    /// Freezes all its processes, which are the children of one, or lets them go on.
    pub(crate) fn signal_all(&self, signal: &str) {
        let parent = std::fs::read_to_string(self.folder.join("pid")).unwrap();
        let children = Command::new("pgrep").args(["-P", parent.trim()]).output().unwrap();
        let children = String::from_utf8(children.stdout).unwrap();
        let all = [parent.trim()].into_iter().chain(children.split_whitespace());
        for process in all {
            // A child may have ended meanwhile.
            let _ = Command::new("kill").args([signal, process]).status();
        }
    }

    /// Executes statements in a database, each in its own transaction. Returns what they show.
    #[allow(dead_code, reason = "the tests of the store have connections")]
    pub(crate) fn execute(&self, database: &str, statements: &[&str]) -> String {
        let output = self.try_execute(database, statements);
        assert!(output.status.success(), "{statements:?}: {}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap().trim().to_owned()
    }

    /// The same, which may fail.
    #[allow(dead_code, reason = "the tests of the store have connections")]
    pub(crate) fn try_execute(&self, database: &str, statements: &[&str]) -> std::process::Output {
        let mut command = Command::new(self.programs.join("psql"));
        command.arg("-h").arg(&self.folder).args([
            "-U",
            "roost",
            "-XAtq",
            "-v",
            "ON_ERROR_STOP=1",
            "-d",
            database,
        ]);
        command.args(statements.iter().flat_map(|statement| ["-c", statement]));
        command.stdin(Stdio::null()).output().unwrap()
    }

    /// Its folder, in which it may write.
    #[allow(dead_code, reason = "the tests of the store read no file of it")]
    pub(crate) fn folder(&self) -> &Path {
        &self.folder
    }

    /// Runs a program of PostgreSQL against it. Returns whether the program succeeded.
    pub(crate) fn run(&self, program: &str, arguments: &[&str]) -> io::Result<bool> {
        let mut command = Command::new(self.programs.join(program));
        command.arg("-h").arg(&self.folder).args(arguments).stdin(Stdio::null());
        Ok(command.stdout(Stdio::null()).status()?.success())
    }
}

/// One that does not live until the end of the process ends here.
impl Drop for Cluster {
    fn drop(&mut self) {
        // A failed test may have left its processes frozen, which would not end.
        if self.folder.join("pid").exists() {
            self.signal_all("-CONT");
        }
        if let Ok(mut shell) = self.shell.lock() {
            shell.1 = None;
            let _ = shell.0.wait();
            // Nobody could not remove the folder itself.
            let _ = std::fs::remove_dir_all(&self.folder);
        }
    }
}

/// The folder with the programs of the newest installed version.
fn programs() -> PathBuf {
    let versions = std::fs::read_dir("/usr/lib/postgresql").into_iter().flatten().flatten();
    let version = |folder: &PathBuf| folder.file_name().and_then(|name| name.to_str()?.parse::<u32>().ok());
    let newest = versions.map(|entry| entry.path()).max_by_key(version);
    newest.expect("these tests need Debian's package postgresql: `make test` installs it").join("bin")
}

//! A server process, started, watched, killed and started again.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tokio::process::{Child, Command};

/// A server process on a port and a data directory that stay the same.
pub(super) struct Server {
    child: Child,
    pub(super) url: String,
    listen: String,
}

impl Drop for Server {
    /// Waits for its end: its folder goes next, and what it still wrote there would stay.
    fn drop(&mut self) {
        let _ = self.child.start_kill();
        let deadline = Instant::now() + Duration::from_secs(5);
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Server {
    /// Starts one and waits until it answers.
    pub(super) async fn start(data: &Path) -> Result<Self> {
        let free = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
        Self::start_at(data, &free.to_string()).await
    }

    async fn start_at(data: &Path, listen: &str) -> Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        // Attempts without limit: a kill ends none of them.
        let limits = ["--lost-attempts", "0", "--worker-attempts", "0", "--retry-pause-s", "0.1"];
        command
            .args(["serve", "--listen", listen, "--data"])
            .arg(data)
            .args(limits)
            .env("ROOST_LOG", "error");
        let child =
            command.stdout(Stdio::null()).kill_on_drop(true).spawn().context("cannot start a server")?;
        let server = Self { child, url: format!("http://{listen}"), listen: listen.to_owned() };
        let deadline = Instant::now() + Duration::from_secs(30);
        while tokio::net::TcpStream::connect(listen).await.is_err() {
            if Instant::now() > deadline {
                bail!("the server does not listen on {listen}");
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        Ok(server)
    }

    /// SIGKILL, and another one in its place.
    pub(super) async fn kill_and_restart(mut self, data: &Path) -> Result<Self> {
        self.child.kill().await?;
        Self::start_at(data, &self.listen).await
    }

    /// SIGTERM; returns how long it took to exit.
    pub(super) async fn terminate(mut self) -> Result<Duration> {
        let started = Instant::now();
        let status = Command::new("kill").args(["-TERM", &self.id().to_string()]).status().await?;
        if !status.success() {
            bail!("cannot signal the server");
        }
        self.child.wait().await?;
        Ok(started.elapsed())
    }

    fn id(&self) -> u32 {
        self.child.id().unwrap_or_default()
    }

    /// CPU time that it has used, in seconds.
    pub(super) fn cpu_s(&self) -> Result<f64> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.id()))?;
        // After the name in brackets: state is field 3, user and system time are fields 14 and 15, in hundredths of a second.
        let fields =
            stat.rsplit_once(") ").map(|(_, rest)| rest.split(' ').collect::<Vec<_>>()).unwrap_or_default();
        let ticks = |field: usize| fields.get(field - 3).and_then(|text| text.parse::<f64>().ok());
        Ok((ticks(14).context("no CPU time")? + ticks(15).context("no CPU time")?) / 100.0)
    }

    /// Memory that it holds, in MiB.
    pub(super) fn memory_mib(&self) -> Result<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no memory")?;
        let kib: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
        Ok(kib / 1024.0)
    }
}

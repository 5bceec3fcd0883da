//! A server process that is started, observed, killed and restarted.

use std::process::Stdio;
use std::time::{Duration, Instant};

use anyhow::{Context, Result, bail};
use tokio::process::{Child, Command};

use super::data::Data;

/// A server process. Port and data folder stay the same after a restart.
pub(super) struct Server {
    child: Child,
    pub(super) url: String,
    listen: String,
}

impl Drop for Server {
    /// Waits for the end of the process, which would otherwise write to its folder while that is removed.
    fn drop(&mut self) {
        let _ = self.child.start_kill();
        let deadline = Instant::now() + Duration::from_secs(5);
        while matches!(self.child.try_wait(), Ok(None)) && Instant::now() < deadline {
            std::thread::sleep(Duration::from_millis(5));
        }
    }
}

impl Server {
    /// Starts a server and waits until it accepts connections.
    pub(super) async fn start(data: &Data) -> Result<Self> {
        let free_address = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?;
        Self::start_at(data, &free_address.to_string()).await
    }

    async fn start_at(data: &Data, listen: &str) -> Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        // Without a limit of attempts, no kill fails a job.
        let limits = ["--lost-attempts", "0", "--worker-attempts", "0", "--retry-pause-s", "0.1"];
        command
            .args(["serve", "--listen", listen])
            .args(data.options())
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

    /// Kills the process with SIGKILL and starts another one.
    pub(super) async fn kill_and_restart(mut self, data: &Data) -> Result<Self> {
        self.child.kill().await?;
        Self::start_at(data, &self.listen).await
    }

    /// Sends SIGTERM and returns the time until the exit.
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

    /// CPU time used so far, in seconds.
    pub(super) fn cpu_s(&self) -> Result<f64> {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.id()))?;
        // The name in brackets is field 2. User and system time are fields 14 and 15, in hundredths of a second.
        let fields =
            stat.rsplit_once(") ").map(|(_, rest)| rest.split(' ').collect::<Vec<_>>()).unwrap_or_default();
        let ticks = |field: usize| fields.get(field - 3).and_then(|text| text.parse::<f64>().ok());
        Ok((ticks(14).context("no CPU time")? + ticks(15).context("no CPU time")?) / 100.0)
    }

    /// Resident memory in MiB.
    pub(super) fn memory_mib(&self) -> Result<f64> {
        let status = std::fs::read_to_string(format!("/proc/{}/status", self.id()))?;
        let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:")).context("no memory")?;
        let kib: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
        Ok(kib / 1024.0)
    }
}

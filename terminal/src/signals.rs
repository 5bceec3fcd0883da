//! SIGINT and SIGTERM, or Ctrl-C and Ctrl-Break: the first one asks the process to end in good order, a later one ends it at once.
//!
//! One request to stop may arrive several times: `scancel` signals a batch shell and its children, the shell passes the
//! signal on, and `timeout` or a terminal signals a whole process group. Signals shortly after the first one are therefore
//! repeats of the same request.

use std::time::{Duration, Instant};

use tokio_util::sync::CancellationToken;

use crate::message;

/// Signals within this time of the first one are repeats.
const REPEATS: Duration = Duration::from_secs(5);

/// The exit code after SIGINT, as shells report it.
const INTERRUPTED: i32 = 128 + 2;

/// The exit code after SIGTERM.
const TERMINATED: i32 = 128 + 15;

/// A token that the first SIGINT or SIGTERM cancels. On Windows it is Ctrl-C, Ctrl-Break, or the closing of the console.
///
/// # Errors
/// If the signal handlers cannot be installed.
pub fn shutdown_token() -> std::io::Result<CancellationToken> {
    let token = CancellationToken::new();
    let mut signals = Signals::new()?;
    tokio::spawn({
        let token = token.clone();
        async move {
            let mut first = None;
            loop {
                let exit_code = signals.next().await;
                let elapsed = first.get_or_insert_with(Instant::now).elapsed();
                if elapsed >= REPEATS {
                    std::process::exit(exit_code);
                }
                if token.is_cancelled() {
                    let left_s = (REPEATS - elapsed).as_secs_f64();
                    message!("already stopping; a signal {left_s:.1} s from now ends the process at once");
                }
                token.cancel();
            }
        }
    });
    Ok(token)
}

/// The signals that end a process in good order.
#[cfg(unix)]
struct Signals {
    interrupt: tokio::signal::unix::Signal,
    terminate: tokio::signal::unix::Signal,
}

#[cfg(unix)]
impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::unix::{SignalKind, signal};
        Ok(Self { interrupt: signal(SignalKind::interrupt())?, terminate: signal(SignalKind::terminate())? })
    }

    /// Waits for a signal. Returns the exit code of a process that it ends.
    async fn next(&mut self) -> i32 {
        tokio::select! {
            _ = self.interrupt.recv() => INTERRUPTED,
            _ = self.terminate.recv() => TERMINATED,
        }
    }
}

/// The events of a console that end a process in good order. Windows knows no SIGTERM: its service manager and `taskkill` without `/F`
/// close the console, and the system ends the process a few seconds later.
#[cfg(not(unix))]
struct Signals {
    interrupt: tokio::signal::windows::CtrlC,
    pause: tokio::signal::windows::CtrlBreak,
    close: tokio::signal::windows::CtrlClose,
}

#[cfg(not(unix))]
impl Signals {
    fn new() -> std::io::Result<Self> {
        use tokio::signal::windows::{ctrl_break, ctrl_c, ctrl_close};
        Ok(Self { interrupt: ctrl_c()?, pause: ctrl_break()?, close: ctrl_close()? })
    }

    /// Waits for an event. Returns the exit code of a process that it ends.
    async fn next(&mut self) -> i32 {
        tokio::select! {
            _ = self.interrupt.recv() => INTERRUPTED,
            _ = self.pause.recv() => INTERRUPTED,
            _ = self.close.recv() => TERMINATED,
        }
    }
}

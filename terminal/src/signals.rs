//! SIGINT and SIGTERM: the first one asks the process to end in good order, a later one ends it at once.
//!
//! One request to stop may arrive several times: `scancel` signals a batch shell and its children, the shell passes the
//! signal on, and `timeout` or a terminal signals a whole process group. Signals shortly after the first one are therefore
//! repeats of the same request.

use std::time::{Duration, Instant};

use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

use crate::message;

/// Signals within this time of the first one are repeats.
const REPEATS: Duration = Duration::from_secs(5);

/// A token that the first SIGINT or SIGTERM cancels.
///
/// # Errors
/// If the signal handlers cannot be installed.
pub fn shutdown_token() -> std::io::Result<CancellationToken> {
    let token = CancellationToken::new();
    let mut interrupt = signal(SignalKind::interrupt())?;
    let mut terminate = signal(SignalKind::terminate())?;
    tokio::spawn({
        let token = token.clone();
        async move {
            let mut first = None;
            loop {
                let number = tokio::select! {
                    _ = interrupt.recv() => 2,
                    _ = terminate.recv() => 15,
                };
                let elapsed = first.get_or_insert_with(Instant::now).elapsed();
                if elapsed >= REPEATS {
                    std::process::exit(128 + number);
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

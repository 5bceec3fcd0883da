//! SIGINT and SIGTERM end the process in good order; a second one ends it at once.
//!
//! One request to stop may arrive several times: `scancel` signals a batch shell and its children, the shell passes the
//! signal on, and `timeout` or a terminal signals a whole process group. Repeats shortly after the first signal are
//! therefore the same request. Only a later one says that waiting has taken too long.

use std::time::{Duration, Instant};

use tokio::signal::unix::{SignalKind, signal};
use tokio_util::sync::CancellationToken;

use crate::ui;

/// Signals within this time of the first are repeats of it.
const REPEATS: Duration = Duration::from_secs(5);

/// A token that the first SIGINT or SIGTERM cancels.
pub(crate) fn shutdown() -> std::io::Result<CancellationToken> {
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
                    ui::say!("already stopping; a signal {left_s:.1} s from now ends the process at once");
                }
                token.cancel();
            }
        }
    });
    Ok(token)
}

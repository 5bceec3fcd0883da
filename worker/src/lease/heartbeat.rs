//! One heartbeat covers everything the worker holds; the reply says what to do with each.
//!
//! A server that is away changes nothing here: the runs go on, the beats go on, and the attempts stay
//! valid until the server says otherwise.

use std::convert::Infallible;

use roost_api::lease::HeartbeatRequest;
use roost_api::worker::WorkerWelcome;
use tokio::time::{Instant, MissedTickBehavior, interval_at};

use super::session::{Session, seconds};

/// Beats for as long as it is polled.
pub(super) async fn run(session: &Session, welcome: &WorkerWelcome) -> Infallible {
    let every = seconds(welcome.heartbeat_s);
    // An unanswered beat must leave time for another within the lease.
    let timeout = seconds(welcome.lease_s / 3.0);
    let mut clock = interval_at(Instant::now() + every, every);
    clock.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut is_away = false;
    loop {
        clock.tick().await;
        let beat = HeartbeatRequest { attempts: session.held.beats() };
        match session.client.heartbeat(session.worker_id, &beat, timeout).await {
            Ok(reply) => {
                if std::mem::take(&mut is_away) {
                    tracing::info!("the server is back");
                }
                session.held.obey(&reply.attempts);
                if reply.drain && !session.stop_claiming.is_cancelled() {
                    tracing::info!("the server asks this worker to drain");
                    session.stop_claiming.cancel();
                }
            }
            Err(error) if error.problem_status() == Some(404) => session.register_again().await,
            Err(error) => {
                if !std::mem::replace(&mut is_away, true) {
                    tracing::warn!(%error, "heartbeat failed; running on");
                }
            }
        }
    }
}

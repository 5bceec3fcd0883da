//! One heartbeat covers all attempts of the worker; the reply has a directive for each.
//!
//! While the server does not answer, runs and heartbeats continue, and the attempts stay valid.

use std::convert::Infallible;

use roost_api::lease::HeartbeatRequest;
use roost_api::worker::WorkerWelcome;
use tokio::time::{Instant, MissedTickBehavior, interval_at};

use super::session::{Session, seconds};

/// Sends heartbeats until it is dropped.
pub(super) async fn run(session: &Session, welcome: &WorkerWelcome) -> Infallible {
    let every = seconds(welcome.heartbeat_s);
    // An unanswered heartbeat leaves time for another within the lease.
    let timeout = seconds(welcome.lease_s / 3.0);
    let mut clock = interval_at(Instant::now() + every, every);
    clock.set_missed_tick_behavior(MissedTickBehavior::Delay);
    let mut is_unreachable = false;
    loop {
        clock.tick().await;
        let beat = HeartbeatRequest { attempts: session.attempts.beats() };
        match session.client.heartbeat(session.worker_id, &beat, timeout).await {
            Ok(reply) => {
                if std::mem::take(&mut is_unreachable) {
                    tracing::info!("the server answers again");
                }
                session.attempts.apply(&reply.attempts);
                if reply.drain && !session.stop_claiming.is_cancelled() {
                    tracing::info!("the server asks this worker to drain");
                    session.stop_claiming.cancel();
                }
            }
            Err(error) if error.problem_status() == Some(404) => session.register_again().await,
            Err(error) => {
                if !std::mem::replace(&mut is_unreachable, true) {
                    tracing::warn!(%error, "heartbeat failed; the runs continue");
                }
            }
        }
    }
}

//! Brings the outbox to the server, for as long as that takes.

use std::convert::Infallible;
use std::io;

use super::session::Session;
use crate::backoff::Backoff;
use crate::outbox::Delivery;

/// Puts a delivery in the outbox and rings for the postman. A disk that will not take it does not lose it: then it
/// goes straight to the server, or waits in memory until one of the two does.
pub(super) async fn post(session: &Session, delivery: Delivery) {
    let mut backoff = Backoff::default();
    loop {
        let (outbox, copy) = (session.outbox.clone(), delivery.clone());
        match on_disk(move || outbox.put(&copy)).await {
            Ok(_) => return session.mail.notify_one(),
            Err(error) => {
                tracing::error!(%error, folder = %session.config.state_dir.display(), "cannot write to the outbox");
                if delivery.send(&session.client).await.is_ok() {
                    return session.held.remove((delivery.job_id, delivery.attempt));
                }
                backoff.pause().await;
            }
        }
    }
}

/// Delivers whatever comes, for as long as it is polled.
pub(super) async fn run(session: &Session) -> Infallible {
    let mut backoff = Backoff::default();
    loop {
        match deliver_waiting(session).await {
            Ok(true) => {
                backoff.reset();
                session.mail.notified().await;
            }
            Ok(false) => backoff.pause().await,
            Err(error) => {
                tracing::error!(%error, "cannot read the outbox");
                backoff.pause().await;
            }
        }
    }
}

/// Tries every waiting delivery once; says whether the outbox is empty now.
pub(super) async fn deliver_waiting(session: &Session) -> io::Result<bool> {
    let outbox = session.outbox.clone();
    let mut is_empty = true;
    for (path, delivery) in on_disk(move || outbox.waiting()).await? {
        match delivery.send(&session.client).await {
            Ok(_) => session.outbox.remove(&path)?,
            Err(error) if error.is_transient() => {
                tracing::debug!(%error, "delivery failed; it waits in the outbox");
                is_empty = false;
                continue;
            }
            Err(error) => {
                tracing::error!(job = %delivery.job_id, %error, "set aside a delivery that the server refuses");
                session.outbox.set_aside(&path)?;
            }
        }
        session.held.remove((delivery.job_id, delivery.attempt));
    }
    Ok(is_empty)
}

/// File work off the async threads: an fsync can take a while.
async fn on_disk<T: Send + 'static>(work: impl FnOnce() -> io::Result<T> + Send + 'static) -> io::Result<T> {
    tokio::task::spawn_blocking(work).await.map_err(io::Error::other)?
}

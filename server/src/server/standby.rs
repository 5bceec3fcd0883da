//! A server that does not lead: it watches who leads, and leads itself when nobody does.

use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;

use super::leading::Leading;
use super::{ServerError, Site};
use crate::http::Role;
use crate::store::{Election, Leader, Location};

/// Interval of the questions who leads.
const WATCH_EVERY: Duration = Duration::from_millis(500);

/// Time for which the last answer holds while PostgreSQL does not answer. A leader may be silent for as long.
const HOLDS: Duration = Duration::from_secs(15);

/// Whether another server leads the database at the start of this one. A file has one server.
pub(super) async fn led_by_another(site: &Site) -> Result<bool, ServerError> {
    let Location::Postgres(database) = &site.place else { return Ok(false) };
    let mut election = Election::new(database.clone());
    match election.leader().await? {
        Leader::Nobody | Leader::Unnamed => Ok(false),
        // An earlier process of this server, whose session still lives.
        Leader::At(leader) if site.is_own(&leader) => Ok(false),
        Leader::At(_) => may_pass_on(site, &mut election).await.map(|()| true),
    }
}

/// Refuses to open a way to a leader without access tokens, which listens on a loopback address and admits everybody there.
async fn may_pass_on(site: &Site, election: &mut Election) -> Result<(), ServerError> {
    if site.address.ip().is_loopback() || election.has_tokens().await? {
        return Ok(());
    }
    Err(ServerError::NotLoopback(site.address))
}

/// Passes requests on until nobody leads, and then leads.
pub(super) async fn wait_to_lead(site: &Site, role: &watch::Sender<Role>) -> Leading {
    let Location::Postgres(database) = &site.place else {
        unreachable!("a server of a file leads from its start to its end")
    };
    let mut election = Election::new(database.clone());
    let (mut answered, mut logged) = (Instant::now(), String::new());
    loop {
        let (next, log) = match election.leader().await {
            Ok(Leader::Nobody) => match Leading::start(site).await {
                Ok(leading) => return leading,
                Err(error) => (Some(Role::Waits), format!("no server leads, and this one cannot: {}", reason(&error))),
            },
            Ok(Leader::At(leader)) => {
                answered = Instant::now();
                follow(site, &leader, &mut election).await
            }
            Ok(Leader::Unnamed) => (
                Some(Role::Waits),
                "a session without the address of a server holds the lock: that of a command that writes, of another role, or of a server \
                 that needs --advertise"
                    .to_owned(),
            ),
            // The leader may well answer.
            Err(error) => {
                let next = (answered.elapsed() > HOLDS).then_some(Role::Waits);
                (next, format!("asking who leads failed: {}", reason(&error.into())))
            }
        };
        if log != logged {
            tracing::info!("standing by: {log}");
            logged = log;
        }
        if let Some(next) = next {
            role.send_if_modified(|role| {
                let is_new = !role.is_same(&next);
                if is_new {
                    *role = next;
                }
                is_new
            });
        }
        tokio::time::sleep(WATCH_EVERY).await;
    }
}

/// The role beside a leader, and what the log says about it.
async fn follow(site: &Site, leader: &str, election: &mut Election) -> (Option<Role>, String) {
    if site.is_own(leader) {
        let log = format!(
            "the session of a server at {leader} leads, which is the address of this one: of its last process, or of another server with the \
             same --advertise"
        );
        return (Some(Role::Waits), log);
    }
    if let Err(error) = may_pass_on(site, election).await {
        return (Some(Role::Waits), reason(&error));
    }
    match Role::passes_on(leader) {
        Some(role) => (Some(role), format!("requests are passed on to {leader}")),
        None => (
            Some(Role::Waits),
            format!("the leading server names the address '{leader}', which is no host and port"),
        ),
    }
}

/// What an operator can do about it.
fn reason(error: &ServerError) -> String {
    let sentence = match error {
        ServerError::Store(error) => error.unavailable().map(|reason| reason.sentence().to_owned()),
        _ => None,
    };
    sentence.unwrap_or_else(|| error.to_string())
}

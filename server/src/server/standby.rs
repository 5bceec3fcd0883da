//! A server that does not lead: it watches who leads, and leads itself when nobody does.

use std::time::Duration;

use tokio::sync::watch;
use tokio::time::Instant;

use super::leading::Leading;
use super::{ServerError, Site};
use crate::http::Role;
use crate::store::{Election, Leader, Location, StoreError};

/// Interval of the questions who leads.
const WATCH_EVERY: Duration = Duration::from_millis(500);

/// Time for which the last answer holds while PostgreSQL does not answer. A leader may be silent for as long.
const HOLDS: Duration = Duration::from_secs(15);

/// Pause after a failed attempt to lead, which holds the lock for a moment.
const PAUSE: Duration = Duration::from_secs(5);

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
        let mut pause = WATCH_EVERY;
        let log = match observe(site, &mut election, role).await {
            Ok(None) => {
                answered = Instant::now();
                // Requests wait, instead of going to the last leader.
                set(role, Role::Waits);
                match Leading::start(site).await {
                    Ok(leading) => return leading,
                    Err(ServerError::Store(StoreError::OtherServer(_))) => continue,
                    Err(error) => {
                        election.forget_connection();
                        pause = PAUSE;
                        format!("no server leads, and this one cannot: {}", reason(&error))
                    }
                }
            }
            Ok(Some(log)) => {
                answered = Instant::now();
                log
            }
            Err(error) => {
                // The leader may well answer.
                if answered.elapsed() > HOLDS {
                    set(role, Role::Waits);
                }
                format!("asking who leads failed: {}", reason(&error))
            }
        };
        if log != logged {
            tracing::info!("standing by: {log}");
            logged = log;
        }
        tokio::time::sleep(pause).await;
    }
}

/// Sets the role beside the present leader. Returns what the log says about it; none if nobody leads.
async fn observe(
    site: &Site,
    election: &mut Election,
    role: &watch::Sender<Role>,
) -> Result<Option<String>, ServerError> {
    let leader = match election.leader().await? {
        Leader::Nobody => return Ok(None),
        Leader::Unnamed => {
            set(role, Role::Waits);
            return Ok(Some(
                "a session without the address of a server holds the lock: that of a command that writes, of another role, or of a server \
                 that needs --advertise"
                    .to_owned(),
            ));
        }
        Leader::At(leader) => leader,
    };
    if site.is_own(&leader) {
        set(role, Role::Waits);
        return Ok(Some(format!(
            "the session of a server at {leader} leads, which is the address of this one: of its last process, or of another server with the \
             same --advertise"
        )));
    }
    match may_pass_on(site, election).await {
        Ok(()) => {}
        Err(error @ ServerError::NotLoopback(_)) => {
            set(role, Role::Waits);
            return Ok(Some(error.to_string()));
        }
        Err(error) => return Err(error),
    }
    let next = Role::passes_on(&leader);
    let log = match &next {
        Some(_) => format!("requests are passed on to {leader}"),
        None => format!("the leading server names the address '{leader}', which is no host and port"),
    };
    set(role, next.unwrap_or(Role::Waits));
    Ok(Some(log))
}

/// Sets the role. Those who wait for a change see none if it is the same.
fn set(role: &watch::Sender<Role>, next: Role) {
    role.send_if_modified(|role| {
        let is_new = !role.is_same(&next);
        if is_new {
            *role = next;
        }
        is_new
    });
}

/// What an operator can do about it.
fn reason(error: &ServerError) -> String {
    let sentence = match error {
        ServerError::Store(error) => error.unavailable().map(|reason| reason.sentence().to_owned()),
        _ => None,
    };
    sentence.unwrap_or_else(|| error.to_string())
}

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

/// Why the last attempt to lead failed, for the log and for clients, and when the next one may begin.
struct Obstacle {
    log: String,
    shown: String,
    until: Instant,
}

/// Passes requests on until nobody leads, and then leads.
pub(super) async fn wait_to_lead(site: &Site, role: &watch::Sender<Role>) -> Leading {
    let Location::Postgres(database) = &site.place else {
        unreachable!("a server of a file leads from its start to its end")
    };
    let mut election = Election::new(database.clone());
    let (mut answered, mut logged) = (Instant::now(), String::new());
    let mut obstacle: Option<Obstacle> = None;
    loop {
        let log = match observe(site, &mut election, role).await {
            Ok(None) => {
                answered = Instant::now();
                if obstacle.as_ref().is_none_or(|obstacle| obstacle.until <= answered) {
                    // Requests wait, instead of going to the last leader.
                    set(role, waits(obstacle.as_ref().map(|obstacle| &*obstacle.shown)));
                    let started = match election.refuse_newer(site.config.edition()).await {
                        Ok(()) => Leading::start(site).await,
                        Err(error) => Err(error.into()),
                    };
                    match started {
                        Ok(leading) => return leading,
                        Err(ServerError::Store(StoreError::OtherServer(_))) => continue,
                        Err(error) => {
                            election.forget_connection();
                            let text = |reason| format!("no server leads, and this one cannot: {reason}");
                            let (log, shown) = (text(reason(&error)), text(shown(&error)));
                            obstacle = Some(Obstacle { log, shown, until: Instant::now() + PAUSE });
                        }
                    }
                }
                set(role, waits(obstacle.as_ref().map(|obstacle| &*obstacle.shown)));
                obstacle.as_ref().map_or_else(String::new, |obstacle| obstacle.log.clone())
            }
            Ok(Some(log)) => {
                (answered, obstacle) = (Instant::now(), None);
                log
            }
            Err(error) => {
                let log = format!("asking who leads failed: {}", reason(&error));
                // The leader may well answer.
                if answered.elapsed() > HOLDS || matches!(*role.borrow(), Role::Waits(_)) {
                    set(role, waits(Some(&format!("asking who leads failed: {}", shown(&error)))));
                }
                log
            }
        };
        if log != logged {
            match *role.borrow() {
                Role::Waits(_) => tracing::warn!("standing by: {log}"),
                _ => tracing::info!("standing by: {log}"),
            }
            logged = log;
        }
        tokio::time::sleep(WATCH_EVERY).await;
    }
}

/// The role of a server that neither leads nor knows a leader.
fn waits(reason: Option<&str>) -> Role {
    Role::Waits(reason.map(Into::into))
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
            let log = "a session without the address of a server holds the lock: that of a command that writes, of another role, or of a server \
                       that needs --advertise";
            set(role, waits(Some(log)));
            return Ok(Some(log.to_owned()));
        }
        Leader::At(leader) => leader,
    };
    let (log, shown) = match may_pass_on(site, election).await {
        _ if site.is_own(&leader) => (
            format!(
                "the session of a server at {leader} leads, which is the address of this one: of its last process, or of another server with \
                 the same --advertise"
            ),
            "the leading server has the address of this one",
        ),
        Err(error @ ServerError::NotLoopback(_)) => (error.to_string(), IN_THE_LOG),
        Err(error) => return Err(error),
        Ok(()) => match Role::passes_on(&leader) {
            Some(next) => {
                set(role, next);
                return Ok(Some(format!("requests are passed on to {leader}")));
            }
            None => (
                format!("the leading server names the address '{leader}', which is no host and port"),
                "the leading server has no address",
            ),
        },
    };
    set(role, waits(Some(shown)));
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

/// The text that replaces an error for clients, since the error names hosts, folders or settings.
const IN_THE_LOG: &str = "its operator finds the reason in the server's log";

/// The public text of an error: clients without a token read it.
fn shown(error: &ServerError) -> String {
    match error {
        ServerError::Store(error @ (StoreError::Newer { .. } | StoreError::NewerSolver { .. })) => {
            error.to_string()
        }
        ServerError::Store(error) => {
            error.unavailable().map_or_else(|| IN_THE_LOG.to_owned(), |reason| reason.sentence().to_owned())
        }
        _ => IN_THE_LOG.to_owned(),
    }
}

/// The reason of an error, with the action of an operator.
fn reason(error: &ServerError) -> String {
    let sentence = match error {
        // The error itself says more.
        ServerError::Store(
            StoreError::Newer { .. } | StoreError::NewerSolver { .. } | StoreError::Unsuitable { .. },
        ) => None,
        ServerError::Store(error) => error.unavailable().map(|reason| reason.sentence().to_owned()),
        _ => None,
    };
    sentence.unwrap_or_else(|| error.to_string())
}

//! A server that does not lead: it watches who leads, and leads itself when nobody does.

use std::time::Duration;

use tokio::sync::watch;

use super::leading::Leading;
use super::{ServerError, Site};
use crate::http::Role;
use crate::store::{Election, Leader, Location, StoreError};

/// Interval of the questions who leads.
const WATCH_EVERY: Duration = Duration::from_millis(500);

/// Whether another server leads the database at the start of this one. A file has one server.
pub(super) async fn led_by_another(site: &Site) -> Result<bool, ServerError> {
    let Location::Postgres(database) = &site.place else { return Ok(false) };
    let mut election = Election::new(database.clone());
    let Leader::At(leader) = election.leader().await? else { return Ok(false) };
    // The leader may listen on a loopback address and admit everybody there; others must not reach it through this server.
    if !site.address.ip().is_loopback() && !election.has_tokens().await? {
        return Err(ServerError::NotLoopback(site.address));
    }
    // After a crash, its own session may live for a moment.
    Ok(leader != site.config.advertised(site.address))
}

/// Passes requests on until nobody leads, and then leads.
pub(super) async fn wait_to_lead(site: &Site, role: &watch::Sender<Role>) -> Leading {
    let Location::Postgres(database) = &site.place else {
        unreachable!("a server of a file leads from its start to its end")
    };
    let mut election = Election::new(database.clone());
    loop {
        let next = match election.leader().await {
            Ok(Leader::At(leader)) => passes_on(site, &leader),
            Ok(Leader::Unnamed) => Role::Waits(format!(
                "a program that names no address holds the lock of {database}: a command that writes, or an earlier version of the server"
            )),
            Ok(Leader::Nobody) => match Leading::start(site).await {
                Ok(leading) => return leading,
                Err(ServerError::Store(error)) => Role::Waits(reason(&error)),
                Err(error) => Role::Waits(error.to_string()),
            },
            Err(error) => Role::Waits(reason(&error)),
        };
        let is_new = role.send_if_modified(|role| {
            let is_new = !role.is_same(&next);
            if is_new {
                *role = next.clone();
            }
            is_new
        });
        if is_new {
            match &next {
                Role::PassesOn(leader) => tracing::info!(%leader, "standing by: requests are passed on"),
                Role::Waits(reason) => tracing::warn!(reason, "standing by: no server answers"),
                Role::Leads(_) => {}
            }
        }
        tokio::time::sleep(WATCH_EVERY).await;
    }
}

fn passes_on(site: &Site, leader: &str) -> Role {
    match leader.parse() {
        Ok(_) if leader == site.config.advertised(site.address) => {
            Role::Waits("the last session of this server still holds the lock".to_owned())
        }
        Ok(leader) => Role::PassesOn(leader),
        Err(_) => {
            Role::Waits(format!("the leading server names the address '{leader}', which is no host and port"))
        }
    }
}

/// What a client and an operator can do about a database that cannot be opened.
fn reason(error: &StoreError) -> String {
    error.unavailable().map_or_else(|| error.to_string(), |reason| reason.sentence().to_owned())
}

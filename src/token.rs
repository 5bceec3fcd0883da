//! `roost token`: access tokens of a server.

use std::time::Duration;

use anyhow::{Result, bail};
use clap::Subcommand;
use roost_api::job::MAX_NAME_BYTES;
use roost_api::project::DEFAULT_PROJECT;
use roost_api::time::Timestamp;
use roost_api::token::{Scope, TokenView};
use roost_server::NewToken;
use roost_terminal::{Exit, Table, message, print_json, print_line, print_lines};
use serde_json::json;

use crate::database::ServerData;

/// Create, list and revoke access tokens
///
/// The command changes the data folder of a server. A running server notices the change within a second. As soon as the first token exists,
/// every request needs a token, even if you revoke all tokens later.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(flatten)]
    data: ServerData,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Create a token and print it once; Roost cannot show the token again
    Create {
        /// Scope (permission) of the token: admin (everything), submit (includes read), read, or worker; you can give this option
        /// several times
        #[arg(long = "scope", required = true, value_name = "SCOPE")]
        scopes: Vec<Scope>,
        /// Name of the token in lists
        #[arg(long, default_value = "", value_name = "NAME")]
        name: String,
        /// Name of the user, in the audit log and with each job [default: the name of the token]
        #[arg(long, value_name = "NAME", value_parser = user)]
        user: Option<String>,
        /// Project of the token, from `roost project list`
        #[arg(long, default_value = DEFAULT_PROJECT, value_name = "NAME")]
        project: String,
        /// Age at which the token expires, such as 12h, 30d or 8w; without this option, the token never expires
        #[arg(long, value_name = "AGE", value_parser = lifetime)]
        expires: Option<Duration>,
    },
    /// List all tokens, without their secrets
    List,
    /// Revoke a token
    Revoke {
        /// Id from `roost token list`
        id: String,
    },
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let is_first = matches!(args.action, Action::Create { .. });
    let is_new = is_first && args.data.database.address.is_none() && !args.data.folder.exists();
    let mut tokens = args.data.open(is_first).await?;
    match args.action {
        Action::Create { scopes, name, user, project, expires } => {
            let was_open = tokens.list().await?.is_empty();
            let user = user.as_deref().unwrap_or(&name);
            let now = Timestamp::now();
            let expires_at =
                expires.map(|age| now.plus_ms(i64::try_from(age.as_millis()).unwrap_or(i64::MAX)));
            let token = NewToken { name: &name, user, project: &project, scopes: &scopes, expires_at };
            let (view, secret) = tokens.create_for(token, now).await?;
            if args.json {
                print_json(&json!({"token": secret, "view": view}))?;
            } else {
                message!("token {}; save it now, it cannot be shown again:", view.id);
                print_line(format_args!("{secret}"))?;
            }
            if is_new {
                message!(
                    "note: {} is a new data folder; a server uses it with `--data`",
                    args.data.folder.display()
                );
            }
            if was_open {
                message!(
                    "note: from now on every request needs a token, including those of workers and of `roost up`"
                );
            }
        }
        Action::List => {
            let all = tokens.list().await?;
            if args.json {
                print_json(&json!(all))?;
            } else {
                print_lines(format_args!("{}", table(&all)))?;
            }
        }
        Action::Revoke { id } => {
            if !tokens.revoke(&id, Timestamp::now()).await? {
                bail!("no valid token has the id {id}; `roost token list` shows all");
            }
            message!("revoked; a running server follows within a second");
            if !tokens.has_valid(Timestamp::now()).await? {
                message!(
                    "warning: no token is valid now; without an identity provider, the server answers 401 until `roost token create` makes one"
                );
            }
        }
    }
    tokens.close().await?;
    Ok(Exit::Done)
}

/// Reads an age that is not zero.
fn lifetime(text: &str) -> Result<Duration, String> {
    let found = crate::prune::age(text).ok().filter(|age| !age.is_zero());
    found.ok_or_else(|| "write a number of hours, days or weeks from 1h, such as 12h, 30d or 8w".to_owned())
}

/// Reads the name of a user.
fn user(text: &str) -> Result<String, String> {
    let is_allowed = !text.chars().any(char::is_control) && (1..=MAX_NAME_BYTES).contains(&text.len());
    if is_allowed {
        return Ok(text.to_owned());
    }
    Err(format!("allowed are 1 to {MAX_NAME_BYTES} bytes without control characters"))
}

fn table(tokens: &[TokenView]) -> Table {
    let mut table = Table::new(["id", "name", "user", "project", "scopes", "created", "expires", "revoked"]);
    for token in tokens {
        let scopes: Vec<_> = token.scopes.iter().map(|scope| scope.as_str()).collect();
        let moment = |moment: Option<Timestamp>| moment.map_or_else(|| "–".to_owned(), |it| it.to_string());
        table.row([
            token.id.clone(),
            token.name.clone(),
            token.user.clone(),
            token.project.clone(),
            scopes.join(" "),
            token.created_at.to_string(),
            moment(token.expires_at),
            moment(token.revoked_at),
        ]);
    }
    table
}

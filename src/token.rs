//! `roost token`: who may use a server, decided where its data is.

use std::path::PathBuf;

use anyhow::{Result, bail};
use clap::Subcommand;
use roost_api::time::Timestamp;
use roost_api::token::{Scope, TokenView};
use serde_json::json;

use crate::copies;
use crate::exit::Exit;
use crate::ui;
use crate::ui::table::Table;

/// Make, list and revoke access tokens
///
/// Works on the data folder of a server, whether that runs or not; a running one follows within a second. From the first token on, every
/// request needs one, also after all are revoked.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Folder of everything the server keeps
    #[arg(long, global = true, default_value = "roost-data", value_name = "DIR")]
    data: PathBuf,
    /// Print JSON
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    /// Make a token and print it: this once, it is kept nowhere
    Create {
        /// What it allows: admin (everything), submit (and read), read, or worker; may be given several times
        #[arg(long = "scope", required = true, value_name = "SCOPE")]
        scopes: Vec<Scope>,
        /// A name for people
        #[arg(long, default_value = "", value_name = "NAME")]
        name: String,
    },
    /// List all tokens, without their secrets
    List,
    /// Revoke a token
    Revoke {
        /// Its id, as `roost token list` shows it
        id: String,
    },
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let is_first = matches!(args.action, Action::Create { .. });
    let is_new = is_first && !args.data.exists();
    let mut tokens = roost_server::tokens_in(&args.data, is_first).await.map_err(copies::named)?;
    match args.action {
        Action::Create { scopes, name } => {
            let was_open = tokens.list().await?.is_empty();
            let (view, secret) = tokens.create(&name, &scopes, Timestamp::now()).await?;
            if args.json {
                ui::json(&json!({"token": secret, "view": view}))?;
            } else {
                ui::say!("token {}; keep it now, it is shown this once:", view.id);
                ui::println(format_args!("{secret}"))?;
            }
            if is_new {
                ui::say!(
                    "note: {} is a new data folder; a server uses it with `--data`",
                    args.data.display()
                );
            }
            if was_open {
                ui::say!(
                    "note: from now on every request needs a token, those of workers and of `roost up` too"
                );
            }
        }
        Action::List => {
            let all = tokens.list().await?;
            if args.json {
                ui::json(&json!(all))?;
            } else {
                ui::print(format_args!("{}", table(&all)))?;
            }
        }
        Action::Revoke { id } => {
            if !tokens.revoke(&id, Timestamp::now()).await? {
                bail!("there is no valid token {id}; `roost token list` shows them");
            }
            ui::say!("revoked; a running server follows within a second");
            if !tokens.has_valid().await? {
                ui::say!(
                    "warning: no token is valid now; the server answers 401 until `roost token create` makes one"
                );
            }
        }
    }
    tokens.close().await?;
    Ok(Exit::Done)
}

fn table(tokens: &[TokenView]) -> Table {
    let mut table = Table::new(["id", "name", "scopes", "created", "revoked"]);
    for token in tokens {
        let scopes: Vec<_> = token.scopes.iter().map(|scope| scope.as_str()).collect();
        let revoked = token.revoked_at.map_or_else(|| "–".to_owned(), |moment| moment.to_string());
        table.row([
            token.id.clone(),
            token.name.clone(),
            scopes.join(" "),
            token.created_at.to_string(),
            revoked,
        ]);
    }
    table
}

//! `roost study`: questions about a scenario, which the server answers by runs that it chooses.

mod answer;
mod ask;
mod control;
mod folder;
mod follow;
mod run;
mod show;
mod submit;

use anyhow::Result;
use clap::Subcommand;
use roost_terminal::Exit;

use crate::validate;

/// Ask a question about a scenario; Roost chooses the runs that answer it
///
/// A study has a base scenario, factors (inputs that vary) with their ranges, a goal, and a budget (the maximum number of runs).
/// Each study has a sweep with the same id. Roost adds runs to this sweep until the answer is as certain as you asked for, or until
/// the budget is used up. The commands `roost study run` and `roost study validate` need no server. All other commands of this list
/// need a server.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    #[command(subcommand)]
    action: Action,
}

#[derive(Debug, Subcommand)]
enum Action {
    Run(run::Args),
    /// Check a study, but do not submit it; forecast its number of runs, its processor time and its time of completion
    Validate(validate::Args),
    Submit(submit::Args),
    List(show::List),
    Show(show::Show),
    Watch(follow::Args),
    Answer(answer::Args),
    Pause(control::Pause),
    Resume(control::Resume),
    Cancel(control::Cancel),
    Budget(control::Budget),
    Widen(control::Widen),
    Ask(ask::Ask),
    Tell(ask::Tell),
}

impl Args {
    /// Default filter of the log.
    pub(crate) fn log_filter(&self) -> &'static str {
        // Server and worker are in this process: its progress says what they do.
        if matches!(self.action, Action::Run(_)) { "error" } else { "warn" }
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    match args.action {
        Action::Run(args) => run::execute(args).await,
        Action::Validate(args) => validate::execute(args, true).await,
        Action::Submit(args) => submit::execute(args).await,
        Action::List(args) => show::list(args).await,
        Action::Show(args) => show::show(args).await,
        Action::Watch(args) => follow::execute(args).await,
        Action::Answer(args) => answer::execute(args).await,
        Action::Pause(args) => control::pause(args).await,
        Action::Resume(args) => control::resume(args).await,
        Action::Cancel(args) => control::cancel(args).await,
        Action::Budget(args) => control::budget(args).await,
        Action::Widen(args) => control::widen(args).await,
        Action::Ask(args) => ask::ask(args).await,
        Action::Tell(args) => ask::tell(args).await,
    }
}

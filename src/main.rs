//! The `roost` command: one file per subcommand. `roost reproduce` and `roost bench` are crates of their own.

mod cancel;
mod checkpoints;
mod compare;
mod completions;
mod copies;
mod copy;
mod database;
mod delete;
mod demo;
mod device;
mod document;
mod drain;
mod effects;
mod exit;
mod extend;
mod farm;
mod forecast;
mod frames;
mod interval;
mod list;
mod measurements;
mod meshes;
mod named_files;
mod openapi;
mod output;
mod pause;
mod pool;
mod project;
mod prune;
mod results;
mod retry;
mod run;
mod serve;
mod sign_in;
mod status;
mod study;
mod submit;
mod target;
mod telemetry;
mod token;
mod up;
mod validate;
mod watch;
mod work;

use std::process::ExitCode;

use clap::{CommandFactory, Parser, Subcommand};
use roost_terminal::exit::is_broken_pipe;
use roost_terminal::{Exit, message, message_lines};

/// Simulate soft food as bonded particles, and run parameter sweeps on many machines.
///
/// A scenario is a JSON document that describes one simulation. A sweep is a set of simulations whose scenarios differ in some
/// inputs. A server keeps a queue of simulations (jobs) and stores their results. Workers take jobs from the server and simulate
/// them. To see an example, run `roost demo`. To simulate one scenario on this machine without a server, use `roost run`.
#[derive(Debug, Parser)]
#[command(version, propagate_version = true, after_help = exit::HELP)]
struct Cli {
    #[command(subcommand)]
    command: Command,
    /// Format of the log on stderr: text lines, or one JSON object per line
    #[arg(
        long,
        global = true,
        env = "ROOST_LOG_FORMAT",
        default_value = "text",
        value_name = "FORMAT",
        hide_short_help = true,
        display_order = 900
    )]
    log_format: telemetry::LogFormat,
}

#[derive(Debug, Subcommand)]
enum Command {
    Demo(demo::Args),
    Up(up::Args),
    Serve(serve::Args),
    Work(work::Args),
    Pool(pool::Args),
    Run(run::Args),
    Submit(submit::Args),
    Study(study::Args),
    List(list::Args),
    Status(status::Args),
    Results(results::Args),
    Effects(effects::Args),
    Compare(compare::Args),
    Validate(validate::Args),
    Cancel(cancel::Args),
    Pause(pause::Pause),
    Resume(pause::Resume),
    Retry(retry::Args),
    Extend(extend::Args),
    Delete(delete::Args),
    Prune(prune::Args),
    Drain(drain::Args),
    Reproduce(roost_reproduce::Args),
    Bench(roost_bench::Args),
    Token(token::Args),
    Project(project::Args),
    Backup(copies::Backup),
    Restore(copies::Restore),
    Copy(copy::Args),
    Completions(completions::Args),
    #[command(hide = true)]
    Openapi(openapi::Args),
}

impl Command {
    /// Default filter of the log: long-running commands log what they do, all others only problems.
    fn log_filter(&self) -> &'static str {
        match self {
            Self::Up(_) | Self::Serve(_) | Self::Work(_) => "info",
            Self::Demo(_) => "error",
            Self::Pool(args) => args.log_filter(),
            Self::Study(args) => args.log_filter(),
            _ => "warn",
        }
    }

    /// Whether the command writes to the data folder of a server.
    fn writes_data_folder(&self) -> bool {
        matches!(
            self,
            Self::Up(_)
                | Self::Serve(_)
                | Self::Token(_)
                | Self::Project(_)
                | Self::Backup(_)
                | Self::Restore(_)
                | Self::Copy(_)
        )
    }

    /// Service name in traces; none for commands that are not traced.
    fn service_name(&self) -> Option<&'static str> {
        match self {
            Self::Up(_) => Some("roost-up"),
            Self::Serve(_) => Some("roost-serve"),
            Self::Work(_) => Some("roost-work"),
            _ => None,
        }
    }

    async fn execute(self) -> anyhow::Result<Exit> {
        match self {
            Self::Demo(args) => demo::execute(args).await,
            Self::Up(args) => up::execute(args).await,
            Self::Serve(args) => serve::execute(args).await,
            Self::Work(args) => work::execute(args).await,
            Self::Pool(args) => pool::execute(args).await,
            Self::Run(args) => run::execute(args).await,
            Self::Submit(args) => submit::execute(args).await,
            Self::Study(args) => study::execute(args).await,
            Self::List(args) => list::execute(args).await,
            Self::Status(args) => status::execute(args).await,
            Self::Results(args) => results::execute(args).await,
            Self::Effects(args) => effects::execute(args).await,
            Self::Compare(args) => compare::execute(args).await,
            Self::Validate(args) => validate::execute(args, false).await,
            Self::Cancel(args) => cancel::execute(args).await,
            Self::Pause(args) => pause::pause(args).await,
            Self::Resume(args) => pause::resume(args).await,
            Self::Drain(args) => drain::execute(args).await,
            Self::Retry(args) => retry::execute(args).await,
            Self::Extend(args) => extend::execute(args).await,
            Self::Delete(args) => delete::execute(args).await,
            Self::Prune(args) => prune::execute(args).await,
            Self::Backup(args) => copies::backup(args).await,
            Self::Restore(args) => copies::restore(args).await,
            Self::Copy(args) => copy::execute(args).await,
            Self::Completions(args) => completions::execute(&args, Cli::command()),
            Self::Openapi(args) => openapi::execute(&args),
            Self::Token(args) => token::execute(args).await,
            Self::Project(args) => project::execute(args).await,
            Self::Bench(args) => roost_bench::execute(args).await,
            Self::Reproduce(args) => roost_reproduce::execute(args).await,
        }
    }
}

#[tokio::main]
async fn main() -> ExitCode {
    let Cli { command, log_format } = Cli::parse();
    let _telemetry = telemetry::start(command.log_filter(), log_format, command.service_name());
    if command.writes_data_folder() {
        make_new_files_private();
    }
    match command.execute().await {
        Ok(exit) => exit.into(),
        // `| head` closes the pipe.
        Err(error) if is_broken_pipe(&error) => Exit::Done.into(),
        Err(error) => {
            message_lines(format_args!("error: {error:#}"));
            if let Some(hint) = exit::hint(&error) {
                message!("hint: {hint}");
            }
            exit::code(&error).into()
        }
    }
}

/// Only the user of the server may read its files.
#[cfg(unix)]
fn make_new_files_private() {
    rustix::process::umask(rustix::fs::Mode::RWXG | rustix::fs::Mode::RWXO);
}

/// On other systems new files inherit the permissions of their folder: those of a user's own folders are private.
#[cfg(not(unix))]
fn make_new_files_private() {}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    #[test]
    fn every_shell_has_completions() {
        for shell in crate::completions::shells() {
            let mut script = Vec::new();
            clap_complete::generate(*shell, &mut super::Cli::command(), "roost", &mut script);
            let script = String::from_utf8(script).unwrap();
            assert!(script.contains("reproduce") && script.contains("backup"), "{shell}");
        }
    }

    #[test]
    fn command_line_is_well_formed() {
        super::Cli::command().debug_assert();
    }
}

//! `roost bench farm`: the targets of the service, measured against a server process.
//!
//! [`server`] starts the process on its [`data`], [`clients`] simulates users and workers, [`measurements`], [`pairs`],
//! [`large_sweeps`] and [`studies`] measure each target.

mod clients;
mod data;
mod large_sweeps;
mod measurements;
mod pairs;
mod server;
mod studies;

use anyhow::{Result, bail};
use clap::builder::RangedU64ValueParser;
use roost_terminal::format::significant;
use roost_terminal::{Exit, Table, print_json, print_lines, signals};
use serde::Serialize;
use serde_json::json;

/// Compare the server with its targets for throughput, waiting times, load, memory, and the effects of killed processes
///
/// The command starts servers on loopback addresses, with their data in a temporary folder. The clients of these servers run in the
/// process of this command, on the same machine. Therefore the measured throughput is the throughput of the server together with its
/// clients. The measured processor time and memory are those of the server only. Each row of the output is one measurement.
#[derive(Debug, clap::Args)]
pub(super) struct Args {
    /// Measure only rows whose names start with NAME. You can give several names, separated by commas
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    only: Vec<String>,
    /// Number of queued jobs for the rows that measure a long queue
    #[arg(long, default_value_t = 1_000_000, value_name = "N", value_parser = job_counts())]
    many: u64,
    /// Duration of each timed measurement
    #[arg(long, default_value_t = 10, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=600))]
    seconds: u64,
    /// Duration for which one row holds a transaction of the database open; at least as long as the timed measurement
    #[arg(long, default_value_t = 60, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(10..=3600))]
    hold: u64,
    /// PostgreSQL address; with this option, the command creates a database for each server, and deletes this database at the end
    ///
    /// The PostgreSQL user in the address needs the permission to create databases. The command calls the programs `createdb` and
    /// `dropdb` of PostgreSQL.
    #[arg(long, value_name = "URL")]
    postgres: Option<String>,
    /// Print JSON: each row has a name, a value, a unit and a target
    #[arg(long)]
    json: bool,
}

fn job_counts() -> RangedU64ValueParser {
    clap::value_parser!(u64).range(1000..=10_000_000)
}

/// A measured value and its target.
#[derive(Clone, Debug, Serialize)]
struct Row {
    name: &'static str,
    value: f64,
    unit: &'static str,
    target: Target,
    reached: bool,
}

/// A limit on a value.
#[derive(Clone, Copy, Debug)]
enum Target {
    AtLeast(f64),
    AtMost(f64),
}

impl Target {
    fn is_reached(self, value: f64) -> bool {
        match self {
            Self::AtLeast(limit) => value >= limit,
            Self::AtMost(limit) => value <= limit,
        }
    }
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtLeast(limit) => write!(f, "≥ {limit}"),
            Self::AtMost(limit) => write!(f, "≤ {limit}"),
        }
    }
}

impl Serialize for Target {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

pub(super) async fn execute(args: Args) -> Result<Exit> {
    // Dropping the measurement kills its server and removes its folder; an unhandled signal would leave both.
    let shutdown = signals::shutdown_token()?;
    let rows = tokio::select! {
        rows = measurements::measure(&args) => rows?,
        () = shutdown.cancelled() => bail!("stopped before its end"),
    };
    if args.json {
        print_json(&json!(rows))?;
    } else {
        let mut table = Table::new(["measurement", "value", "unit", "target", "reached"]);
        for row in &rows {
            let reached = if row.reached { "yes" } else { "no" };
            let cells = [row.name, &significant(row.value), row.unit, &row.target.to_string(), reached];
            table.row(cells.map(str::to_owned));
        }
        print_lines(format_args!("{table}"))?;
    }
    Ok(if rows.iter().all(|row| row.reached) { Exit::Done } else { Exit::Failed })
}

#[cfg(test)]
mod tests {
    use super::Target;

    #[test]
    fn targets_are_reached_at_their_limit() {
        assert!(Target::AtLeast(2000.0).is_reached(2000.0) && !Target::AtLeast(2000.0).is_reached(1999.9));
        assert!(Target::AtMost(5.0).is_reached(5.0) && !Target::AtMost(5.0).is_reached(5.1));
        assert_eq!(
            (Target::AtLeast(95.0).to_string(), Target::AtMost(0.0).to_string()),
            ("≥ 95".into(), "≤ 0".into())
        );
    }
}

//! `roost bench farm`: the promises of the service, measured against a server process of its own.
//!
//! [`server`] starts and watches that process, [`load`] plays users and workers, [`promises`] are the rows.

mod load;
mod promises;
mod server;

use anyhow::{Result, bail};
use clap::builder::RangedU64ValueParser;
use serde::Serialize;
use serde_json::json;

use crate::exit::Exit;
use crate::signals;
use crate::ui;
use crate::ui::format::significant;
use crate::ui::table::Table;

/// Hold the service to its promises: throughput, waiting times, load, memory, and what kills leave behind
///
/// Starts servers on loopback addresses with their data in a temporary folder. Clients run in this process and share the
/// machine, so that a figure is what server and clients reach together; CPU and memory are those of the server alone.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Rows to measure, by the start of their name; all without it
    #[arg(long, value_delimiter = ',', value_name = "NAME")]
    only: Vec<String>,
    /// Jobs in the queue of the row on many jobs and the memory they take
    #[arg(long, default_value_t = 1_000_000, value_name = "N", value_parser = jobs())]
    many: u64,
    /// Seconds of each row that takes time
    #[arg(long, default_value_t = 10, value_name = "SECONDS", value_parser = clap::value_parser!(u64).range(1..=600))]
    seconds: u64,
    /// Print JSON: rows of name, value, unit and target
    #[arg(long)]
    json: bool,
}

fn jobs() -> RangedU64ValueParser {
    clap::value_parser!(u64).range(1000..=10_000_000)
}

/// A promise and what became of it.
#[derive(Clone, Debug, Serialize)]
struct Row {
    /// What was measured.
    name: &'static str,
    /// What came out.
    value: f64,
    /// In which unit.
    unit: &'static str,
    /// What was promised.
    target: Target,
    /// Whether it holds.
    reached: bool,
}

/// At least or at most so much.
#[derive(Clone, Copy, Debug)]
enum Target {
    AtLeast(f64),
    AtMost(f64),
}

impl Target {
    fn is_reached(self, value: f64) -> bool {
        match self {
            Self::AtLeast(least) => value >= least,
            Self::AtMost(most) => value <= most,
        }
    }
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::AtLeast(least) => write!(f, "≥ {least}"),
            Self::AtMost(most) => write!(f, "≤ {most}"),
        }
    }
}

impl Serialize for Target {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

pub(super) async fn execute(args: Args) -> Result<Exit> {
    // What is measured takes its server and its folder along when it is dropped; a signal alone would leave both.
    let shutdown = signals::shutdown()?;
    let rows = tokio::select! {
        rows = promises::measure(&args) => rows?,
        () = shutdown.cancelled() => bail!("stopped before its end"),
    };
    if args.json {
        ui::json(&json!(rows))?;
    } else {
        let mut table = Table::new(["what", "measured", "unit", "promised", "reached"]);
        for row in &rows {
            let reached = if row.reached { "yes" } else { "no" };
            let cells = [row.name, &significant(row.value), row.unit, &row.target.to_string(), reached];
            table.row(cells.map(str::to_owned));
        }
        ui::print(format_args!("{table}"))?;
    }
    Ok(if rows.iter().all(|row| row.reached) { Exit::Done } else { Exit::Failed })
}

#[cfg(test)]
mod tests {
    use super::Target;

    #[test]
    fn targets_are_met_at_their_bound_and_say_which_way() {
        assert!(Target::AtLeast(2000.0).is_reached(2000.0) && !Target::AtLeast(2000.0).is_reached(1999.9));
        assert!(Target::AtMost(5.0).is_reached(5.0) && !Target::AtMost(5.0).is_reached(5.1));
        assert_eq!(
            (Target::AtLeast(95.0).to_string(), Target::AtMost(0.0).to_string()),
            ("≥ 95".into(), "≤ 0".into())
        );
    }
}

//! `roost compare`: the differences between two design points of a sweep.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_api::short_names::short_names;
use roost_api::table::{DesignPoint, Pairing, SweepDifferences};
use roost_terminal::{BadInput, Exit, Table, format, message, print_json, print_lines};
use serde_json::json;
use uuid::Uuid;

use crate::results;
use crate::target;

/// Compare two design points of a sweep
///
/// A design point is one combination of the values of all factors of a sweep. The command prints the mean of each response at both
/// points, and the difference of the two means with its 95 % interval. If the runs of both points have the same seeds, Roost
/// computes the interval from the differences between runs with the same seed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    /// Index of the first design point; `roost results --by point` lists the indices
    from: u32,
    /// Index of the second design point
    to: u32,
    #[command(flatten)]
    server: target::Server,
    /// Show all responses instead of only the main responses
    #[arg(long)]
    all: bool,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    if args.from == args.to {
        let to = args.to;
        return Err(
            BadInput(format!("TO {to} is the same design point as FROM {to}; give another one")).into()
        );
    }
    let (client, sweep) = (args.server.client()?, SweepId(args.id));
    let differences = client.sweep_differences(sweep, args.from, args.to).await?;
    if args.json {
        print_json(&json!(differences))?;
    } else if differences.responses.is_empty() {
        message!(
            "no job of one of the points has succeeded yet; `roost status {}` shows the progress",
            args.id
        );
    } else {
        let shown = if args.all { None } else { Some(results::headline(&client, sweep).await?) };
        print_lines(format_args!(
            "{}\n{}\n{}\n{}\n",
            levels(&differences.from, &differences.sweep.factors),
            levels(&differences.to, &differences.sweep.factors),
            table(&differences, shown.as_deref()),
            differences.pairing.sentence,
        ))?;
    }
    Ok(Exit::Done)
}

/// A point with its levels, such as `point 3: gate_opening_m 0.06`.
fn levels(point: &DesignPoint, factors: &[String]) -> String {
    let names = short_names(factors);
    let levels = factors.iter().zip(names);
    let levels = levels.map(|(pointer, name)| format!("{name} {}", format::cell(&point.factors[pointer])));
    format!("point {}: {}", point.point, levels.collect::<Vec<_>>().join(", "))
}

/// One row per response.
fn table(differences: &SweepDifferences, shown: Option<&[&str]>) -> Table {
    let point = |point: &DesignPoint| format!("point {}", point.point);
    let (from, to) = (point(&differences.from), point(&differences.to));
    let mut table = Table::new(
        ["response".to_owned(), from, to]
            .into_iter()
            .chain(["difference", "95 % interval", "paired", "width ratio"].map(str::to_owned)),
    );
    let is_shown = |name: &str| {
        let stem = name.split('=').next().unwrap_or_default();
        shown.is_none_or(|shown| shown.contains(&stem))
    };
    for of in differences.responses.iter().filter(|of| is_shown(&of.response)) {
        let paired = if of.pairing == Pairing::Unpaired { "no" } else { "by seed" };
        table.row([
            of.response.clone(),
            format::significant(of.from_mean),
            format::significant(of.to_mean),
            format::significant(of.difference),
            format::interval(of.low_95, of.high_95),
            paired.to_owned(),
            of.width_ratio.map_or_else(|| "–".to_owned(), |ratio| format!("{ratio:.2}")),
        ]);
    }
    table
}

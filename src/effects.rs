//! `roost effects`: the effect of each factor of a sweep on each response.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_api::short_names::short_names;
use roost_api::table::{ResponseEffects, SweepEffects};
use roost_terminal::{Exit, Table, format, message, print_json, print_lines};
use serde_json::json;
use uuid::Uuid;

use crate::results;
use crate::target;

/// Show the effect of each factor of a sweep on each response
///
/// A factor is an input that the sweep varies. A response is a number in the results. To compute an effect, Roost fits a straight
/// line to the response as a function of the factor. The effect is the change of the response along this line, from the minimum to
/// the maximum of the factor. The table also has Spearman's rank correlation ρ and its p-value p. With other seeds, the effect would
/// be different. The 95 % interval shows how large this difference may be. If all design points have the same seeds, Roost computes
/// the interval from runs with the same seed.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// Show all responses instead of only the main responses
    #[arg(long)]
    all: bool,
    /// Print JSON, which also has the mean of each response at each level (value) of a factor
    #[arg(long)]
    json: bool,
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let (client, sweep) = (args.server.client()?, SweepId(args.id));
    let effects = client.sweep_effects(sweep).await?;
    if args.json {
        print_json(&json!(effects))?;
    } else if effects.responses.is_empty() {
        message!("no job has succeeded yet; `roost status {}` shows the progress", args.id);
    } else {
        let shown = if args.all { None } else { Some(results::headline(&client, sweep).await?) };
        print_lines(format_args!("{}\n{}\n", table(&effects, shown.as_deref()), effects.pairing.sentence))?;
    }
    Ok(Exit::Done)
}

/// One row per response and factor; factors are sorted by the strength of their rank correlation.
fn table(effects: &SweepEffects, shown: Option<&[&str]>) -> Table {
    let stem = |of: &ResponseEffects| of.response.split('=').next().unwrap_or_default().to_owned();
    let is_shown = |of: &&ResponseEffects| shown.is_none_or(|shown| shown.contains(&stem(of).as_str()));
    let names = short_names(&effects.sweep.factors);
    let mut table = Table::new(["response", "mean", "factor", "effect", "95 % interval", "ρ", "p", "points"]);
    for of in effects.responses.iter().filter(is_shown) {
        let mut factors: Vec<_> = of.factors.iter().zip(&names).collect();
        let strength = |rank: Option<f64>| rank.map_or(-1.0, f64::abs);
        factors.sort_by(|(one, _), (other, _)| {
            strength(other.rank_correlation).total_cmp(&strength(one.rank_correlation))
        });
        for (factor, name) in factors {
            let number = |value: Option<f64>| value.map_or_else(|| "–".to_owned(), format::significant);
            table.row([
                of.response.clone(),
                format::significant(of.mean),
                name.clone(),
                number(factor.effect),
                format::interval(factor.low_95, factor.high_95),
                factor.rank_correlation.map_or_else(|| "–".to_owned(), |rank| format!("{rank:.2}")),
                factor.p_value.map_or_else(|| "–".to_owned(), |p| format!("{p:.3}")),
                of.points.to_string(),
            ]);
        }
    }
    table
}

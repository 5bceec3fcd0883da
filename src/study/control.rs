//! `roost study pause`, `resume`, `cancel`, `budget` and `widen`.

use anyhow::Result;
use roost_api::ids::SweepId;
use roost_api::study::{RangeChange, WiderRange};
use roost_terminal::Exit;

use super::show;
use crate::target;

/// Pause a study: the study adds no runs, and workers store a checkpoint of each running job and hand the job back
#[derive(Debug, clap::Args)]
pub(crate) struct Pause {
    #[command(flatten)]
    target: Target,
}

/// Resume a paused study
#[derive(Debug, clap::Args)]
pub(crate) struct Resume {
    #[command(flatten)]
    target: Target,
}

/// End a study and cancel its jobs; its answer and its results remain
#[derive(Debug, clap::Args)]
pub(crate) struct Cancel {
    #[command(flatten)]
    target: Target,
}

/// Raise the budget of a study; a finished study then continues
#[derive(Debug, clap::Args)]
pub(crate) struct Budget {
    #[command(flatten)]
    target: Target,
    /// New maximum number of runs; it must be above the present maximum
    #[arg(value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    max_runs: u32,
}

/// Widen the range of a factor; the study keeps all its runs, and a finished study continues
#[derive(Debug, clap::Args)]
pub(crate) struct Widen {
    #[command(flatten)]
    target: Target,
    /// JSON pointer of the factor, such as /equipment/gate_opening_m
    pointer: String,
    /// New lower end of the range; it must not be above the present lower end
    #[arg(allow_negative_numbers = true)]
    low: f64,
    /// New upper end of the range; it must not be below the present upper end
    #[arg(allow_negative_numbers = true)]
    high: f64,
}

#[derive(Debug, clap::Args)]
struct Target {
    /// Id of a study
    #[arg(value_parser = target::study_id)]
    id: SweepId,
    #[command(flatten)]
    server: target::Server,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

pub(crate) async fn pause(args: Pause) -> Result<Exit> {
    set_paused(args.target, true).await
}

pub(crate) async fn resume(args: Resume) -> Result<Exit> {
    set_paused(args.target, false).await
}

async fn set_paused(target: Target, pause: bool) -> Result<Exit> {
    let study = target.server.client()?.pause_study(target.id, pause).await?;
    show::print(&study, target.json)?;
    Ok(Exit::Done)
}

pub(crate) async fn cancel(args: Cancel) -> Result<Exit> {
    let study = args.target.server.client()?.cancel_study(args.target.id).await?;
    show::print(&study, args.target.json)?;
    Ok(Exit::Done)
}

pub(crate) async fn budget(args: Budget) -> Result<Exit> {
    let Budget { target, max_runs } = args;
    let study = target.server.client()?.raise_study_budget(target.id, max_runs).await?;
    show::print(&study, target.json)?;
    Ok(Exit::Done)
}

pub(crate) async fn widen(args: Widen) -> Result<Exit> {
    let Widen { target, pointer, low, high } = args;
    let change = RangeChange { ranges: vec![WiderRange { pointer, low: Some(low), high: Some(high) }] };
    let study = target.server.client()?.widen_study(target.id, &change).await?;
    show::print(&study, target.json)?;
    Ok(Exit::Done)
}

//! `roost extend`: more points or replicates of a sweep.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::design::Extension;
use roost_api::ids::SweepId;
use serde_json::Value;
use uuid::Uuid;

use crate::exit::Exit;
use crate::{input, list, target};

/// Add points or replicates to a sweep; what is there stays as it is
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("more").required(true).multiple(true)))]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// random, sobol: so many more points of the same sequence
    #[arg(long, value_name = "N", group = "more")]
    points: Option<u32>,
    /// grid, one_at_a_time: one more level of a factor, such as /equipment/gate_opening_m=0.07; may be repeated
    #[arg(long = "level", value_name = "POINTER=VALUE", group = "more", value_parser = level)]
    levels: Vec<(String, Value)>,
    /// list, csv: a CSV file with more points, the factors' pointers as headings
    #[arg(long, value_name = "FILE", group = "more")]
    rows: Option<PathBuf>,
    /// Any design: so many more runs of every point
    #[arg(long, value_name = "N", group = "more")]
    replicates: Option<u32>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// A value is JSON where it is, else a word.
fn level(text: &str) -> Result<(String, Value), String> {
    let (pointer, value) = text.split_once('=').ok_or("write it as POINTER=VALUE")?;
    let value = serde_json::from_str(value).unwrap_or_else(|_| Value::from(value));
    Ok((pointer.to_owned(), value))
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let mut more = Extension { points: args.points, replicates: args.replicates, ..Extension::default() };
    for (pointer, value) in args.levels {
        more.levels.get_or_insert_default().entry(pointer).or_default().push(value);
    }
    more.table = args.rows.as_deref().map(input::text).transpose()?;
    let sweep = args.server.client()?.extend_sweep(SweepId(args.id), &more).await?;
    list::show_sweep(sweep, args.json)?;
    Ok(Exit::Done)
}

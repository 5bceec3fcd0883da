//! `roost extend`: add design points or replicates to a sweep.

use std::path::PathBuf;

use anyhow::Result;
use roost_api::design::Extension;
use roost_api::ids::SweepId;
use roost_terminal::{Exit, input};
use serde_json::Value;
use uuid::Uuid;

use crate::{list, target};

/// Add design points or replicates to a sweep; existing jobs stay unchanged
#[derive(Debug, clap::Args)]
#[command(group(clap::ArgGroup::new("more").required(true).multiple(true)))]
pub(crate) struct Args {
    /// Id of a sweep
    #[arg(value_parser = target::id)]
    id: Uuid,
    #[command(flatten)]
    server: target::Server,
    /// For the designs random and sobol: number of further design points. The points continue the sequence of the design
    #[arg(long, value_name = "N", group = "more")]
    points: Option<u32>,
    /// For the designs grid and one_at_a_time: a further level (value) of a factor, such as /equipment/gate_opening_m=0.07. You can
    /// give this option several times
    #[arg(long = "level", value_name = "POINTER=VALUE", group = "more", value_parser = level)]
    levels: Vec<(String, Value)>,
    /// For the designs list and csv: a CSV file with further design points. The headings of its columns are the JSON pointers of the
    /// factors
    #[arg(long, value_name = "FILE", group = "more")]
    rows: Option<PathBuf>,
    /// For all designs: number of further replicates (runs with other seeds) of every design point
    #[arg(long, value_name = "N", group = "more")]
    replicates: Option<u32>,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Parses a level. A value that is no JSON is a text.
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
    more.table = args.rows.as_deref().map(input::read_text).transpose()?;
    let sweep = args.server.client()?.extend_sweep(SweepId(args.id), &more).await?;
    list::print_sweep(sweep, args.json)?;
    Ok(Exit::Done)
}

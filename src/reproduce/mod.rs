//! `roost reproduce`: the paper's programme, simulated anew, as a report beside the paper's numbers.
//!
//! [`figures`] says what to simulate and what the results tell, [`profile`] how much; [`plan`] makes tasks of it, [`crew`] runs
//! them, [`record`] keeps what came out, and [`report`] writes it down.

mod crew;
mod figures;
mod picture;
mod plan;
mod profile;
mod progress;
mod record;
mod report;
mod row;
mod stats;

use std::path::{Path, PathBuf};

use anyhow::Result;
use roost_worker::device::Device;

use crate::exit::Exit;
use crate::signals;
use crate::ui;
use crate::ui::format;
use crate::ui::table::Table;
use crate::work::{say_threads, threads};
use crew::{News, work};
use plan::{Figure, Part, Plan, Results};
use profile::Profile;
use progress::Progress;
use record::{Record, Store};
use report::{Report, Section};

/// Simulate the paper's experiments anew and write a report beside its numbers
///
/// Writes report.html, one file to read, and report.json, the same rows for programs. What has run is kept: after Ctrl-C the
/// same command goes on where it was, and only what was running is lost.
#[derive(Debug, clap::Args)]
pub(crate) struct Args {
    /// What to reproduce
    #[arg(value_enum, default_value = "all", value_name = "PART")]
    parts: Vec<Part>,
    /// Coarse, a few seeds: under 10 minutes on two cores (the default)
    #[arg(long, group = "size")]
    quick: bool,
    /// The whole hopper: under 2 hours on two cores
    #[arg(long, group = "size")]
    standard: bool,
    /// Sub-particles as small as the paper's: a night
    #[arg(long, group = "size")]
    full: bool,
    /// One of the above by name
    #[arg(long, group = "size", value_enum, hide = true)]
    profile: Option<profile::Name>,
    /// Folder for the report and the results of its runs
    #[arg(short, long, visible_alias = "out", default_value = "reproduce-out", value_name = "DIR")]
    output: PathBuf,
    /// Threads to use; 0 means one per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads())]
    threads: u16,
    /// Show what would run, and run nothing
    #[arg(long)]
    plan: bool,
}

impl Args {
    fn profile(&self) -> &'static Profile {
        let name = match (self.profile, self.standard, self.full) {
            (Some(name), _, _) => name,
            (None, true, _) => profile::Name::Standard,
            (None, _, true) => profile::Name::Full,
            _ => profile::Name::Quick,
        };
        name.profile()
    }

    fn wants(&self, part: Part) -> bool {
        self.parts.iter().any(|wanted| *wanted == Part::All || *wanted == part)
    }
}

pub(crate) async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown()?;
    tokio::task::spawn_blocking(move || reproduce(&args, &|| shutdown.is_cancelled())).await?
}

/// What has become of each task, by its index.
type Ended = Vec<Option<Result<Record, String>>>;

fn reproduce(args: &Args, stop: &dyn Fn() -> bool) -> Result<Exit> {
    let profile = args.profile();
    let figures = figures::all(profile).into_iter().filter(|figure| args.wants(figure.part));
    let plan = Plan::new(figures.collect())?;
    let store = Store::in_folder(args.output.join("runs"));
    let mut ended: Ended =
        plan.tasks.iter().map(|task| store.load(&task.digest, &task.shots).map(Ok)).collect();
    if args.plan {
        ui::print(format_args!("{}\n", outline(&plan, &ended)))?;
        return Ok(Exit::Done);
    }
    store.prepare()?;
    say_threads(args.threads, &Device::cpu());
    let threads = roost_worker::threads(args.threads.into());
    let order: Vec<usize> = plan.order().into_iter().filter(|index| ended[*index].is_none()).collect();
    write(&args.output, profile, &plan, &ended)?;
    let mut progress = Progress::new(&plan, &order);
    work(&plan.tasks, &order, threads, stop, &mut |news| {
        match news {
            News::Progress(index, fraction) => progress.show(index, fraction),
            News::Ended(index, end) => {
                if let Ok(record) = end.as_ref() {
                    store.save(record)?;
                }
                ended[index] = Some(*end);
                if progress.ended(index) {
                    write(&args.output, profile, &plan, &ended)?;
                }
            }
        }
        Ok(())
    })?;
    drop(progress);
    // What was stopped in the middle of a figure has ended runs that the last report does not count.
    ui::print(write(&args.output, profile, &plan, &ended)? + "\n")?;
    let is_complete = ended.iter().all(Option::is_some);
    if !is_complete {
        ui::say!("stopped; the same command goes on from here");
    }
    let is_sound = ended.iter().flatten().all(Result::is_ok);
    Ok(if is_complete && is_sound { Exit::Done } else { Exit::Failed })
}

/// Writes the report as far as there is one; returns a summary.
fn write(folder: &Path, profile: &Profile, plan: &Plan, ended: &Ended) -> Result<String> {
    let sections =
        plan.figures.iter().zip(&plan.uses).map(|(figure, used)| section(profile, figure, used, ended));
    let records = ended.iter().flatten().flatten();
    let report = Report { profile, machine: machines(records), sections: sections.collect() };
    let files = ["report.html", "report.json"].map(|name| folder.join(name));
    record::write(&files[0], report.html().as_bytes())?;
    record::write(&files[1], report.json().as_bytes())?;
    Ok(format!("{}\n{}  {}", summary(&report), files[0].display(), files[1].display()))
}

/// What a figure tells once all of its runs have ended.
fn section<'a>(profile: &Profile, figure: &'a Figure, used: &[usize], ended: &'a Ended) -> Section<'a> {
    let of = |index: &usize| ended[*index].as_ref().map(|end| end.as_ref().map_err(String::as_str));
    let ended: Vec<Option<Result<&Record, &str>>> = used.iter().map(of).collect();
    let told = ended.iter().all(Option::is_some).then(|| {
        let record = |end: &Option<Result<&'a Record, &str>>| end.as_ref()?.as_ref().ok().copied();
        let runs = figure.runs.iter().zip(&ended).map(|(run, end)| (run.name.as_str(), record(end)));
        (figure.tell)(profile, &Results { runs: runs.collect() })
    });
    Section { figure, ended, told }
}

/// What computed the records: each machine and backend once.
fn machines<'a>(records: impl Iterator<Item = &'a Record>) -> String {
    let mut all: Vec<String> = records.map(Record::computed_by).collect();
    all.sort();
    all.dedup();
    if all.is_empty() { "nothing yet".to_owned() } else { all.join("; ") }
}

/// A line a figure, and what does not hold below.
fn summary(report: &Report<'_>) -> String {
    let mut table = Table::new(["figure", "demands that hold"]);
    for section in &report.sections {
        table.row([section.figure.name.to_owned(), section.held()]);
    }
    let failed = report.rows().filter(|row| row.holds == Some(false));
    let failed = failed.map(|row| format!("does not hold: {}: {}\n", row.figure, row.quantity));
    format!("{table}\n{}", failed.collect::<String>())
}

/// What would run, figure by figure.
fn outline(plan: &Plan, ended: &Ended) -> Table {
    let mut table =
        Table::new(["figure", "simulations", "there already", "sub-particles", "on two threads, about"]);
    let (mut counted, mut all_s) = (Vec::new(), 0.0);
    for (figure, used) in plan.figures.iter().zip(&plan.uses) {
        let there = used.iter().filter(|index| ended[**index].is_some()).count();
        let most =
            used.iter().map(|index| plan.tasks[*index].checked.estimate().subparticles).max().unwrap_or(0);
        let fresh: Vec<usize> = used
            .iter()
            .copied()
            .filter(|index| ended[*index].is_none() && !counted.contains(index))
            .collect();
        let cost_s = fresh.iter().map(|index| plan.tasks[*index].cost).sum::<f64>();
        counted.extend(fresh);
        all_s += cost_s;
        table.row([
            figure.name.to_owned(),
            used.len().to_string(),
            there.to_string(),
            format!("up to {}", format::count(most as f64)),
            format::duration(cost_s),
        ]);
    }
    let there = ended.iter().flatten().count();
    let (tasks, there) = (plan.tasks.len().to_string(), there.to_string());
    table.row(["all, each once".to_owned(), tasks, there, String::new(), format::duration(all_s)]);
    table
}

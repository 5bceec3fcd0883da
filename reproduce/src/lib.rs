//! `roost reproduce`: simulations of the paper's figures and tables, reported beside the paper's numbers.
//!
//! `figures` defines the runs of each figure and evaluates their results, `profile` sets the sizes. `plan` turns the runs
//! into tasks, `scheduler` runs them, `record` saves each result, and `report` writes the report. `document` holds
//! the rows for other programs.

mod document;
mod figures;
mod numbers;
mod picture;
mod plan;
mod profile;
mod progress;
mod record;
mod report;
mod row;
mod scheduler;

use std::path::PathBuf;

use anyhow::Result;
use roost_terminal::{Exit, Table, format, message, print_lines, signals, threads};

pub use document::Document;
use plan::{Figure, Part, Plan, Results};
use profile::Profile;
use progress::Progress;
use record::{Record, Store};
use report::{Report, Section};
use scheduler::Event;

/// Simulate the paper's experiments, and write a report that compares the results with the paper
///
/// The paper is Vink et al. 2026, from which the model of Roost comes. The command writes three files: report.html is for people,
/// report.json has the same rows for programs, and report.md has the tables. The command stores the results of finished runs. Every
/// minute, it also stores a checkpoint of each unfinished run. After Ctrl-C, repeat the same command to continue.
#[derive(Debug, clap::Args)]
pub struct Args {
    /// Parts of the report
    #[arg(value_enum, default_value = "all", value_name = "PART")]
    parts: Vec<Part>,
    /// Simulate a slice (narrow part) of the hopper, with large sub-particles and few seeds. The simulations take under 10 minutes on
    /// two processor cores. This option is the default
    #[arg(long, group = "size")]
    quick: bool,
    /// Simulate the hopper at full width, with more seeds. The simulations take between half an hour and two hours, depending on the
    /// machine
    #[arg(long, group = "size")]
    standard: bool,
    /// Simulate with sub-particles as small as in the paper. The simulations take a night on two processor cores
    #[arg(long, group = "size")]
    full: bool,
    /// A profile by name
    #[arg(long, group = "size", value_enum, hide = true)]
    profile: Option<profile::Name>,
    /// Folder for the report and the results of its runs
    #[arg(short, long, visible_alias = "out", default_value = "reproduce-out", value_name = "DIR")]
    output: PathBuf,
    /// Number of threads to use; 0 means one thread per processor
    #[arg(long, default_value_t = 0, value_name = "N", value_parser = threads::value_parser())]
    threads: u16,
    /// Show the planned simulations, but do not simulate them
    #[arg(long)]
    plan: bool,
    /// Commit of the source, stated in report.json and report.md
    #[arg(long, value_name = "COMMIT", hide = true)]
    commit: Option<String>,
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

    fn includes(&self, part: Part) -> bool {
        self.parts.iter().any(|requested| *requested == Part::All || *requested == part)
    }
}

/// Runs the simulations that have no record yet, and writes the report.
///
/// # Errors
/// If a file cannot be written.
pub async fn execute(args: Args) -> Result<Exit> {
    let shutdown = signals::shutdown_token()?;
    tokio::task::spawn_blocking(move || reproduce(&args, &|| shutdown.is_cancelled())).await?
}

/// For each task, by its index: its record, its error message, or none if it has not ended.
type Ends = Vec<Option<Result<Record, String>>>;

fn reproduce(args: &Args, should_stop: &dyn Fn() -> bool) -> Result<Exit> {
    let profile = args.profile();
    let figures = figures::all(profile).into_iter().filter(|figure| args.includes(figure.part));
    let plan = Plan::new(figures.collect())?;
    let store = Store::in_folder(args.output.join("runs"));
    let mut ends: Ends =
        plan.tasks.iter().map(|task| store.load(&task.digest, &task.shots).map(Ok)).collect();
    if args.plan {
        print_lines(format_args!("{}\n", plan_table(&plan, &ends)))?;
        return Ok(Exit::Done);
    }
    store.create_folder()?;
    threads::warn_if_too_many(args.threads);
    let order: Vec<usize> = plan.order().into_iter().filter(|index| ends[*index].is_none()).collect();
    write_report(args, &plan, &ends)?;
    let mut progress = Progress::new(&plan, &order);
    let threads = threads::count(args.threads);
    scheduler::run_all(&plan.tasks, &order, threads, &store, should_stop, &mut |event| {
        match event {
            Event::Progress(index, fraction) => progress.update(index, fraction),
            Event::Ended(index, end) => {
                if let Ok(record) = end.as_ref() {
                    store.save(record)?;
                }
                ends[index] = Some(*end);
                if progress.end(index) {
                    write_report(args, &plan, &ends)?;
                }
            }
        }
        Ok(())
    })?;
    drop(progress);
    // After a stop within a figure, the last report lacks the runs that have ended since.
    print_lines(write_report(args, &plan, &ends)? + "\n")?;
    let is_complete = ends.iter().all(Option::is_some);
    if !is_complete {
        message!("stopped; the same command continues from here");
    }
    let has_no_error = ends.iter().flatten().all(Result::is_ok);
    Ok(if is_complete && has_no_error { Exit::Done } else { Exit::Failed })
}

/// Writes the report of the runs that have ended. Returns a summary.
fn write_report(args: &Args, plan: &Plan, ends: &Ends) -> Result<String> {
    let (folder, profile) = (&args.output, args.profile());
    let sections =
        plan.figures.iter().zip(&plan.uses).map(|(figure, used)| section(profile, figure, used, ends));
    let records = ends.iter().flatten().flatten();
    let commit = args.commit.clone();
    let report = Report { profile, machine: machines(records), commit, sections: sections.collect() };
    let document = report.document();
    let files = ["report.html", "report.json", "report.md"].map(|name| folder.join(name));
    record::write_atomically(&files[0], report.html().as_bytes())?;
    record::write_atomically(&files[1], document.json().as_bytes())?;
    record::write_atomically(&files[2], document.markdown().as_bytes())?;
    Ok(format!("{}\n{}  {}", summary(&report), files[0].display(), files[1].display()))
}

/// The section of a figure, which is evaluated once all of its runs have ended.
fn section<'a>(profile: &Profile, figure: &'a Figure, used: &[usize], ends: &'a Ends) -> Section<'a> {
    let end_of = |index: &usize| ends[*index].as_ref().map(|end| end.as_ref().map_err(String::as_str));
    let ended: Vec<Option<Result<&Record, &str>>> = used.iter().map(end_of).collect();
    let evaluation = ended.iter().all(Option::is_some).then(|| {
        let record = |end: &Option<Result<&'a Record, &str>>| end.as_ref()?.as_ref().ok().copied();
        let runs = figure.runs.iter().zip(&ended).map(|(run, end)| (run.name.as_str(), record(end)));
        (figure.evaluate)(profile, &Results { runs: runs.collect() })
    });
    Section { figure, ended, evaluation }
}

/// Machines and backends of the records, each once.
fn machines<'a>(records: impl Iterator<Item = &'a Record>) -> String {
    let mut names: Vec<String> = records.map(Record::computed_by).collect();
    names.sort();
    names.dedup();
    if names.is_empty() { "no machine yet".to_owned() } else { names.join("; ") }
}

/// One line per figure, and the demands that do not hold.
fn summary(report: &Report<'_>) -> String {
    let mut table = Table::new(["figure", "demands that hold"]);
    for section in &report.sections {
        table.row([section.figure.name.to_owned(), section.demands_text()]);
    }
    let failed = report.rows().filter(|row| row.holds == Some(false));
    let failed = failed.map(|row| format!("does not hold: {}: {}\n", row.figure, row.quantity));
    format!("{table}\n{}", failed.collect::<String>())
}

/// The planned simulations, one line per figure.
fn plan_table(plan: &Plan, ends: &Ends) -> Table {
    let mut table =
        Table::new(["figure", "simulations", "finished", "sub-particles", "estimate on two threads"]);
    let (mut counted, mut total_s) = (Vec::new(), 0.0);
    for (figure, used) in plan.figures.iter().zip(&plan.uses) {
        let finished = used.iter().filter(|index| ends[**index].is_some()).count();
        let maximum =
            used.iter().map(|index| plan.tasks[*index].checked.estimate().subparticles).max().unwrap_or(0);
        let pending: Vec<usize> =
            used.iter().copied().filter(|index| ends[*index].is_none() && !counted.contains(index)).collect();
        let cost_s = pending.iter().map(|index| plan.tasks[*index].cost_s).sum::<f64>();
        counted.extend(pending);
        total_s += cost_s;
        table.row([
            figure.name.to_owned(),
            used.len().to_string(),
            finished.to_string(),
            format!("up to {}", format::count(maximum as f64)),
            format::duration(cost_s),
        ]);
    }
    let (tasks, finished) = (plan.tasks.len().to_string(), ends.iter().flatten().count().to_string());
    table.row(["all, without repeats".to_owned(), tasks, finished, String::new(), format::duration(total_s)]);
    table
}

//! The loop of a pool: look at Slurm and the server, decide, submit and cancel, remember.

use std::collections::BTreeMap;

use anyhow::{Context, Result};
use roost_api::queue::QueueDepth;
use roost_api::time::Timestamp;
use roost_terminal::{Exit, signals};
use roost_worker::client::{Client, ClientError};
use tokio_util::sync::CancellationToken;
use uuid::Uuid;

use super::args::SlurmArgs;
use super::ledger::{self, Folder, Ledger};
use super::observe::WorkerSearch;
use super::rule::{Decision, Look, WARNINGS, counted, decide, fitting_jobs};
use super::script::SlurmSubmission;
use super::{default_state, observe, slurm};

/// Number of workers on a page of the server.
const PAGE: u32 = 500;

/// A running pool.
struct Pool {
    args: SlurmArgs,
    client: Client,
    folder: Folder,
    ledger: Ledger,
    submission: SlurmSubmission,
    /// Asks the pool to end.
    shutdown: CancellationToken,
    /// Allocations that have ended, and are not counted as failures or proofs yet: the server has not answered.
    ended: Vec<u64>,
    /// Since when no job that fits has been queued.
    empty_since: Option<Timestamp>,
    /// The last text about each subject: a text is logged when it changes.
    said: BTreeMap<&'static str, String>,
}

pub(super) async fn execute(args: SlurmArgs) -> Result<Exit> {
    args.check()?;
    slurm::check().await?;
    let shutdown = signals::shutdown_token()?;
    let mut pool = Pool::open(args, shutdown)?;
    // A wrong address or token shows at once.
    match pool.client.queue_depth().await {
        Err(error) if !error.is_transient() => return Err(error.into()),
        _ => {}
    }
    let looked = pool.look_until_shutdown().await;
    let ended = pool.end().await;
    looked.and(ended)?;
    Ok(Exit::Done)
}

/// The ledger of a folder for these options; a new one if no pool has used the folder.
pub(super) fn ledger_for(args: &SlurmArgs, stored: Option<Ledger>) -> Ledger {
    let now = Timestamp::now();
    let new_name = || format!("roost-pool-{:08x}", Uuid::new_v4().as_u128() as u32);
    let mut ledger = stored.unwrap_or_else(|| Ledger::new(new_name(), now));
    let server = args.server.address().to_owned();
    let is_elsewhere = ledger.sbatch != args.sbatch || ledger.server != server;
    if is_elsewhere {
        // Other nodes may have other devices.
        ledger.worker = None;
    }
    if is_elsewhere || ledger.roost != args.roost {
        // The user has corrected an option: the pool tries it at once.
        ledger.failures = Default::default();
    }
    (ledger.sbatch, ledger.server) = (args.sbatch.clone(), server);
    ledger.roost = args.roost.clone();
    ledger.retry_pause_s = args.retry_pause.as_secs();
    if let (Some(worker), Some(slots)) = (&mut ledger.worker, args.fixed_slots()) {
        worker.slots = slots;
    }
    ledger
}

/// Warns of an address that other machines cannot reach.
pub(super) fn loopback_warning(server: &str) -> Option<String> {
    let host = server.split("://").nth(1)?.trim_start_matches('[');
    let is_loopback = ["127.", "localhost", "::1"].iter().any(|name| host.starts_with(name));
    is_loopback.then(|| {
        format!("{server} is an address of this machine: workers on other nodes cannot reach it; name another with --server")
    })
}

/// The decision after a look at the queue, with the ledger's allocations.
pub(super) fn decision(
    args: &SlurmArgs,
    ledger: &Ledger,
    depth: &QueueDepth,
    empty_since: Option<Timestamp>,
    now: Timestamp,
) -> Decision {
    let look = Look {
        now,
        by_needs: &depth.by_needs,
        empty_since,
        waiting: ledger.waiting(),
        starting: ledger.running(false),
        working: ledger.running(true),
        unproven: ledger.unproven(),
        unseen_workers: ledger.unseen_workers(args.workers_per_alloc, depth.made_at, now),
        worker: ledger.worker.as_ref(),
        failures: &ledger.failures,
    };
    decide(&args.limits(), &look)
}

impl Pool {
    fn open(args: SlurmArgs, shutdown: CancellationToken) -> Result<Self> {
        let client = args.server.client()?;
        let path = args.state.clone().unwrap_or_else(default_state);
        let folder = Folder::open(&path)?;
        let ledger = ledger_for(&args, ledger::read(folder.path())?);
        let submission = SlurmSubmission::new(&args, &ledger.name, folder.path())?;
        folder.save(&ledger)?;
        let held = ledger.held().count() as u64;
        tracing::info!(
            "pool {} of {} remembers {}",
            ledger.name,
            client.server(),
            counted(held, "allocation")
        );
        if let Some(warning) = loopback_warning(client.server()) {
            tracing::warn!("{warning}");
        }
        Ok(Self {
            args,
            client,
            folder,
            ledger,
            submission,
            shutdown,
            ended: Vec::new(),
            empty_since: None,
            said: BTreeMap::new(),
        })
    }

    async fn look_until_shutdown(&mut self) -> Result<()> {
        while !self.shutdown.is_cancelled() {
            self.turn().await?;
            let pause = tokio::time::sleep(self.args.interval);
            let _ = self.shutdown.run_until_cancelled(pause).await;
        }
        Ok(())
    }

    /// One look, and its actions. Slurm or a server that does not answer leaves everything as it is.
    async fn turn(&mut self) -> Result<()> {
        match self.look().await {
            Ok(_) if self.shutdown.is_cancelled() => {}
            Ok(depth) => {
                self.said.remove("trouble");
                self.act(&depth).await?;
            }
            Err(why) => self.say("trouble", why),
        }
        self.ledger.updated_at = Timestamp::now();
        let forgotten = self.ledger.forget_old();
        self.folder.save(&self.ledger)?;
        self.folder.remove_logs(&forgotten);
        Ok(())
    }

    /// Looks at Slurm, at the workers and at the queue.
    async fn look(&mut self) -> Result<QueueDepth, String> {
        let known = self.ledger.allocations.len();
        let jobs = slurm::jobs(&self.ledger.name).await?;
        let missing = observe::missing(&self.ledger, &jobs);
        let by_id = slurm::jobs_by_id(&missing).await?;
        let now = Timestamp::now();
        let mut ended = observe::record_jobs(&mut self.ledger, &jobs, now);
        for adopted in &self.ledger.allocations[known..] {
            tracing::info!("adopted allocation {}", adopted.id);
        }
        ended.extend(observe::record_jobs(&mut self.ledger, &by_id, now));
        for id in missing.into_iter().filter(|id| by_id.iter().all(|job| job.id != *id)) {
            observe::record_forgotten(&mut self.ledger, id, now);
            ended.push(id);
        }
        for one in self.ledger.allocations.iter().filter(|one| ended.contains(&one.id)) {
            tracing::info!("allocation {} ended: {}", one.id, one.state.as_str());
        }
        self.ended.extend(ended);
        self.record_workers(now).await.map_err(|error| error.to_string())?;
        let ended = std::mem::take(&mut self.ended);
        observe::record_proofs(&mut self.ledger, &ended, now);
        let log = |id| self.folder.last_log_line(id);
        if let Some(why) = observe::record_failures(&mut self.ledger, &ended, log, now) {
            tracing::warn!("{why}");
        }
        self.client.queue_depth().await.map_err(|error| error.to_string())
    }

    /// Asks the server for workers while an allocation may have new ones.
    async fn record_workers(&mut self, now: Timestamp) -> Result<(), ClientError> {
        let per_alloc = self.args.workers_per_alloc;
        let Some(mut search) = WorkerSearch::new(&self.ledger, &self.ended, per_alloc, now) else {
            return Ok(());
        };
        let (mut workers, mut cursor) = (Vec::new(), None::<String>);
        loop {
            let page = self.client.workers(cursor.as_deref(), PAGE).await?;
            let is_over = search.ends_with(&page.items);
            workers.extend(page.items);
            cursor = page.next_cursor;
            if is_over || cursor.is_none() {
                break;
            }
        }
        let slots = self.args.fixed_slots();
        for id in observe::record_workers(&mut self.ledger, &workers, slots, now) {
            tracing::info!("a worker of allocation {id} has registered");
        }
        Ok(())
    }

    /// Decides, and follows the decision.
    async fn act(&mut self, depth: &QueueDepth) -> Result<()> {
        let now = Timestamp::now();
        let has_jobs = fitting_jobs(&depth.by_needs, self.ledger.worker.as_ref()) > 0;
        self.empty_since = if has_jobs { None } else { self.empty_since.or(Some(now)) };
        let decision = decision(&self.args, &self.ledger, depth, self.empty_since, now);
        self.warn(&decision);
        if let Some(pause) = &decision.pause {
            let failures = self.ledger.failures.in_a_row;
            self.say(
                "pause",
                format!("paused until {} after {failures} failures: {}", pause.until, pause.why),
            );
        }
        self.ledger.why = decision.why.clone();
        self.submit(&decision).await?;
        if !decision.cancel.is_empty() {
            match slurm::cancel_waiting(&decision.cancel).await {
                Ok(()) => {
                    self.ledger.note_cancelled(&decision.cancel);
                    let count = counted(decision.cancel.len() as u64, "waiting allocation");
                    tracing::info!("cancelled {count}: {}", decision.why);
                }
                Err(why) => self.say("cancel", why),
            }
        }
        Ok(())
    }

    async fn submit(&mut self, decision: &Decision) -> Result<()> {
        for _ in 0..decision.submit {
            if self.shutdown.is_cancelled() {
                break;
            }
            match slurm::submit(&self.submission.arguments, &self.submission.script).await {
                Ok(id) => {
                    tracing::info!("submitted allocation {id}: {}", decision.why);
                    self.ledger.submitted += 1;
                    self.ledger.allocations.push(ledger::Allocation::waiting(id, Timestamp::now()));
                    // A pool that dies here finds the allocation by its name.
                    self.folder.save(&self.ledger)?;
                }
                Err(why) => {
                    tracing::warn!("Slurm refused an allocation: {why}");
                    self.ledger.failures.add(Timestamp::now(), why);
                    break;
                }
            }
        }
        Ok(())
    }

    /// Leaves the allocations, or cancels them.
    async fn end(&mut self) -> Result<()> {
        let held: Vec<u64> = self.ledger.held().map(|one| one.id).collect();
        let count = counted(held.len() as u64, "allocation");
        if self.args.cancel_on_exit {
            // By name, since an interrupted submission may not be in the ledger.
            slurm::cancel_all(&self.ledger.name)
                .await
                .map_err(anyhow::Error::msg)
                .context("cannot cancel allocations")?;
            self.ledger.note_cancelled(&held);
            tracing::info!("cancelled {count}; their workers hand their jobs back");
        } else if !held.is_empty() {
            tracing::info!("{count} continue; the same command adopts them");
        }
        self.ledger.updated_at = Timestamp::now();
        self.folder.save(&self.ledger)
    }

    /// Logs the warnings of a decision that the one before had not. Their numbers may change with every look.
    fn warn(&mut self, decision: &Decision) {
        let is_over = |subject: &&str| !decision.warnings.iter().any(|(one, _)| one == subject);
        for subject in WARNINGS.iter().filter(|subject| is_over(subject)) {
            self.said.remove(subject);
        }
        for (subject, text) in &decision.warnings {
            if !self.said.contains_key(subject) {
                self.say(subject, text.clone());
            }
        }
    }

    /// Logs a text about a subject when it changes.
    fn say(&mut self, subject: &'static str, text: String) {
        if self.said.get(subject) != Some(&text) {
            tracing::warn!("{text}");
            self.said.insert(subject, text);
        }
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Parser)]
    struct Cli {
        #[command(flatten)]
        args: SlurmArgs,
    }

    #[test]
    fn corrected_options_end_the_failures() {
        let start = |stored: Option<Ledger>, words: &[&str]| {
            let words = ["pool", "--server", "http://head:7373"].iter().chain(words);
            let cli = Cli::try_parse_from(words).unwrap_or_else(|error| panic!("{error}"));
            ledger_for(&cli.args, stored)
        };
        let mut failed = start(None, &["--roost", "/a/roost", "--", "--partition=a"]);
        failed.failures.add(Timestamp(1), "refused".to_owned());
        let failures = |words: &[&str]| start(Some(failed.clone()), words).failures.in_a_row;
        assert_eq!(failures(&["--backlog", "9", "--roost", "/a/roost", "--", "--partition=a"]), 1);
        assert_eq!(failures(&["--roost", "/a/roost", "--", "--partition=b"]), 0);
        assert_eq!(failures(&["--roost", "/b/roost", "--", "--partition=a"]), 0);
        assert_eq!(failures(&["--", "--partition=a"]), 0);
    }

    #[test]
    fn loopback_addresses_are_warned_of() {
        for server in ["http://127.0.0.1:7373", "http://localhost:7373", "https://[::1]:7373"] {
            assert!(loopback_warning(server).is_some(), "{server}");
        }
        for server in ["http://head:7373", "https://roost.example", "http://10.0.0.1:7373"] {
            assert_eq!(loopback_warning(server), None, "{server}");
        }
    }
}

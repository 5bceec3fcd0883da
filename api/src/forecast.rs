//! Why queued jobs wait, and when jobs, sweeps and studies are expected to start and end.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ids::JobId;
use crate::time::Timestamp;
use crate::words::words;

words!(
    /// Why a queued job waits.
    WaitReason {
        /// A user has paused it.
        Paused = "paused",
        /// An attempt has failed; the next one may start after a pause.
        RetryPause = "retry_pause",
        /// Its project has used up its budget of core-hours.
        BudgetUsed = "budget_used",
        /// No worker that takes jobs is online.
        NoWorker = "no_worker",
        /// Workers are online, but none has what the job needs.
        NoFittingWorker = "no_fitting_worker",
        /// Another job computes its filled state.
        WaitingForFill = "waiting_for_fill",
        /// It runs alone, and every fitting worker runs other jobs.
        NeedsIdleWorker = "needs_idle_worker",
        /// Other jobs come first.
        Behind = "behind",
        /// It is the next job, and every slot of the fitting workers is taken.
        WorkersBusy = "workers_busy",
        /// It is the next job, and a fitting worker has a free slot.
        Next = "next",
    }
);

/// Why a queued job waits.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Waiting {
    /// The reason.
    pub reason: WaitReason,
    /// The reason in words, with numbers.
    pub detail: String,
    /// When the job was queued or paused.
    #[schema(value_type = String, format = DateTime)]
    pub since: Timestamp,
    /// The end of a pause after a failure.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub until: Option<Timestamp>,
    /// Number of jobs that come first, whatever the reason; an estimate above 1,000. Null where no worker could take the job.
    pub behind: Option<u64>,
    /// The job that computes the filled state.
    pub fill_job_id: Option<JobId>,
}

/// Number of queued jobs that wait for one reason.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct WaitCount {
    /// The reason.
    pub reason: WaitReason,
    /// Number of jobs.
    pub jobs: u64,
    /// The reason in words, for the first of these jobs.
    pub detail: String,
}

/// A range of time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct TimeRange {
    /// The earlier end.
    #[schema(value_type = String, format = DateTime)]
    pub earliest: Timestamp,
    /// The later end.
    #[schema(value_type = String, format = DateTime)]
    pub latest: Timestamp,
}

/// A range of a number of runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
pub struct RunRange {
    /// At least so many.
    pub least: u64,
    /// At most so many.
    pub most: u64,
}

/// A range of a duration, in seconds.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DurationRange {
    /// The shorter one.
    pub shortest_s: f64,
    /// The longer one.
    pub longest_s: f64,
}

words!(
    /// The finished runs that a forecast learned from.
    LearnedFrom {
        /// Runs of the same sweep or study.
        Sweep = "sweep",
        /// Runs of other jobs on the same backend.
        Backend = "backend",
        /// No run: only the check's rough estimate of the cost.
        Nothing = "nothing",
    }
);

/// The facts that a forecast rests on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ForecastBasis {
    /// Online workers that can take the jobs.
    pub workers: u64,
    /// Jobs that these workers run at the same time.
    pub slots: u64,
    /// Number of finished runs that it learned from.
    pub finished_runs: u64,
    /// Kind of these runs.
    pub learned_from: LearnedFrom,
    /// Measured wall time over the estimate of the check: the median of these runs.
    pub time_ratio: f64,
    /// Share of forecasts whose range holds the true time.
    pub share: f64,
}

/// The forecast of a job, a sweep or a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Forecast {
    /// Queued jobs by the reason why they wait.
    pub waiting: Vec<WaitCount>,
    /// When the first job is expected to start; null when one has started, or without a forecast.
    pub start: Option<TimeRange>,
    /// When the last job is expected to end; null without a forecast.
    pub end: Option<TimeRange>,
    /// Why there is no forecast; null with one.
    pub no_forecast: Option<String>,
    /// Runs that are left: of a study a range, since its rule may end it early.
    pub runs_left: RunRange,
    /// The facts it rests on; null without a forecast.
    pub basis: Option<ForecastBasis>,
    /// When it was made.
    #[schema(value_type = String, format = DateTime)]
    pub made_at: Timestamp,
}

/// The forecast of a document that is not submitted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CostForecast {
    /// Number of runs.
    pub runs: RunRange,
    /// Processor time of all runs, if each has one thread; null for a study whose runs clients make.
    pub processor: Option<DurationRange>,
    /// Wall time from the submission to the last result; null without workers, and for a study whose runs clients make.
    pub duration: Option<DurationRange>,
    /// When the last result would come, if it were submitted now; null like the duration.
    pub end: Option<TimeRange>,
    /// Why there is no duration; null with one.
    pub no_forecast: Option<String>,
    /// The facts it rests on; null without workers.
    pub basis: Option<ForecastBasis>,
}

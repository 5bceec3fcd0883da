//! Results of a sweep: the table of its trials, the same by design point, and the effects of its factors.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use utoipa::ToSchema;

use crate::ids::JobId;
use crate::job::{FailureClass, JobState};
use crate::sweep::{StateCounts, SweepView};

/// One trial of a sweep's result table.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TrialRow {
    /// The job.
    pub job_id: JobId,
    /// Design point.
    pub point: u32,
    /// Replicate.
    pub replicate: u32,
    /// Seed.
    pub seed: u64,
    /// Levels by JSON pointer.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
    /// State of the job.
    pub state: JobState,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
    /// Backend that made the result.
    pub backend: Option<String>,
    /// Solver revision that made the result.
    pub solver_revision: Option<u32>,
    /// Scalar results.
    #[schema(value_type = Object)]
    pub responses: Map<String, Value>,
}

/// The result table of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepResults {
    /// The sweep.
    pub sweep: SweepView,
    /// One row a trial, by point and replicate.
    pub trials: Vec<TrialRow>,
    /// Pass as `cursor` to get the rows after these; null when these are the last.
    #[serde(default)]
    pub next_cursor: Option<String>,
}

/// The results of a sweep by design point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepPoints {
    /// The sweep.
    pub sweep: SweepView,
    /// One row a design point, by index.
    pub points: Vec<PointRow>,
    /// Pass as `cursor` to get the rows after these; null when these are the last.
    #[serde(default)]
    pub next_cursor: Option<String>,
}

/// What the replicates of one design point came to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PointRow {
    /// Design point.
    pub point: u32,
    /// Levels by factor.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
    /// Its trials by state.
    pub counts: StateCounts,
    /// How many of the failed ones were unstable: they are in no mean.
    pub unstable: u64,
    /// Responses by name, of the trials that succeeded.
    pub responses: BTreeMap<String, Summary>,
}

/// One response over the replicates of a design point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Summary {
    /// Trials that have a value; null is none.
    pub n: u64,
    /// Mean, of numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Standard deviation with n − 1; of two numbers or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_deviation: Option<f64>,
    /// Lower end of the 95 % interval of the mean (Student); of two numbers or more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low_95: Option<f64>,
    /// Its upper end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high_95: Option<f64>,
    /// How often each word was the answer, of words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub words: Option<BTreeMap<String, u64>>,
}

/// One series of many jobs of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepSeries {
    /// Name of the series.
    pub name: String,
    /// Its unit; null while no job has it.
    pub unit: Option<String>,
    /// One entry a job that has it, by point and replicate.
    pub items: Vec<JobSeries>,
    /// Pass as `cursor` to get the jobs after these; null when these are the last.
    pub next_cursor: Option<String>,
}

/// The series of one job, thinned.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct JobSeries {
    /// The job.
    pub job_id: JobId,
    /// Design point.
    pub point: u32,
    /// Replicate.
    pub replicate: u32,
    /// State of the job.
    pub state: JobState,
    /// Whether the job runs, and more is to come.
    pub partial: bool,
    /// Belt times, in seconds.
    pub t_s: Vec<f64>,
    /// The samples, as many.
    pub values: Vec<f64>,
}

/// How the factors of a sweep act on each response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepEffects {
    /// The sweep.
    pub sweep: SweepView,
    /// One entry a response, by name; of words, one for each word that was an answer, called `name=word`, whose value is
    /// the share of trials that had it.
    pub responses: Vec<ResponseEffects>,
}

/// How the factors act on one response. A design point counts once, with the mean of its replicates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ResponseEffects {
    /// Name of the response.
    pub response: String,
    /// Design points that have a value.
    pub points: u64,
    /// Mean over them.
    pub mean: f64,
    /// One entry a factor, in the order of the sweep.
    pub factors: Vec<FactorEffect>,
}

/// How one factor acts on one response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FactorEffect {
    /// Name of the factor.
    pub factor: String,
    /// Main effect: the change of the response from the lowest to the highest value of the factor along the straight line of
    /// least squares; over logarithms where the scale is one. Of numbers that vary.
    pub effect: Option<f64>,
    /// Rank correlation of factor and response (Spearman), −1 to 1. Of numbers that vary.
    pub rank_correlation: Option<f64>,
    /// How likely a rank correlation as far from zero is by chance (Student's t, both sides); of three points or more.
    pub p_value: Option<f64>,
    /// Means at each value of the factor, where there are no more than twelve.
    pub levels: Vec<LevelEffect>,
}

/// The response at one value of a factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LevelEffect {
    /// The value.
    pub level: Value,
    /// Design points that have it.
    pub points: u64,
    /// Mean response over them.
    pub mean: f64,
    /// That, less the mean over all points.
    pub effect: f64,
}

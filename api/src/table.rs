//! Results of a sweep: by trial, by design point, as series, and as effects of factors.

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
    /// Parameters that the trial drew from a posterior, by JSON pointer; left out in any other sweep, and for runs of studies.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    #[schema(value_type = Object)]
    pub parameters: Map<String, Value>,
    /// State of the job.
    pub state: JobState,
    /// Why it failed.
    pub failure_class: Option<FailureClass>,
    /// Backend of the result.
    pub backend: Option<String>,
    /// Solver revision of the result.
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
    /// A row for each trial, by design point and replicate.
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
    /// A row for each design point, by index.
    pub points: Vec<PointRow>,
    /// Pass as `cursor` to get the rows after these; null when these are the last.
    #[serde(default)]
    pub next_cursor: Option<String>,
}

/// The results of one design point over its replicates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PointRow {
    /// Design point.
    pub point: u32,
    /// Levels by factor.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
    /// Its trials by state.
    pub counts: StateCounts,
    /// Number of unstable trials, which no mean includes.
    pub unstable: u64,
    /// Responses of the successful trials, by name.
    pub responses: BTreeMap<String, Summary>,
}

/// One response over the replicates of a design point.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Summary {
    /// Number of trials with a value; null is no value.
    pub n: u64,
    /// Mean of a numeric response. That of an indicator, such as `jammed`, is the share of trials with 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Standard deviation with n − 1, from two values on.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub standard_deviation: Option<f64>,
    /// Standard deviation of the expected response over the parameters that replicates drew from a posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub input_deviation: Option<f64>,
    /// Standard deviation of runs with the same parameters, where replicates drew parameters from a posterior.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub chance_deviation: Option<f64>,
    /// Lower end of the 95 % interval of the mean: Student's t from two values on, Wilson for an indicator from one value on. With parameters from a
    /// posterior the interval includes what is not known of them.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub low_95: Option<f64>,
    /// Its upper end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub high_95: Option<f64>,
    /// Number of trials with each word, of a response in words.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub words: Option<BTreeMap<String, u64>>,
    /// 95 % interval of the share of trials with each of these words (Wilson).
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shares: Option<BTreeMap<String, ShareInterval>>,
    /// Upper end of that interval for a word that no trial has; its lower end is 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unseen_high_95: Option<f64>,
}

/// The 95 % interval of a share (Wilson).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ShareInterval {
    /// Lower end.
    pub low_95: f64,
    /// Upper end.
    pub high_95: f64,
}

/// One series of many jobs of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepSeries {
    /// Name of the series.
    pub name: String,
    /// Its unit; null while no job has it.
    pub unit: Option<String>,
    /// An entry for each job that has the series, by design point and replicate.
    pub items: Vec<JobSeries>,
    /// Pass as `cursor` to get the jobs after these; null when these are the last.
    pub next_cursor: Option<String>,
}

/// The series of one job, with a limited number of samples.
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
    /// Whether the job is still running.
    pub partial: bool,
    /// Belt times, in seconds.
    pub t_s: Vec<f64>,
    /// The samples, as many.
    pub values: Vec<f64>,
}

/// How an interval uses the seeds that design points have in common.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Pairing {
    /// Each seed gives one difference or effect; the interval is that of their mean.
    BySeed,
    /// Additive model of points and seeds, for fewer than five seeds and more than two points. It assumes one variance.
    AdditiveModel,
    /// Not at all (Welch): the points have different seeds, or a single one.
    Unpaired,
}

/// How much narrower intervals are by pairing.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PairingGain {
    /// Median of the widths of paired intervals, each divided by the width of the unpaired interval (Welch). Null without a paired interval.
    pub median_width_ratio: Option<f64>,
    /// Number of paired intervals.
    pub intervals: u64,
    /// The same in words.
    pub sentence: String,
}

impl PairingGain {
    /// The gain of a number of intervals.
    pub fn new(median_width_ratio: Option<f64>, intervals: u64) -> Self {
        let sentence = match median_width_ratio {
            Some(ratio) => format!(
                "Pairing by seed: the median interval has {ratio:.2} times the width of the unpaired one ({intervals} {}).",
                if intervals == 1 { "interval" } else { "intervals" }
            ),
            None => "No interval is paired by seed: that needs two seeds in common at all points, and a response that varies.".to_owned(),
        };
        Self { median_width_ratio, intervals, sentence }
    }
}

/// The differences of the responses between two design points of a sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepDifferences {
    /// The sweep.
    pub sweep: SweepView,
    /// The first point.
    pub from: DesignPoint,
    /// The second point.
    pub to: DesignPoint,
    /// An entry for each numeric response that both points have, by name. A response in words has an entry `name=word` for each word.
    pub responses: Vec<ResponseDifference>,
    /// Effect of pairing on the widths of the intervals.
    pub pairing: PairingGain,
}

/// A design point and its levels.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DesignPoint {
    /// Its index.
    pub point: u32,
    /// Levels by factor.
    #[schema(value_type = Object)]
    pub factors: Map<String, Value>,
}

/// The difference of one response between two design points.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ResponseDifference {
    /// Name of the response.
    pub response: String,
    /// Number of trials of the first point with a value.
    pub from_n: u64,
    /// Their mean.
    pub from_mean: f64,
    /// Number of trials of the second point with a value.
    pub to_n: u64,
    /// Their mean.
    pub to_mean: f64,
    /// Mean of the second point minus mean of the first.
    pub difference: f64,
    /// Lower end of the 95 % interval of the difference; null when a point has a single value.
    pub low_95: Option<f64>,
    /// Its upper end.
    pub high_95: Option<f64>,
    /// How the interval uses common seeds.
    pub pairing: Pairing,
    /// Width of the interval divided by the width of the unpaired one; null when it is unpaired or nothing varies.
    pub width_ratio: Option<f64>,
}

/// The effects of a sweep's factors on each response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SweepEffects {
    /// The sweep.
    pub sweep: SweepView,
    /// An entry for each numeric response by name. A response in words has an entry `name=word` for each word: the share of trials with it.
    pub responses: Vec<ResponseEffects>,
    /// Effect of pairing on the widths of the intervals of the effects.
    pub pairing: PairingGain,
}

/// The effects of all factors on one response. Each design point counts once, with the mean of its replicates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ResponseEffects {
    /// Name of the response.
    pub response: String,
    /// Number of design points with a value.
    pub points: u64,
    /// Mean over them.
    pub mean: f64,
    /// How intervals use common seeds.
    pub pairing: Pairing,
    /// Number of seeds, if all these points have the same.
    pub seeds: Option<u64>,
    /// An entry for each factor, in the order of the sweep.
    pub factors: Vec<FactorEffect>,
}

/// The effect of one factor on one response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FactorEffect {
    /// Name of the factor.
    pub factor: String,
    /// Main effect: the change of the response over the range of the factor, along the straight line of least squares (over logarithms on a log
    /// scale). Null for factors that are not numbers or do not vary.
    pub effect: Option<f64>,
    /// Lower end of its 95 % interval, from two replicates on: how far other seeds would move the effect at these design points.
    pub low_95: Option<f64>,
    /// Its upper end.
    pub high_95: Option<f64>,
    /// Width of the interval divided by the width of the unpaired one; null when it is unpaired or nothing varies.
    pub width_ratio: Option<f64>,
    /// Rank correlation of factor and response (Spearman), −1 to 1. Null for factors that are not numbers or do not vary.
    pub rank_correlation: Option<f64>,
    /// Two-sided p-value of the rank correlation (Student's t), from three design points on.
    pub p_value: Option<f64>,
    /// Mean response at each level, for up to twelve levels.
    pub levels: Vec<LevelEffect>,
}

/// The response at one level of a factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LevelEffect {
    /// The level.
    pub level: Value,
    /// Number of design points with this level.
    pub points: u64,
    /// Mean response over these points.
    pub mean: f64,
    /// This mean minus the mean over all points.
    pub effect: f64,
    /// Lower end of the 95 % interval of the effect, from two replicates on.
    pub low_95: Option<f64>,
    /// Its upper end.
    pub high_95: Option<f64>,
}

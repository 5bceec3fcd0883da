//! The question of a study: the user's document, and its faults.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::evidence::PointRuns;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::goals::{Boundary, Calibrate, Estimate, Optimise, Sensitivity};

/// Number of results without a usable response after which a point is excluded. A response that four runs in ten have, for
/// instance the time of a jam, is missing in all of them by chance in 0.6 % of the points.
const MAX_WITHOUT_VALUE: usize = 10;

/// The question of a study.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Question {
    /// Factors with their ranges, at least one.
    pub factors: Vec<Factor>,
    /// The goal, with its stopping rule.
    pub goal: Goal,
    /// Limits of the number of runs.
    pub budget: Budget,
}

/// The goal of a study. In JSON an object with one member, for instance `{"boundary": {…}}`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Goal {
    /// Replicates at given points until intervals are narrow enough.
    Estimate(Estimate),
    /// The level set of a probability or mean.
    Boundary(Boundary),
    /// The best value of a response, or trade-offs of two.
    Optimise(Optimise),
    /// Shares of the factors in the variance of a response.
    Sensitivity(Sensitivity),
    /// Parameters by measurements, with their uncertainty.
    Calibrate(Calibrate),
}

/// A quantity of the runs at a point, for instance `{"probability": "jammed"}` or `{"mean": "rate_kg_s"}`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Share of runs whose response is 1; the response is 0 or 1.
    Probability(String),
    /// Mean of a response.
    Mean(String),
}

impl Measure {
    /// The name of the response.
    pub fn response(&self) -> &str {
        match self {
            Self::Probability(response) | Self::Mean(response) => response,
        }
    }

    /// Whether the measure can use a response: 0 or 1 for a probability, any finite number for a mean.
    pub fn accepts(&self, value: f64) -> bool {
        match self {
            Self::Probability(_) => value == 0.0 || value == 1.0,
            Self::Mean(_) => value.is_finite(),
        }
    }

    pub(crate) fn faults(&self, at: &str, faults: &mut Vec<Fault>) {
        if self.response().is_empty() {
            faults.push(fault(at, self, "the response has no name", "the name of a response"));
        }
    }
}

impl Goal {
    /// The measures of the goal that every run is to have, without repetition. A calibration has none: the tests differ, and a run without a
    /// measured number tells something.
    pub(crate) fn measures(&self) -> Vec<&Measure> {
        let mut measures = match self {
            Self::Estimate(goal) => goal.intervals.iter().map(|interval| &interval.of).collect(),
            Self::Boundary(goal) => vec![&goal.of],
            Self::Optimise(goal) => goal.measures(),
            Self::Sensitivity(goal) => goal.of.iter().collect(),
            Self::Calibrate(_) => Vec::new(),
        };
        measures.sort();
        measures.dedup();
        measures
    }
}

/// Limits of the number of runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Budget {
    /// Maximum number of runs in all, failed ones included.
    pub max_runs: usize,
    /// Maximum number of runs at one point. Confirmations of the goal `optimise` have a maximum of their own.
    #[serde(default = "default_replicates")]
    pub max_replicates: usize,
    /// A point is excluded when this many of its runs have failed, and they are at least half of its finished runs.
    #[serde(default = "default_failures")]
    pub max_failures: usize,
}

fn default_replicates() -> usize {
    1000
}

fn default_failures() -> usize {
    3
}

impl Budget {
    /// Whether a point is excluded because its runs fail, or cannot be made.
    pub fn excludes(&self, point: &PointRuns) -> bool {
        let failed = point.failed();
        let fails = failed >= self.max_failures && 2 * failed >= point.count() - point.pending();
        fails || point.impossible.is_some()
    }
}

impl Question {
    /// Whether a point is excluded: its runs fail or cannot be made, or ten of them have a result and none a response that a
    /// measure of the goal accepts.
    pub fn excludes(&self, point: &PointRuns) -> bool {
        let results = point.count() - point.failed() - point.pending();
        let lacks = |measure: &&Measure| point.values(measure).is_empty();
        self.budget.excludes(point)
            || (results >= MAX_WITHOUT_VALUE && self.goal.measures().iter().any(lacks))
    }

    /// Reads a question. Refuses a document of another form, or with faults, and names every fault that can be found.
    pub fn read(document: &Value) -> Result<Self, Vec<Fault>> {
        let question = Self::of(document)?;
        let faults = question.faults();
        if faults.is_empty() { Ok(question) } else { Err(faults) }
    }

    /// Reads a question that was accepted before. Earlier versions accepted contradictory limits.
    pub fn read_stored(document: &Value) -> Result<Self, Vec<Fault>> {
        let question = Self::of(document)?;
        let faults = question.faults_without_contradictions();
        if faults.is_empty() { Ok(question) } else { Err(faults) }
    }

    fn of(document: &Value) -> Result<Self, Vec<Fault>> {
        serde_path_to_error::deserialize(document).map_err(|error| {
            let mut pointer = String::new();
            for segment in error.path() {
                if !matches!(segment, serde_path_to_error::Segment::Unknown) {
                    pointer += &format!("/{segment}").replace(['[', ']'], "");
                }
            }
            let value = document.pointer(&pointer).cloned().unwrap_or_default();
            vec![fault(&pointer, value, &error.inner().to_string(), "the form of a question")]
        })
    }

    /// All faults, by JSON pointer.
    pub fn faults(&self) -> Vec<Fault> {
        let mut faults = self.faults_without_contradictions();
        if let Goal::Optimise(goal) = &self.goal {
            goal.contradictions("/goal/optimise", &mut faults);
        }
        faults
    }

    fn faults_without_contradictions(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        if self.factors.is_empty() {
            faults.push(fault("/factors", &self.factors, "a study needs factors", "at least one factor"));
        }
        for (index, factor) in self.factors.iter().enumerate() {
            factor.faults(&format!("/factors/{index}"), &mut faults);
            if self.factors[..index].iter().any(|other| other.name == factor.name) {
                let at = format!("/factors/{index}/name");
                faults.push(fault(&at, &factor.name, "the factor is listed twice", "different names"));
            }
        }
        let budget = &self.budget;
        for (name, value) in [
            ("max_runs", budget.max_runs),
            ("max_replicates", budget.max_replicates),
            ("max_failures", budget.max_failures),
        ] {
            if value == 0 {
                faults.push(fault(&format!("/budget/{name}"), value, "nothing could be run", "at least 1"));
            }
        }
        match &self.goal {
            Goal::Estimate(goal) => goal.faults("/goal/estimate", &self.factors, &mut faults),
            Goal::Boundary(goal) => goal.faults("/goal/boundary", &self.factors, &mut faults),
            Goal::Optimise(goal) => goal.faults("/goal/optimise", &self.factors, budget, &mut faults),
            Goal::Sensitivity(goal) => goal.faults("/goal/sensitivity", &self.factors, budget, &mut faults),
            Goal::Calibrate(goal) => goal.faults("/goal/calibrate", &self.factors, budget, &mut faults),
        }
        faults
    }
}

//! The question of a study: the user's document, and its faults.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::budget::Budget;
use crate::evidence::PointRuns;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::goals::Goal;

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

impl Question {
    /// Whether a point is excluded: its runs fail or cannot be made, or ten of them have a result and none a response that a
    /// measure of the goal accepts.
    pub fn excludes(&self, point: &PointRuns) -> bool {
        self.goal.excludes(point, &self.budget)
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

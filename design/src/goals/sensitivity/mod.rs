//! Goal `sensitivity`: the share of each factor in the variance of a response, or its rank among many factors.
//!
//! | file | content |
//! |---|---|
//! | `saltelli` | the points of Saltelli's design |
//! | `jansen` | Sobol' indices from its rows, without the noise of the seed |
//! | `intervals` | their 95 % intervals |
//! | `morris` | trajectories and elementary effects, for many factors |
//! | `rows` | which rows of a design are complete, and which runs of them come next |

mod intervals;
mod jansen;
mod morris;
mod rows;
mod saltelli;
#[cfg(test)]
mod tests;

use serde::{Deserialize, Serialize};

pub use morris::MorrisEffects;
pub use rows::LostRun;

use super::{Course, Finding, Study};
use crate::budget::Budget;
use crate::factor::Factor;
use crate::fault::{Fault, fault};
use crate::intervals::Estimated;
use crate::measure::Measure;
use rows::{Design, Progress};

/// Number of factors above which screening is chosen, if the question names no method.
const MAX_SOBOL_FACTORS: usize = 8;

/// The fields of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sensitivity {
    /// The measures. The variance of a probability is that of P over the ranges of the factors.
    pub of: Vec<Measure>,
    /// Maximum width of the 95 % intervals, from end to end. With method `sobol` in units of the indices, which are 1 in all.
    /// With method `morris` as a share of the largest μ*.
    pub width: f64,
    /// The method; by default `sobol` for up to 8 factors, and `morris` for more.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub method: Option<Method>,
}

/// A method of sensitivity analysis.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// First-order and total Sobol' indices.
    Sobol,
    /// Screening by elementary effects.
    Morris,
}

/// The finding of the goal.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SensitivityAnswer {
    /// The method.
    pub method: Method,
    /// Number of rows of the design that the numbers rest on: rows of Saltelli's design, or trajectories.
    pub rows: usize,
    /// A sensitivity per measure, in the order of the question.
    pub measures: Vec<MeasureSensitivity>,
    /// Runs of these rows that failed or lack a response. Pairs of runs with them were left out.
    pub lost: Vec<LostRun>,
}

/// The sensitivity of a measure.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct MeasureSensitivity {
    /// The measure.
    pub of: Measure,
    /// Variance of single runs that comes from their seeds, in the squared unit of the response. None when no point was
    /// run twice: the noise then counts as part of total indices and of σ, and lowers first-order indices.
    pub noise_variance: Option<f64>,
    /// Results by factor, in the order of the question; none when the response does not vary, or by no more than its noise.
    pub effects: Option<Effects>,
    /// Whether all runs of these rows gave the same value. The study then runs no further rows for this measure.
    pub is_constant: bool,
}

/// Results by factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Effects {
    /// Sobol' indices.
    Sobol(Vec<SobolIndices>),
    /// Elementary effects.
    Morris(Vec<MorrisEffects>),
}

/// Sobol' indices of a factor, without clipping: small ones may be a little below 0.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SobolIndices {
    /// Name of the factor.
    pub factor: String,
    /// Share of the variance that the factor explains alone.
    pub first_order: Estimated,
    /// Share of the variance that the factor takes part in, interactions included.
    pub total: Estimated,
}

impl Sensitivity {
    /// The method for a number of factors.
    fn method(&self, factors: usize) -> Method {
        let by_count = if factors > MAX_SOBOL_FACTORS { Method::Morris } else { Method::Sobol };
        self.method.unwrap_or(by_count)
    }

    pub(crate) fn faults(&self, at: &str, factors: &[Factor], budget: &Budget, faults: &mut Vec<Fault>) {
        if self.of.is_empty() {
            let at = format!("{at}/of");
            faults.push(fault(&at, &self.of, "no measure", "at least one measure"));
        }
        for (index, measure) in self.of.iter().enumerate() {
            measure.faults(&format!("{at}/of/{index}"), faults);
        }
        if self.width <= 0.0 {
            faults.push(fault(&format!("{at}/width"), self.width, "no width", "more than 0"));
        }
        let design = self.design(factors, budget, 0);
        for (index, factor) in factors.iter().enumerate().filter(|(_, factor)| factor.is_categorical()) {
            if design.method == Method::Morris {
                let detail = format!(
                    "{} has levels without an order, and `morris` takes steps on a scale",
                    factor.name
                );
                let allowed = "`low` and `high`; else the method `sobol`, which takes levels";
                faults.push(fault(&format!("/factors/{index}/levels"), &factor.levels, &detail, allowed));
            }
        }
        let limit = design.max_factors();
        if factors.len() > limit {
            let allowed = format!("at most {limit} factors with this method");
            faults.push(fault("/factors", factors.len(), "too many factors for the design", &allowed));
        }
        let least = design.first_look() * design.runs_per_row();
        if budget.max_runs < least {
            let detail = format!("intervals need {} rows of the design", design.first_look());
            let allowed = format!("at least {least} for {} factors", factors.len());
            faults.push(fault("/budget/max_runs", budget.max_runs, &detail, &allowed));
        }
    }

    fn design<'a>(&self, factors: &'a [Factor], budget: &Budget, seed: u64) -> Design<'a> {
        let max_replicates = u32::try_from(budget.max_replicates).unwrap_or(u32::MAX).max(1);
        Design { method: self.method(factors.len()), factors, max_replicates, seed }
    }
}

/// Number of runs in the best case: the rows of the first look.
pub(crate) fn least_runs(goal: &Sensitivity, factors: &[Factor], budget: &Budget) -> usize {
    let design = goal.design(factors, budget, 0);
    design.first_look() * design.runs_per_row()
}

pub(super) fn decide(goal: &Sensitivity, study: &Study<'_>) -> Course {
    let design = goal.design(study.factors, study.budget, study.seed);
    let progress = Progress::of(&design, study);
    let names: Vec<&str> = study.factors.iter().map(|factor| factor.name.as_str()).collect();
    let measures: Vec<_> = goal
        .of
        .iter()
        .map(|measure| {
            let found = match design.method {
                Method::Sobol => sobol(measure, &design, &progress, study, &names),
                Method::Morris => morris::sensitivity(measure, &design, &progress, study, &names),
            };
            MeasureSensitivity { is_constant: progress.is_constant(measure, &design, study), ..found }
        })
        .collect();
    let is_done = |measure: &MeasureSensitivity| {
        let is_narrow = measure
            .effects
            .as_ref()
            .is_some_and(|effects| effects.widest().is_some_and(|width| width <= goal.width));
        is_narrow || measure.is_constant
    };
    let finding = SensitivityAnswer {
        method: design.method,
        rows: progress.rows,
        lost: progress.lost(goal, study),
        measures,
    };
    Course {
        is_met: finding.measures.iter().all(is_done),
        is_spent: progress.is_spent,
        proposals: progress.proposals,
        finding: Finding::Sensitivity(finding),
    }
}

/// The Sobol' indices of a measure.
fn sobol(
    measure: &Measure,
    design: &Design<'_>,
    progress: &Progress,
    study: &Study<'_>,
    names: &[&str],
) -> MeasureSensitivity {
    let rows: Vec<_> =
        progress.values(measure, study).filter_map(|values| jansen::Row::of(&values, names.len())).collect();
    let sums = jansen::Terms::of(&rows);
    let indices = sums.indices(None).filter(|_| progress.rows >= design.first_look());
    let effects = indices.map(|indices| {
        let intervals = intervals::of(&sums, &indices, study.seed);
        let estimated = |position: usize| {
            let (value, (low, high)) = (indices[position], intervals[position]);
            Estimated { n: sums.pairs(position), value, low: Some(low), high: Some(high) }
        };
        let of_factor = |(index, name): (usize, &&str)| SobolIndices {
            factor: (*name).to_owned(),
            first_order: estimated(index),
            total: estimated(names.len() + index),
        };
        Effects::Sobol(names.iter().enumerate().map(of_factor).collect())
    });
    MeasureSensitivity {
        of: measure.clone(),
        noise_variance: sums.noise_variance(None),
        effects,
        is_constant: false,
    }
}

impl Effects {
    /// The widest interval, in the unit of the question's width; none without intervals.
    fn widest(&self) -> Option<f64> {
        let widths: Vec<Option<f64>> = match self {
            Self::Sobol(indices) => {
                indices.iter().flat_map(|index| [index.first_order.width(), index.total.width()]).collect()
            }
            Self::Morris(effects) => {
                let largest = effects.iter().map(|effect| effect.mu_star.value).fold(0.0, f64::max);
                effects.iter().map(|effect| Some(effect.mu_star.width()? / largest)).collect()
            }
        };
        widths.into_iter().try_fold(0.0, |widest: f64, width| Some(widest.max(width?)))
    }
}

//! The rows of a design: which of them are complete, which runs come next, and which runs were lost.

use serde::{Deserialize, Serialize};

use super::{Method, Sensitivity, morris, saltelli};
use crate::decision::Proposal;
use crate::evidence::{Outcome, Point};
use crate::factor::Factor;
use crate::goals::Study;
use crate::question::Measure;

/// Rows of the longest sequence.
const MAX_ROWS: usize = 1 << 16;

/// A design: a row of runs for every number from 0 on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Design<'a> {
    pub(super) method: Method,
    pub(super) factors: &'a [Factor],
    /// Whether the first point of every row is run twice, for the noise of the seed.
    pub(super) has_noise_runs: bool,
    pub(super) seed: u64,
}

/// A run of a design that failed, was cancelled, or lacks a response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LostRun {
    /// Values of the factors.
    pub values: Vec<f64>,
    /// Its replicate.
    pub replicate: u32,
    /// Its row of the design, from 0 on.
    pub row: usize,
}

/// The state of a design in the evidence.
#[derive(Debug)]
pub(super) struct Progress {
    /// Rows that the numbers rest on: the first ones, all their runs at an end.
    pub(super) rows: usize,
    /// The next runs: whole rows only, within the budget.
    pub(super) proposals: Vec<Proposal>,
    /// Whether the budget has no room for another row.
    pub(super) is_spent: bool,
}

impl Design<'_> {
    pub(super) fn max_factors(&self) -> usize {
        match self.method {
            Method::Sobol => saltelli::MAX_FACTORS,
            Method::Morris => morris::MAX_FACTORS,
        }
    }

    /// Number of rows from which on there are intervals.
    pub(super) fn first_look(&self) -> usize {
        match self.method {
            Method::Sobol => 64,
            Method::Morris => morris::FIRST_LOOK,
        }
    }

    pub(super) fn runs_per_row(&self) -> usize {
        let points = match self.method {
            Method::Sobol => self.factors.len() + 2,
            Method::Morris => self.factors.len() + 1,
        };
        points + usize::from(self.has_noise_runs)
    }

    /// The runs of a row: replicate 0 of its points, then perhaps replicate 1 of the first.
    fn runs(&self, row: usize) -> Vec<Proposal> {
        let (row, factors) = (row as u32, self.factors.len());
        let points = match self.method {
            Method::Sobol => saltelli::points(row, factors, self.seed),
            Method::Morris => morris::points(row, factors, self.seed),
        };
        let run =
            |point: &Vec<f64>| Proposal { point: Point::new(point).rounded(self.factors), replicate: 0 };
        let mut runs: Vec<_> = points.iter().map(run).collect();
        if self.has_noise_runs {
            runs.push(Proposal { replicate: 1, ..runs[0].clone() });
        }
        runs
    }

    /// The largest number of rows up to `rows` at which one looks: 2ᵏ or 1.5·2ᵏ times the first. Between looks the number
    /// does not grow, so that neither quick runs nor a lucky moment choose the end.
    fn look(&self, rows: usize) -> usize {
        let mut look = self.first_look();
        if rows < look {
            return rows;
        }
        while 2 * look <= rows {
            look *= 2;
        }
        if look + look / 2 <= rows { look + look / 2 } else { look }
    }
}

impl Progress {
    pub(super) fn of(design: &Design<'_>, study: &Study<'_>) -> Self {
        let (mut complete, mut started) = (0, 0);
        let (mut proposals, mut used) = (Vec::new(), study.evidence.spent());
        let mut is_spent = true;
        for row in 0..MAX_ROWS {
            let runs = design.runs(row);
            let missing: Vec<_> = runs.iter().filter(|run| outcome(study, run).is_none()).cloned().collect();
            let is_over =
                |run: &Proposal| outcome(study, run).is_some_and(|state| *state != Outcome::Pending);
            if row == complete && runs.iter().all(is_over) {
                complete += 1;
            }
            used += missing.len();
            if used > study.question.budget.max_runs {
                break;
            }
            started = row + 1;
            proposals.extend(missing);
            if proposals.len() > study.room {
                is_spent = false;
                break;
            }
        }
        // The last look has all rows of the budget.
        let rows = if is_spent && complete == started { complete } else { design.look(complete) };
        Self { rows, proposals, is_spent: is_spent && complete == started }
    }

    /// The values of a measure's response in each row; none where the run was lost.
    pub(super) fn values<'a>(
        &self,
        measure: &'a Measure,
        design: &'a Design<'a>,
        study: &'a Study<'_>,
    ) -> impl Iterator<Item = Vec<Option<f64>>> + 'a {
        (0..self.rows).map(move |row| design.runs(row).iter().map(|run| value(study, run, measure)).collect())
    }

    /// Whether all values of a measure are equal, in enough rows for intervals.
    pub(super) fn is_constant(&self, measure: &Measure, design: &Design<'_>, study: &Study<'_>) -> bool {
        let values: Vec<f64> = self.values(measure, design, study).flatten().flatten().collect();
        // At least half of the runs have values.
        let is_enough =
            self.rows >= design.first_look() && 2 * values.len() >= self.rows * design.runs_per_row();
        is_enough && values.iter().all(|value| *value == values[0])
    }

    /// Runs of the rows that a measure lacks.
    pub(super) fn lost(&self, goal: &Sensitivity, design: &Design<'_>, study: &Study<'_>) -> Vec<LostRun> {
        let is_lost = |run: &Proposal| goal.of.iter().any(|measure| value(study, run, measure).is_none());
        let in_row = |row: usize| {
            design.runs(row).into_iter().filter(is_lost).map(move |run| LostRun {
                values: run.point.values(&study.question.factors),
                replicate: run.replicate,
                row,
            })
        };
        (0..self.rows).flat_map(in_row).collect()
    }
}

fn outcome<'a>(study: &'a Study<'_>, run: &Proposal) -> Option<&'a Outcome> {
    study.evidence.at(&run.point)?.runs.get(&run.replicate)
}

fn value(study: &Study<'_>, run: &Proposal, measure: &Measure) -> Option<f64> {
    match outcome(study, run)? {
        Outcome::Responses(values) => {
            values.get(measure.response()).copied().filter(|value| measure.accepts(*value))
        }
        Outcome::Pending | Outcome::Cancelled | Outcome::Failed => None,
    }
}

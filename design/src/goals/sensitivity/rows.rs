//! The rows of a design: which of them are complete, which runs come next, and which runs were lost.
//!
//! A point may come several times: with a single factor, with whole numbers, and with levels. Each time it has a run of its own, the next
//! replicate of the point, because the terms of the indices take the noise of runs for independent. A cancelled run has no part in the
//! design: the next replicate takes its place.

use std::collections::{BTreeMap, BTreeSet};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::{Method, Sensitivity, morris, saltelli};
use crate::evidence::{Outcome, Point};
use crate::factor::Factor;
use crate::goals::Study;
use crate::measure::Measure;
use crate::proposal::Proposal;

/// Rows of the longest sequence.
const MAX_ROWS: usize = 1 << 16;

/// A design: a row of runs for every number from 0 on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Design<'a> {
    pub(super) method: Method,
    pub(super) factors: &'a [Factor],
    /// Maximum number of runs at a point.
    pub(super) max_replicates: u32,
    pub(super) seed: u64,
}

/// A run of a design that failed or lacks a response.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct LostRun {
    /// Values of the factors: numbers in their units, or levels.
    pub values: Vec<Value>,
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
    /// The runs of these rows.
    runs: Vec<Vec<Proposal>>,
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
        points + usize::from(self.has_noise_runs())
    }

    /// Whether the first point of every row is run twice, for the noise of the seed.
    fn has_noise_runs(&self) -> bool {
        self.max_replicates > 1
    }

    /// The points of the runs of a row, then perhaps the first again.
    fn points(&self, row: usize) -> Vec<Point> {
        let (row, factors) = (row as u32, self.factors.len());
        let points = match self.method {
            Method::Sobol => saltelli::points(row, factors, self.seed),
            Method::Morris => morris::points(row, factors, self.seed),
        };
        let mut points: Vec<_> = points.iter().map(|point| Point::new(point).rounded(self.factors)).collect();
        if self.has_noise_runs() {
            points.push(points[0].clone());
        }
        points
    }

    /// The runs of a row, by the number of runs that earlier rows have at each point. A point that has its maximum shares them.
    fn runs(&self, row: usize, used: &mut BTreeMap<Point, u32>, study: &Study<'_>) -> Vec<Proposal> {
        let run = |point: Point| {
            let time = used.entry(point.clone()).or_default();
            let mut replicate = *time % self.max_replicates;
            *time += 1;
            let known = study.evidence.at(&point).into_iter().flat_map(|runs| &runs.runs);
            for (cancelled, _) in known.filter(|(_, outcome)| **outcome == Outcome::Cancelled) {
                replicate += u32::from(*cancelled <= replicate);
            }
            Proposal { point, replicate }
        };
        self.points(row).into_iter().map(run).collect()
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
        let (mut rows, mut times, mut proposed) = (Vec::new(), BTreeMap::new(), BTreeSet::new());
        for row in 0..MAX_ROWS {
            let runs = design.runs(row, &mut times, study);
            let missing = runs.iter().filter(|run| outcome(study, run).is_none());
            let missing: Vec<Proposal> =
                missing.filter(|run| proposed.insert((*run).clone())).cloned().collect();
            used += missing.len();
            // Shared runs count in each row: rows without new runs would have no end.
            let budget = study.budget.max_runs;
            if used > budget || (row + 1) * design.runs_per_row() > budget {
                break;
            }
            let is_over =
                |run: &Proposal| outcome(study, run).is_some_and(|state| *state != Outcome::Pending);
            if row == complete && runs.iter().all(is_over) {
                complete += 1;
            }
            rows.push(runs);
            started = row + 1;
            proposals.extend(missing);
            if proposals.len() > study.room {
                is_spent = false;
                break;
            }
        }
        // The last look has all rows of the budget.
        let is_spent = is_spent && complete == started;
        let looked_at = if is_spent { complete } else { design.look(complete) };
        rows.truncate(looked_at);
        Self { rows: looked_at, runs: rows, proposals, is_spent }
    }

    /// The values of a measure's response in each row; none where the run was lost.
    pub(super) fn values<'a>(
        &'a self,
        measure: &'a Measure,
        study: &'a Study<'_>,
    ) -> impl Iterator<Item = Vec<Option<f64>>> + 'a {
        self.runs.iter().map(move |runs| runs.iter().map(|run| value(study, run, measure)).collect())
    }

    /// Whether all values of a measure are equal, in enough rows for intervals.
    pub(super) fn is_constant(&self, measure: &Measure, design: &Design<'_>, study: &Study<'_>) -> bool {
        let values: Vec<f64> = self.values(measure, study).flatten().flatten().collect();
        // At least half of the runs have values.
        let is_enough =
            self.rows >= design.first_look() && 2 * values.len() >= self.rows * design.runs_per_row();
        is_enough && values.iter().all(|value| *value == values[0])
    }

    /// Runs of the rows that a measure lacks.
    pub(super) fn lost(&self, goal: &Sensitivity, study: &Study<'_>) -> Vec<LostRun> {
        let is_lost = |run: &Proposal| goal.of.iter().any(|measure| value(study, run, measure).is_none());
        let in_row = |(row, runs): (usize, &Vec<Proposal>)| {
            let lost = |run: &Proposal| LostRun {
                values: run.point.levels(study.factors),
                replicate: run.replicate,
                row,
            };
            runs.iter().filter(|run| is_lost(run)).map(lost).collect::<Vec<_>>()
        };
        self.runs.iter().enumerate().flat_map(in_row).collect()
    }
}

/// The state of a run, if there is one. A run that cannot be made is lost as one that fails.
fn outcome<'a>(study: &'a Study<'_>, run: &Proposal) -> Option<&'a Outcome> {
    let known = study.evidence.at(&run.point)?;
    let lost = known.impossible.is_some().then_some(&Outcome::Failed);
    known.runs.get(&run.replicate).or(lost)
}

fn value(study: &Study<'_>, run: &Proposal, measure: &Measure) -> Option<f64> {
    match outcome(study, run)? {
        Outcome::Responses(values) => {
            values.get(measure.response()).copied().filter(|value| measure.accepts(*value))
        }
        Outcome::Pending | Outcome::Cancelled | Outcome::Failed => None,
    }
}

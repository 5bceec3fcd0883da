//! The first design: points of a Sobol' sequence, until enough of them have results for models.

use super::{Optimise, has_values, next_replicate, search_runs};
use crate::evidence::Outcome;
use crate::goals::Study;
use crate::measure::Measure;
use crate::proposal::Proposal;
use crate::space::distinct;

/// Indices of the sequence for each point: whole numbers and levels repeat themselves.
const INDICES_PER_POINT: usize = 64;

/// Missing runs of the first design, and whether enough of its points have results for models.
pub(super) fn first_design(goal: &Optimise, study: &Study<'_>) -> (Vec<Proposal>, bool) {
    let budget = study.budget;
    let factors = study.factors;
    let has_means = goal.measures().iter().any(|measure| matches!(measure, Measure::Mean(_)));
    // Two runs at a point show the noise of means.
    let replicates = if has_means { 2.min(budget.max_replicates) } else { 1 };
    let levels = factors.iter().map(|factor| factor.levels.len()).max().unwrap_or(0);
    // Every level comes twice.
    let points = (5 * (factors.len() + 1))
        .max(2 * levels)
        .min(budget.max_runs / (4 * replicates))
        .max(factors.len() + 1);
    let known = study.usable_points().filter(|point| has_values(goal, point)).count();
    let mut proposals = Vec::new();
    let (mut begun, mut is_exhausted) = (0, true);
    // Points that are excluded, or whose runs lack a response, are replaced by later ones of the sequence.
    for point in distinct(factors, 0..INDICES_PER_POINT * points, study.seed).take(4 * points) {
        let runs = study.evidence.at(&point);
        if runs.is_some_and(|runs| budget.excludes(runs)) {
            continue;
        }
        let (count, failed) = runs.map_or((0, 0), |runs| (search_runs(runs).count(), runs.failed()));
        let next = next_replicate(runs);
        let more = (replicates + failed).min(budget.max_replicates).saturating_sub(count) as u32;
        let is_over =
            more == 0 && runs.is_some_and(|runs| search_runs(runs).all(|(_, run)| *run != Outcome::Pending));
        if is_over && runs.is_some_and(|runs| !has_values(goal, runs)) {
            continue;
        }
        proposals.extend((0..more).map(|index| Proposal { point: point.clone(), replicate: next + index }));
        begun += 1;
        if begun == points || known + begun >= 2 * points {
            is_exhausted = false;
            break;
        }
    }
    let is_enough = 4 * known >= 3 * points;
    let is_all = is_exhausted && proposals.is_empty() && known > factors.len();
    (proposals, is_enough || is_all)
}

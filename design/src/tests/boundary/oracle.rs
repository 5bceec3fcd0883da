//! Designs of two factors that know the true boundary: what a choice of runs could reach at best.

use super::limit::Known;
use super::truths::Truth;
use crate::model::Model;
use crate::model::fantasy::Fantasies;
use crate::model::kernel::columns;
use crate::space::sobol;
use crate::tests::truth::{Random, run};
use crate::{Evidence, Goal, Point, Proposal, Question, Run};

/// Cells per factor of the grid in which the boundary is traced.
const CELLS: usize = 300;
/// Points of the boundary whose variances a greedy design reduces.
pub(super) const TARGETS: usize = 100;
/// Runs of a greedy design between two models.
const BATCH: usize = 20;
/// Points that fill the range, among the candidates of designs that choose.
pub(super) const FILLING: usize = 320;

/// A design of 200 runs.
#[derive(Clone, Copy, Debug)]
pub(super) enum Design {
    /// Runs at points in rows at some distances from the boundary, and runs at points that fill the range: numbers of points of all rows and
    /// replicates, then the same of the filling points.
    Rows(&'static [f64], [usize; 2], [usize; 2]),
    /// One run after the other, where it reduces the deviations along the boundary most; before them two runs at each of some points that fill
    /// the range.
    Greedy(usize),
    /// The design that leaves the smallest share on the wrong side, if the model of many runs is right.
    Best,
}

use Design::{Best, Greedy, Rows};

pub(super) const DESIGNS: &[Design] = &[
    Rows(&[0.0], [20, 10], [0, 0]),
    Rows(&[0.0], [100, 2], [0, 0]),
    Rows(&[-0.05, 0.05], [40, 5], [0, 0]),
    Rows(&[-0.1, 0.1], [20, 10], [0, 0]),
    Rows(&[-0.1, 0.1], [100, 2], [0, 0]),
    Rows(&[-0.2, 0.2], [40, 5], [0, 0]),
    Rows(&[-0.1, 0.0, 0.1], [60, 3], [20, 1]),
    Rows(&[0.0], [20, 5], [20, 5]),
    Rows(&[0.0], [50, 2], [50, 2]),
    Rows(&[0.0], [40, 4], [20, 2]),
    Rows(&[-0.05, 0.05], [40, 4], [20, 2]),
    Rows(&[-0.1, 0.1], [40, 4], [20, 2]),
    Rows(&[-0.2, 0.2], [40, 4], [20, 2]),
    Greedy(16),
    Greedy(8),
    Best,
];

impl Design {
    /// The runs of the design.
    pub(super) fn runs(self, truth: &Truth, question: &Question, known: &Known, seed: u64) -> Vec<Run> {
        let mut random = Random(1000 * seed + 31);
        match self {
            Rows(distances, [points, replicates], [filling, times]) => {
                let boundary = Boundary::of(truth);
                let per_row = points / distances.len();
                let mut runs = Vec::new();
                for (row, distance) in distances.iter().enumerate() {
                    // Neighbouring rows have their points side by side.
                    let shift = (row as f64 + 0.5) / distances.len() as f64;
                    let at = |index: usize| {
                        boundary.beside(truth, (index as f64 + shift) / per_row as f64, *distance)
                    };
                    (0..per_row).for_each(|index| add(&mut runs, truth, &at(index), replicates, &mut random));
                }
                for index in 0..filling {
                    add(&mut runs, truth, &sobol(index, 2, seed), times, &mut random);
                }
                runs
            }
            Greedy(first) => greedy(truth, question, (first, seed), &mut random),
            Best => known.runs(truth, &mut random),
        }
    }
}

/// Adds runs at a point.
pub(super) fn add(runs: &mut Vec<Run>, truth: &Truth, at: &[f64], times: usize, random: &mut Random) {
    let point = Point::new(at);
    let known = runs.iter().filter(|run| run.point == point).count();
    for replicate in known..known + times {
        let value = truth.draw(&point.coordinates(), random);
        runs.push(run(&Proposal { point: point.clone(), replicate: replicate as u32 }, "y", value));
    }
}

/// The true boundary: points in order, close to each other, and the length up to each.
struct Boundary {
    points: Vec<[f64; 2]>,
    lengths: Vec<f64>,
}

impl Boundary {
    fn of(truth: &Truth) -> Self {
        let value = |at: [f64; 2]| truth.mean(&at) - truth.level;
        let mut left: Vec<[f64; 2]> = Vec::new();
        for one in 0..=CELLS {
            for other in 0..CELLS {
                let (line, start) = (one as f64 / CELLS as f64, other as f64 / CELLS as f64);
                let end = (other + 1) as f64 / CELLS as f64;
                for edge in [[[line, start], [line, end]], [[start, line], [end, line]]] {
                    let values = edge.map(value);
                    if (values[0] > 0.0) != (values[1] > 0.0) {
                        let share = values[0] / (values[0] - values[1]);
                        left.push([0, 1].map(|axis| edge[0][axis] + share * (edge[1][axis] - edge[0][axis])));
                    }
                }
            }
        }
        // It is one line: from an end at the surface of the range, or from anywhere, always to the nearest point.
        let depth = |at: &[f64; 2]| at.iter().map(|x| x.min(1.0 - x)).fold(1.0, f64::min);
        let first = (0..left.len()).min_by(|one, other| depth(&left[*one]).total_cmp(&depth(&left[*other])));
        let mut points = vec![left.swap_remove(first.expect("a boundary"))];
        let mut lengths = vec![0.0];
        while !left.is_empty() {
            let (last, length) = (points[points.len() - 1], lengths[lengths.len() - 1]);
            let distance = |index: &usize| (left[*index][0] - last[0]).hypot(left[*index][1] - last[1]);
            let next = (0..left.len()).min_by(|one, other| distance(one).total_cmp(&distance(other)));
            let next = next.expect("a point");
            lengths.push(length + distance(&next));
            points.push(left.swap_remove(next));
        }
        Self { points, lengths }
    }

    /// The point at a share of the boundary's length.
    fn at(&self, share: f64) -> [f64; 2] {
        let length = share * self.lengths[self.lengths.len() - 1];
        self.points[self.lengths.partition_point(|before| *before < length).min(self.points.len() - 1)]
    }

    /// The point at a distance from it, in the direction of rising values.
    fn beside(&self, truth: &Truth, share: f64, distance: f64) -> Vec<f64> {
        let at = self.at(share);
        let slopes = slopes(truth, at);
        let steepness = slopes[0].hypot(slopes[1]);
        [0, 1].map(|axis| at[axis] + distance * slopes[axis] / steepness).to_vec()
    }
}

/// Derivatives of the latent function.
fn slopes(truth: &Truth, at: [f64; 2]) -> [f64; 2] {
    let value = |axis: usize, step: f64| {
        let mut at = at;
        at[axis] += step;
        (truth.function)(&at)
    };
    [0, 1].map(|axis| (value(axis, 1e-4) - value(axis, -1e-4)) / 2e-4)
}

/// Points along the true boundary, and the share of the range on the wrong side per standard deviation of the latent function there.
pub(super) struct Gauge {
    targets: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

impl Gauge {
    pub(super) fn of(truth: &Truth) -> Self {
        let boundary = Boundary::of(truth);
        let length = boundary.lengths[boundary.lengths.len() - 1] / TARGETS as f64;
        let target = |index: usize| boundary.beside(truth, (index as f64 + 0.5) / TARGETS as f64, 0.0);
        let targets: Vec<Vec<f64>> = (0..TARGETS).map(target).collect();
        // The boundary moves by error / slope; the mean of the error's magnitude is √(2/π) deviations.
        let weight = |at: &Vec<f64>| {
            let slopes = slopes(truth, [at[0], at[1]]);
            std::f64::consts::FRAC_2_PI.sqrt() * length / slopes[0].hypot(slopes[1])
        };
        let weights = targets.iter().map(weight).collect();
        Self { targets, weights }
    }

    /// The targets, then further candidates.
    pub(super) fn candidates(&self, further: impl IntoIterator<Item = Vec<f64>>) -> Vec<Vec<f64>> {
        let all = self.targets.iter().cloned().chain(further);
        all.map(|at| Point::new(&at).coordinates()).collect()
    }

    /// The expected share on the wrong side, in the unit of the latent function.
    pub(super) fn expected(&self, fantasies: &Fantasies) -> f64 {
        self.weights.iter().enumerate().map(|(target, weight)| weight * fantasies.deviation(target)).sum()
    }

    /// The candidate at which a run reduces the expected share most.
    pub(super) fn best(&self, fantasies: &Fantasies) -> usize {
        let deviations: Vec<f64> = (0..TARGETS).map(|target| fantasies.deviation(target)).collect();
        let gain = |candidate: usize| {
            let column = fantasies.covariances.column(candidate);
            let total = column[candidate].max(0.0) + fantasies.noise[candidate];
            let terms =
                deviations.iter().zip(&self.weights).enumerate().map(|(target, (deviation, weight))| {
                    let after = (deviation * deviation - column[target] * column[target] / total).max(0.0);
                    weight * (deviation - after.sqrt())
                });
            terms.sum::<f64>()
        };
        let gains: Vec<f64> = (0..fantasies.noise.len()).map(gain).collect();
        (0..gains.len()).max_by(|one, other| gains[*one].total_cmp(&gains[*other])).expect("a candidate")
    }

    /// A bound from below of the expected share that any choice of as many runs leaves, given the deviations that one leaves: the share is convex
    /// in the numbers of runs at the candidates.
    pub(super) fn least(&self, fantasies: &Fantasies, chosen: &[usize]) -> f64 {
        let slope = |candidate: usize| {
            let column = fantasies.covariances.column(candidate);
            let terms = self.weights.iter().enumerate().map(|(target, weight)| {
                weight * column[target] * column[target] / (2.0 * fantasies.deviation(target))
            });
            terms.sum::<f64>() / fantasies.noise[candidate]
        };
        let steepest = (0..fantasies.noise.len()).map(slope).fold(0.0, f64::max);
        let now: f64 = chosen.iter().map(|candidate| slope(*candidate)).sum();
        self.expected(fantasies) - (steepest * chosen.len() as f64 - now)
    }
}

/// Each run is where it reduces the expected share most, by the model of the results so far.
fn greedy(truth: &Truth, question: &Question, (first, seed): (usize, u64), random: &mut Random) -> Vec<Run> {
    let gauge = Gauge::of(truth);
    let mut runs = Vec::new();
    for index in 0..first {
        add(&mut runs, truth, &sobol(index, 2, seed), 2, random);
    }
    while runs.len() < question.budget.max_runs {
        let evidence = Evidence::new(runs.iter().cloned());
        let model = model(question, &runs);
        let known = evidence.points().iter().map(|runs| runs.point.coordinates());
        let candidates = gauge.candidates(known.chain((first..FILLING).map(|index| sobol(index, 2, seed))));
        let mut fantasies = Fantasies::new(&model, &columns(2, &candidates));
        for _ in 0..BATCH.min(question.budget.max_runs - runs.len()) {
            let best = gauge.best(&fantasies);
            add(&mut runs, truth, &candidates[best], 1, random);
            fantasies.observe(best);
        }
    }
    runs
}

/// The model of some runs.
pub(super) fn model(question: &Question, runs: &[Run]) -> Model {
    let Goal::Boundary(goal) = &question.goal else { panic!("a boundary") };
    let evidence = Evidence::new(runs.iter().cloned());
    Model::fit_near(&question.factors, &goal.of, evidence.points(), goal.level).expect("a model")
}

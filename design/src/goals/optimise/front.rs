//! Pareto fronts of two objectives that are minimised, and the expected gain of area.
//!
//! | symbol | meaning |
//! |---|---|
//! | f₁ < f₂ < … | first objective of the points of a front; their second objectives g₁ > g₂ > … fall |
//! | (F, G) | reference point; the area is that between it and the front |
//! | EI(u) | expectation of max(u − X, 0) |
//!
//! A point (X, Y) adds the area where X ≤ a, Y ≤ b and no point of the front is below (a, b). In the strip a from f_k to f_k+1
//! this is b below g_k. With X and Y independent the expected gain is the sum over strips of
//! (EI_X(f_k+1) − EI_X(f_k)) · EI_Y(g_k), exactly, with f₀ = −∞, g₀ = G, and f = F after the last point. Compare Emmerich,
//! Deutz and Klinkenberg 2011, who write it in terms of boxes.

use super::normal::{LnSum, ln_difference, ln_improvement};

/// The points that no other point beats in both objectives, by the first objective.
pub(super) fn front(points: &[[f64; 2]]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..points.len()).collect();
    let key = |index: &usize| points[*index];
    order.sort_by(|one, other| {
        let (one, other) = (key(one), key(other));
        one[0].total_cmp(&other[0]).then(one[1].total_cmp(&other[1]))
    });
    let mut lowest = f64::INFINITY;
    order.retain(|index| {
        let is_new = points[*index][1] < lowest;
        lowest = lowest.min(points[*index][1]);
        is_new
    });
    order
}

/// The strips between a front and the reference: from, to, height. `points` may be in any order.
fn strips(points: &[[f64; 2]], reference: [f64; 2]) -> Vec<(f64, f64, f64)> {
    let inside: Vec<[f64; 2]> =
        points.iter().filter(|point| point[0] < reference[0] && point[1] < reference[1]).copied().collect();
    let (mut strips, mut from, mut height) = (Vec::new(), f64::NEG_INFINITY, reference[1]);
    for index in front(&inside) {
        strips.push((from, inside[index][0], height));
        (from, height) = (inside[index][0], inside[index][1]);
    }
    strips.push((from, reference[0], height));
    strips
}

/// The area between a front and the reference point.
pub(super) fn area(points: &[[f64; 2]], reference: [f64; 2]) -> f64 {
    let strips = strips(points, reference);
    strips.iter().skip(1).map(|(from, to, height)| (to - from) * (reference[1] - height)).sum()
}

/// The logarithm of the expected gain of area by a point, as a function of its means and standard deviations.
pub(super) fn ln_gain(points: &[[f64; 2]], reference: [f64; 2]) -> impl Fn([f64; 2], [f64; 2]) -> f64 {
    let strips = strips(points, reference);
    move |means, deviations| {
        let mut sum = LnSum::EMPTY;
        let mut before = f64::NEG_INFINITY;
        for (_, to, height) in &strips {
            let after = ln_improvement(to - means[0], deviations[0]);
            sum.add(ln_difference(after, before) + ln_improvement(height - means[1], deviations[1]));
            before = after;
        }
        sum.ln()
    }
}

/// The logarithm of the expected gain by knowing a point exactly: of the area that it adds to the front of the others, over the area
/// that its means add. It is at least 0, since that area is convex in each of the two values.
pub(super) fn ln_gain_of_knowing(
    others: &[[f64; 2]],
    reference: [f64; 2],
    means: [f64; 2],
    deviations: [f64; 2],
) -> f64 {
    let gain = ln_gain(others, reference);
    ln_difference(gain(means, deviations), gain(means, [0.0; 2]))
}

/// A reference point a little worse than the worst ends of a front of some points.
pub(super) fn reference(points: &[[f64; 2]]) -> [f64; 2] {
    let front = front(points);
    let of_objective = |objective: usize| {
        let values = || front.iter().map(|index| points[*index][objective]);
        let (low, high) =
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max));
        let all = || points.iter().map(|point| point[objective]);
        let spread = all().fold(f64::NEG_INFINITY, f64::max) - all().fold(f64::INFINITY, f64::min);
        // A front of one point has no width.
        high + 0.1 * if high > low { high - low } else { spread.max(1e-6) }
    };
    [of_objective(0), of_objective(1)]
}

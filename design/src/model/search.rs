//! Maximum of a smooth function of a few variables: quasi-Newton steps with a backtracking line search.
//!
//! Broyden, Fletcher, Goldfarb and Shanno (Nocedal and Wright 2006, algorithm 6.1), with Armijo's condition alone and updates
//! where the curvature is positive. For two to seven hyperparameters this needs no crate.

use nalgebra::{DMatrix, DVector};

/// Longest step of a logarithm of a hyperparameter.
const MAX_STEP: f64 = 1.5;
/// Length of the gradient at which the search ends: the function is a log density.
const FLAT: f64 = 1e-3;

/// The point with the highest value found in at most `evaluations` of the function, which returns value and gradient, or none
/// where it has no value.
pub(super) fn maximise(
    start: &[f64],
    evaluations: usize,
    mut function: impl FnMut(&[f64]) -> Option<(f64, Vec<f64>)>,
) -> Option<(Vec<f64>, f64)> {
    let size = start.len();
    let mut at = DVector::from_column_slice(start);
    let (mut value, gradient) = function(start)?;
    let mut gradient = DVector::from_vec(gradient);
    let mut inverse = DMatrix::<f64>::identity(size, size);
    let mut left = evaluations.saturating_sub(1);
    while left > 0 && gradient.norm() > FLAT {
        let mut direction = &inverse * &gradient;
        if direction.dot(&gradient) <= 0.0 {
            inverse = DMatrix::identity(size, size);
            direction = gradient.clone();
        }
        let longest = direction.amax();
        if longest > MAX_STEP {
            direction *= MAX_STEP / longest;
        }
        let slope = direction.dot(&gradient);
        let mut share = 1.0;
        let accepted = loop {
            let next = &at + &direction * share;
            left -= 1;
            if let Some((found, next_gradient)) = function(next.as_slice())
                && found >= value + 1e-4 * share * slope
            {
                break Some((next, found, DVector::from_vec(next_gradient)));
            }
            share *= 0.3;
            if left == 0 || share < 1e-3 {
                break None;
            }
        };
        let Some((next, found, next_gradient)) = accepted else { break };
        let step = &next - &at;
        let bend = &gradient - &next_gradient;
        let curvature = step.dot(&bend);
        if curvature > 1e-10 {
            let moved = &inverse * &bend;
            let scale = (1.0 + bend.dot(&moved) / curvature) / curvature;
            inverse.ger(scale, &step, &step, 1.0);
            inverse.ger(-1.0 / curvature, &step, &moved, 1.0);
            inverse.ger(-1.0 / curvature, &moved, &step, 1.0);
        }
        let gain = found - value;
        (at, value, gradient) = (next, found, next_gradient);
        if gain < 1e-5 {
            break;
        }
    }
    Some((at.as_slice().to_vec(), value))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maximise_finds_the_optimum_of_the_rosenbrock_function() {
        // Rosenbrock's function, upside down; its top is at (1, 1).
        let mut calls = 0;
        let (at, value) = maximise(&[-1.2, 1.0], 200, |x| {
            calls += 1;
            let (one, two) = (1.0 - x[0], x[1] - x[0] * x[0]);
            Some((-one * one - 100.0 * two * two, vec![2.0 * one + 400.0 * two * x[0], -200.0 * two]))
        })
        .unwrap();
        assert!((at[0] - 1.0).abs() < 1e-2 && (at[1] - 1.0).abs() < 1e-2 && value > -1e-4, "{at:?}");
        assert!(calls <= 100, "{calls}");
    }
}

//! Posterior of one measure at a list of points, as a Gaussian vector that runs in flight narrow.

use nalgebra::{DMatrix, DVector};

use crate::model::Model;

/// Share of the variance that keeps covariances of nearly equal points positive definite.
const JITTER: f64 = 1e-8;
/// Number of times that this share is increased tenfold; the last would repair any finite covariances.
const TRIES: usize = 10;

/// The latent values of a measure at points.
#[derive(Clone, Debug)]
pub(super) struct Surface {
    /// Means, with the sign of the objective or constraint.
    pub(super) means: DVector<f64>,
    pub(super) covariances: DMatrix<f64>,
    /// Variance of one run at each point.
    pub(super) noise: Vec<f64>,
}

/// A surface given its values at some of the points.
#[derive(Debug)]
pub(super) struct Conditional {
    /// L of the covariance L Lᵀ of the values.
    factor: DMatrix<f64>,
    /// L⁻¹ C, C the covariances of the values with all points.
    slopes: DMatrix<f64>,
    /// Standard deviation at every point when the values are known.
    pub(super) deviations: Vec<f64>,
}

impl Surface {
    /// The surface of a model at points (columns), with a sign.
    pub(super) fn of(model: &Model, points: &DMatrix<f64>, sign: f64) -> Self {
        let prediction = model.posterior.predict(points);
        let covariances = model.posterior.covariances(points, &prediction);
        Self { noise: model.noise(points, &prediction), means: prediction.means * sign, covariances }
    }

    pub(super) fn deviation(&self, index: usize) -> f64 {
        self.covariances[(index, index)].max(0.0).sqrt()
    }

    /// Takes a run at a point as known, with the posterior mean as its value: means stay.
    pub(super) fn condition(&mut self, index: usize) {
        let variance = self.covariances[(index, index)] + self.noise[index];
        let column = self.covariances.column(index) / variance.max(1e-300).sqrt();
        self.covariances.ger(-1.0, &column, &column, 1.0);
    }

    /// Whether a run at one point serves as well at the other: their values differ by far less than two runs at one point.
    pub(super) fn is_like(&self, one: usize, other: usize) -> bool {
        let covariances = &self.covariances;
        let mean = self.means[one] - self.means[other];
        let variance =
            covariances[(one, one)] + covariances[(other, other)] - 2.0 * covariances[(one, other)];
        variance + mean * mean < 0.005 * self.noise[one]
    }

    /// The surface given its values at the points `known`.
    pub(super) fn given(&self, known: &[usize]) -> Conditional {
        let rows = self.covariances.select_rows(known);
        let mut between = rows.select_columns(known);
        let scale = between.diagonal().max().max(1e-12);
        let repaired = (0..TRIES as i32).find_map(|attempt| {
            for index in 0..known.len() {
                between[(index, index)] += JITTER * 10.0_f64.powi(attempt) * scale;
            }
            between.clone().cholesky()
        });
        // Numbers that are not finite have no factor; no point is then chosen by them.
        let factor = repaired.map_or_else(
            || DMatrix::from_element(known.len(), known.len(), f64::NAN),
            |cholesky| cholesky.unpack(),
        );
        let mut slopes = rows;
        factor.solve_lower_triangular_unchecked_mut(&mut slopes);
        let deviations = slopes.column_iter().enumerate().map(|(index, slopes)| {
            (self.covariances[(index, index)] - slopes.norm_squared()).max(0.0).sqrt()
        });
        Conditional { deviations: deviations.collect(), factor, slopes }
    }
}

impl Conditional {
    /// Values at the known points for independent standard normal numbers.
    pub(super) fn values(&self, surface: &Surface, known: &[usize], numbers: &DVector<f64>) -> Vec<f64> {
        let moved = &self.factor * numbers;
        known.iter().zip(moved.iter()).map(|(index, move_by)| surface.means[*index] + move_by).collect()
    }

    /// Means at all points, given those values.
    pub(super) fn means(&self, surface: &Surface, numbers: &DVector<f64>) -> DVector<f64> {
        &surface.means + self.slopes.tr_mul(numbers)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn nan_covariances_give_nan_means() {
        let surface = Surface {
            means: DVector::zeros(3),
            covariances: DMatrix::from_element(3, 3, f64::NAN),
            noise: vec![1.0; 3],
        };
        let given = surface.given(&[0, 1]);
        assert!(given.means(&surface, &DVector::from_element(2, 1.0)).iter().all(|mean| mean.is_nan()));
    }
}

//! The covariance of the latent function: Matérn 5/2 with a length scale per factor, and an uncertain constant.
//!
//! | symbol | meaning |
//! |---|---|
//! | k(x, x′) | σ² (1 + √5 r + 5 r²/3) exp(−√5 r) + c² |
//! | r² | Σ ((x_i − x_i′) / ℓ_i)² |
//! | σ², ℓ_i | variance of the function, length scale of factor i |
//! | c² | variance of the constant around which it varies |
//!
//! Rasmussen and Williams 2006, equation 4.17; the constant is their section 2.7 with one basis function.

use nalgebra::{DMatrix, DVector};

/// A covariance function. Points are columns of a matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Length scale of each factor, in widths of its range.
    pub lengths: Vec<f64>,
    /// Variance of the function.
    pub variance: f64,
    /// Variance of its constant.
    pub constant: f64,
}

impl Kernel {
    /// Covariances between two lists of points.
    pub fn matrix(&self, rows: &DMatrix<f64>, columns: &DMatrix<f64>) -> DMatrix<f64> {
        let (rows, columns) = (self.scaled(rows), self.scaled(columns));
        DMatrix::from_fn(rows.ncols(), columns.ncols(), |row, column| {
            self.variance * matern(squared_distance(&rows, row, &columns, column)) + self.constant
        })
    }

    /// Covariances between the points of one list.
    pub fn symmetric(&self, points: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = self.scaled(points);
        let mut matrix = DMatrix::from_element(scaled.ncols(), scaled.ncols(), self.diagonal());
        for column in 0..scaled.ncols() {
            for row in 0..column {
                let square = squared_distance(&scaled, row, &scaled, column);
                let covariance = self.variance * matern(square) + self.constant;
                matrix[(row, column)] = covariance;
                matrix[(column, row)] = covariance;
            }
        }
        matrix
    }

    /// The variance at any point.
    pub fn diagonal(&self) -> f64 {
        self.variance + self.constant
    }

    /// Σ Q_ij ∂k(x_i, x_j)/∂θ for a symmetric Q and θ = ln ℓ_1, …, ln σ².
    pub(super) fn gradient(&self, points: &DMatrix<f64>, weights: &DMatrix<f64>) -> Vec<f64> {
        let scaled = self.scaled(points);
        let factors = self.lengths.len();
        let mut gradient = vec![0.0; factors + 1];
        for column in 0..scaled.ncols() {
            gradient[factors] += self.variance * weights[(column, column)];
            for row in 0..column {
                let square = squared_distance(&scaled, row, &scaled, column);
                let r = (5.0 * square).sqrt();
                let decay = 2.0 * weights[(row, column)] * self.variance * (-r).exp();
                let slope = decay * (1.0 + r) * 5.0 / 3.0;
                for factor in 0..factors {
                    let distance = scaled[(factor, row)] - scaled[(factor, column)];
                    gradient[factor] += slope * distance * distance;
                }
                gradient[factors] += decay * (1.0 + r + r * r / 3.0);
            }
        }
        gradient
    }

    fn scaled(&self, points: &DMatrix<f64>) -> DMatrix<f64> {
        let mut scaled = points.clone();
        for (mut row, length) in scaled.row_iter_mut().zip(&self.lengths) {
            row /= *length;
        }
        scaled
    }
}

fn squared_distance(rows: &DMatrix<f64>, row: usize, columns: &DMatrix<f64>, column: usize) -> f64 {
    let factors = rows.nrows();
    let one = &rows.as_slice()[row * factors..(row + 1) * factors];
    let other = &columns.as_slice()[column * factors..(column + 1) * factors];
    one.iter().zip(other).map(|(one, other)| (one - other) * (one - other)).sum()
}

fn matern(square: f64) -> f64 {
    let r = (5.0 * square).sqrt();
    (1.0 + r + r * r / 3.0) * (-r).exp()
}

/// Points as columns of a matrix.
pub fn columns<P: AsRef<[f64]>>(factors: usize, points: &[P]) -> DMatrix<f64> {
    DMatrix::from_iterator(
        factors,
        points.len(),
        points.iter().flat_map(|point| point.as_ref().iter().copied()),
    )
}

/// `diag(root) matrix diag(root)`.
pub(super) fn on_both_sides(matrix: &mut DMatrix<f64>, root: &DVector<f64>) {
    for column in 0..matrix.ncols() {
        for row in 0..matrix.nrows() {
            matrix[(row, column)] *= root[row] * root[column];
        }
    }
}

//! The covariance of the latent function: Matérn 5/2 with a length scale per factor, and an uncertain constant.
//!
//! | symbol | meaning |
//! |---|---|
//! | k(x, x′) | σ² (1 + √5 r + 5 r²/3) exp(−√5 r) + c² |
//! | r² | Σ (d_i / ℓ_i)² |
//! | d_i | x_i − x_i′; along a factor with levels 0 for equal levels, and 1 for others |
//! | σ², ℓ_i | variance of the function, length scale of factor i |
//! | c² | variance of the constant around which it varies |
//!
//! Rasmussen and Williams 2006, equation 4.17; the constant is their section 2.7 with one basis function.
//!
//! A level is the corner of a simplex: its row of the scaled points is 1/√2 at its own place and 0 at all others. Squared distances between
//! levels are then 1, and the covariance is positive definite as that of points of a space.

use nalgebra::{DMatrix, DVector};

/// A covariance function. Points are columns of a matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel {
    /// Length scale of each factor, in widths of its range; along a factor with levels in distances between two of them.
    pub lengths: Vec<f64>,
    /// Number of levels of each factor; 0 for a range.
    pub levels: Vec<usize>,
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
        let owners = self.owners();
        let mut gradient = vec![0.0; factors + 1];
        for column in 0..scaled.ncols() {
            gradient[factors] += self.variance * weights[(column, column)];
            for row in 0..column {
                let square = squared_distance(&scaled, row, &scaled, column);
                let r = (5.0 * square).sqrt();
                let decay = 2.0 * weights[(row, column)] * self.variance * (-r).exp();
                let slope = decay * (1.0 + r) * 5.0 / 3.0;
                for (place, factor) in owners.iter().enumerate() {
                    let distance = scaled[(place, row)] - scaled[(place, column)];
                    gradient[*factor] += slope * distance * distance;
                }
                gradient[factors] += decay * (1.0 + r + r * r / 3.0);
            }
        }
        gradient
    }

    /// The factor of each row of the scaled points.
    fn owners(&self) -> Vec<usize> {
        let rows = |(factor, levels): (usize, &usize)| std::iter::repeat_n(factor, (*levels).max(1));
        self.levels.iter().enumerate().flat_map(rows).collect()
    }

    /// Points whose distances are those of the covariance.
    fn scaled(&self, points: &DMatrix<f64>) -> DMatrix<f64> {
        if self.levels.iter().all(|levels| *levels == 0) {
            let mut scaled = points.clone();
            for (mut row, length) in scaled.row_iter_mut().zip(&self.lengths) {
                row /= *length;
            }
            return scaled;
        }
        let mut scaled = DMatrix::zeros(self.owners().len(), points.ncols());
        let mut place = 0;
        for (factor, (levels, length)) in self.levels.iter().zip(&self.lengths).enumerate() {
            for (column, coordinate) in points.row(factor).iter().enumerate() {
                if *levels == 0 {
                    scaled[(place, column)] = coordinate / length;
                } else {
                    let level = ((coordinate * *levels as f64) as usize).min(levels - 1);
                    scaled[(place + level, column)] = std::f64::consts::FRAC_1_SQRT_2 / length;
                }
            }
            place += (*levels).max(1);
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

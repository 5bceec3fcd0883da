//! The posterior of the latent function, the same for both likelihoods.
//!
//! | symbol | meaning |
//! |---|---|
//! | K | covariances of the latent function at the points of the data |
//! | S | square roots of the precision of the data at each point |
//! | B = I + S K S = L Lᵀ | its eigenvalues are at least 1 (Rasmussen and Williams 2006, equation 3.26) |
//! | mean at x | k(x)ᵀ w, with weights w |
//! | covariance of x, x′ | k(x, x′) − k(x)ᵀ S B⁻¹ S k(x′) |

use nalgebra::linalg::Cholesky;
use nalgebra::{DMatrix, DVector, Dyn};

use super::kernel::{Kernel, on_both_sides};

/// Posterior of the latent function for given hyperparameters.
#[derive(Clone, Debug)]
pub struct Posterior {
    pub(super) kernel: Kernel,
    pub(super) points: DMatrix<f64>,
    pub(super) weights: DVector<f64>,
    pub(super) root: DVector<f64>,
    pub(super) factor: Cholesky<f64, Dyn>,
}

/// Means and the factor of covariances at a list of points.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// Posterior means.
    pub means: DVector<f64>,
    /// Posterior variances.
    pub variances: DVector<f64>,
    /// L⁻¹ S k(x), a column per point.
    reductions: DMatrix<f64>,
}

/// The Cholesky factor of B = I + S K S; none when a number of it is not finite.
pub(super) fn factor(covariances: &DMatrix<f64>, root: &DVector<f64>) -> Option<Cholesky<f64, Dyn>> {
    let mut matrix = covariances.clone();
    on_both_sides(&mut matrix, root);
    for index in 0..matrix.nrows() {
        matrix[(index, index)] += 1.0;
    }
    Cholesky::new(matrix)
}

/// ln |B| from its factor.
pub(super) fn ln_determinant(factor: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * factor.l_dirty().diagonal().iter().map(|value| value.ln()).sum::<f64>()
}

impl Posterior {
    /// The kernel.
    pub fn kernel(&self) -> &Kernel {
        &self.kernel
    }

    /// The variance at any point without data.
    pub fn prior_variance(&self) -> f64 {
        self.kernel.diagonal()
    }

    /// Means and variances at points (columns).
    pub fn predict(&self, points: &DMatrix<f64>) -> Prediction {
        let covariances = self.kernel.matrix(&self.points, points);
        let means = covariances.tr_mul(&self.weights);
        let mut reductions = covariances;
        for mut column in reductions.column_iter_mut() {
            column.component_mul_assign(&self.root);
        }
        self.factor.l_dirty().solve_lower_triangular_unchecked_mut(&mut reductions);
        let diagonal = self.kernel.diagonal();
        let variance =
            |column: nalgebra::DVectorView<'_, f64>| (diagonal - column.norm_squared()).max(1e-12 * diagonal);
        let variances = DVector::from_iterator(points.ncols(), reductions.column_iter().map(variance));
        Prediction { means, variances, reductions }
    }

    /// Covariances between the points of a prediction.
    pub fn covariances(&self, points: &DMatrix<f64>, prediction: &Prediction) -> DMatrix<f64> {
        let mut covariances = self.kernel.symmetric(points);
        covariances.gemm_tr(-1.0, &prediction.reductions, &prediction.reductions, 1.0);
        covariances
    }

    /// Covariances between the points of the data, whose prediction is `data`, and those of another prediction.
    pub(super) fn covariances_with(
        &self,
        data: &Prediction,
        points: &DMatrix<f64>,
        prediction: &Prediction,
    ) -> DMatrix<f64> {
        let mut covariances = self.kernel.matrix(&self.points, points);
        covariances.gemm_tr(-1.0, &data.reductions, &prediction.reductions, 1.0);
        covariances
    }
}

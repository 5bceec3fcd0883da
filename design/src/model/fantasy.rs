//! Batches of proposals: the joint posterior at candidates, updated by runs whose results are not known yet.
//!
//! A run in flight counts as a fantasy: its result is the posterior mean (the "Kriging believer" of Ginsbourger, Le Riche and
//! Carraro 2010). Means then stay as they are, and one run at candidate c with noise r changes covariances to
//! C − C_c C_cᵀ / (C_cc + r).

use nalgebra::DMatrix;

use super::Model;

/// The joint posterior of the latent function at candidates.
#[derive(Clone, Debug)]
pub(crate) struct Fantasies {
    /// Covariances.
    pub(crate) covariances: DMatrix<f64>,
    /// Variance of the latent function as one run would see it.
    pub(crate) noise: Vec<f64>,
}

impl Fantasies {
    /// The posterior of a model at candidates (columns).
    pub(crate) fn new(model: &Model, candidates: &DMatrix<f64>) -> Self {
        let prediction = model.posterior.predict(candidates);
        Self {
            covariances: model.posterior.covariances(candidates, &prediction),
            noise: model.noise(candidates, &prediction),
        }
    }

    /// Adds a run at a candidate, whose result is not known.
    pub(crate) fn observe(&mut self, candidate: usize) {
        let column = self.covariances.column(candidate).into_owned();
        let total = column[candidate].max(0.0) + self.noise[candidate];
        self.covariances.ger(-1.0 / total, &column, &column, 1.0);
    }

    /// Standard deviation at a candidate.
    pub(crate) fn deviation(&self, candidate: usize) -> f64 {
        self.covariances[(candidate, candidate)].max(1e-12).sqrt()
    }
}

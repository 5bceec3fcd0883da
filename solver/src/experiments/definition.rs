//! The interface of an experiment. Its section of the scenario implements [`Definition`].

use serde_json::Value;

use super::bodies::product_kinds;
use super::{Outputs, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{BodyKind, Scene};
use crate::mesh::Meshes;
use crate::scenario::{Fault, Numerics, Product, Scenario};

/// Simulated time that a fill usually takes to come to rest, in seconds.
pub(super) const USUAL_FILL_S: f64 = 2.0;

/// An experiment: bodies, scene, monitor, results, cost and checks.
pub trait Definition {
    /// Responses, series and curves.
    fn outputs(&self) -> &'static Outputs;

    /// The scene at the start.
    fn scene(&self, setup: &Setup) -> Scene;

    /// The monitor of a run of that scene.
    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor>;

    /// The kinds of bodies: all shapes of the product, or the one that `/product/shape` names.
    ///
    /// # Errors
    /// A product or a block that no lattice can fill.
    fn kinds(&self, scenario: &Scenario, meshes: &Meshes) -> Result<Vec<BodyKind>, Vec<Fault>> {
        product_kinds(scenario, meshes)
    }

    /// The kind of each body, as an index into `kinds` of them.
    fn kind_of_each(&self, scenario: &Scenario, kinds: &[BodyKind]) -> Vec<usize> {
        (0..scenario.product.count as usize).map(|i| i % kinds.len()).collect()
    }

    /// Maximum simulated time before t = 0, in seconds.
    fn longest_fill_s(&self, _numerics: &Numerics) -> f64 {
        0.0
    }

    /// Simulated time from t = 0 on, in seconds.
    fn duration_s(&self, numerics: &Numerics) -> f64 {
        numerics.duration_s
    }

    /// Usual simulated time, weighted by the share of sub-particles that are still there, in seconds.
    fn usual_s(&self, numerics: &Numerics) -> f64 {
        self.longest_fill_s(numerics).min(USUAL_FILL_S) + self.duration_s(numerics)
    }

    /// Maximum speed of a body at the start, in m/s.
    fn start_speed_m_s(&self) -> f64 {
        0.0
    }

    /// The field that most likely makes a scenario too large, and its value.
    fn size_field(&self, scenario: &Scenario, _bodies: u64) -> (&'static str, Value) {
        ("/product/subparticle_radius_m", scenario.product.subparticle_radius_m.into())
    }

    /// The field that sets the duration, and its value.
    fn duration_field(&self, numerics: &Numerics) -> (&'static str, f64) {
        ("/numerics/duration_s", numerics.duration_s)
    }

    /// Lattice points in the boxes of all kinds. A mesh counts when it is filled.
    fn lattice_points(&self, product: &Product) -> f64 {
        let cells =
            |size: [f64; 3]| size.iter().map(|s| s / (2.0 * product.radius_m()) + 2.0).product::<f64>();
        // Each size is filled twice, as it is and mirrored.
        let of_sizes = || product.scaled_sizes_m().map(|size| 2.0 * cells(size)).sum();
        if product.mesh.is_some() || product.spheres { 0.0 } else { of_sizes() }
    }

    /// Cells of the floor over which bodies are dropped, in squares of R.
    fn floor_cells(&self, _radius_m: f64) -> f64 {
        0.0
    }

    /// Faults of bodies that do not fit, found without placing them.
    fn fit_faults(&self, _setup: &Setup) -> Vec<Fault> {
        Vec::new()
    }

    /// Faults of the start, found only in scenarios that fit and are small enough. May build the scene.
    fn start_faults(&self, _setup: &Setup) -> Vec<Fault> {
        Vec::new()
    }
}

//! A scenario with its bodies and meshes: the input of a scene.

use std::sync::OnceLock;

use glam::DVec3;

use super::bodies::{bounds_on_timestep, timestep_s};
use super::{Definition, definition, laws};
use crate::engine::run::{ExperimentMonitor, RunPlan};
use crate::engine::scene::{BodyKind, Scene};
use crate::mesh::Meshes;
use crate::physics::timestep::Stability;
use crate::scenario::{Fault, Scenario};

/// A scenario, its kinds of bodies and its meshes. The scene is built once, when it is first needed.
#[derive(Debug)]
pub struct Setup {
    /// The scenario.
    pub scenario: Scenario,
    /// The kinds of bodies.
    pub kinds: Vec<BodyKind>,
    /// The mesh files.
    pub meshes: Meshes,
    scene: OnceLock<Scene>,
}

impl Setup {
    /// Fills the bodies of a scenario whose meshes are among `meshes`.
    ///
    /// # Errors
    /// Bodies that no lattice can fill.
    pub fn new(scenario: &Scenario, meshes: &Meshes) -> Result<Self, Vec<Fault>> {
        let kinds = definition(&scenario.experiment).kinds(scenario, meshes)?;
        Ok(Self { scenario: scenario.clone(), kinds, meshes: meshes.clone(), scene: OnceLock::new() })
    }

    /// The experiment.
    pub fn definition(&self) -> &dyn Definition {
        definition(&self.scenario.experiment)
    }

    /// Bounds on the time step.
    pub fn bounds(&self) -> Stability {
        bounds_on_timestep(&self.scenario, &self.kinds)
    }

    /// The time step, in seconds.
    pub fn timestep_s(&self) -> f64 {
        timestep_s(&self.scenario, &self.bounds())
    }

    /// The kind of each body, as an index into [`Self::kinds`].
    pub fn kind_of_each(&self) -> Vec<usize> {
        self.definition().kind_of_each(&self.scenario, &self.kinds)
    }

    /// Times of samples and of the end.
    pub fn plan(&self) -> RunPlan {
        plan(&self.scenario)
    }

    /// The scene at the start.
    pub fn scene(&self) -> &Scene {
        self.scene.get_or_init(|| self.definition().scene(self))
    }

    /// A new monitor for a run of the scene.
    pub fn monitor(&self) -> Box<dyn ExperimentMonitor> {
        self.definition().monitor(&self.scenario, self.scene())
    }

    /// A scene without bodies and surfaces: laws, kinds, gravity and time step of the scenario.
    pub(super) fn empty_scene(&self) -> Scene {
        let numerics = &self.scenario.numerics;
        Scene {
            radius_m: self.scenario.product.radius_m(),
            kinds: self.kinds.clone(),
            bodies: Vec::new(),
            waiting: 0,
            held: Vec::new(),
            surfaces: Vec::new(),
            laws: laws::laws(&self.scenario),
            gravity: DVec3::NEG_Z * numerics.gravity_m_s2,
            low: DVec3::ZERO,
            high: DVec3::ZERO,
            periodic_y: false,
            timestep_s: self.timestep_s(),
            speed_limit_m_s: numerics.speed_limit_m_s,
        }
    }
}

/// Times of samples and of the end of a scenario.
pub fn plan(scenario: &Scenario) -> RunPlan {
    let (definition, numerics) = (definition(&scenario.experiment), &scenario.numerics);
    RunPlan {
        sample_interval_s: numerics.output_interval_s,
        longest_fill_s: definition.longest_fill_s(numerics),
        duration_s: definition.duration_s(numerics),
    }
}

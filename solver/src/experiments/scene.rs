//! Bodies and surfaces, freely placed: what an engineer draws up to see how fillets fare on a piece of equipment.
//!
//! The run begins at t = 0 with everything as placed; surfaces move from there on. What goes farther than the margin beyond all
//! that is there at the start leaves, and is counted as escaped. Watched are rest, bonds, and the force on each surface.

use glam::DVec3;
use serde_json::{Map, Value};

use super::surfaces::{extent, surfaces};
use super::{Prepared, Watch, bounds_on_timestep, kind_of_each, kinds, laws, orientation, plan, timestep_s};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::mesh::Meshes;
use crate::observe::{REST_DURATION_S, RestDetector};
use crate::result::{Curve, EndReason, Series};
use crate::scenario::{FreeScene, Numerics, Scenario};

/// The experiment of a free scene.
pub(super) fn prepare(scenario: &Scenario, free: &FreeScene, meshes: &Meshes) -> Prepared {
    let scene = scene(scenario, free, meshes);
    let watch = Box::new(SceneWatch::new(scenario, free, &scene));
    Prepared { plan: plan(scenario), watch, scene }
}

/// The scene of a free scene's scenario.
pub fn scene(scenario: &Scenario, free: &FreeScene, meshes: &Meshes) -> Scene {
    let kinds = kinds(scenario, meshes);
    let radius_m = scenario.product.radius_m();
    let placed = kind_of_each(scenario, kinds.len()).into_iter().zip(&free.bodies);
    let bodies: Vec<Placement> = placed
        .map(|(kind, body)| Placement {
            kind,
            position: body.position_m.into(),
            orientation: orientation(body.orientation_deg),
            velocity: body.velocity_m_s.into(),
        })
        .collect();
    let surfaces = surfaces(&free.surfaces, meshes);
    let around = |body: &Placement| {
        let reach = DVec3::splat(kinds[body.kind].meta.bounding_radius_m + radius_m);
        (body.position - reach, body.position + reach)
    };
    let (low, high) = bodies
        .iter()
        .map(around)
        .chain(extent(&surfaces))
        .reduce(|(low, high), (a, b)| (low.min(a), high.max(b)))
        .unwrap_or_default();
    let down = DVec3::from(free.gravity_direction).normalize_or_zero();
    Scene {
        radius_m,
        surfaces,
        laws: laws::laws(scenario),
        gravity: down * scenario.numerics.gravity_m_s2,
        low: low - free.margin_m,
        high: high + free.margin_m,
        periodic_y: false,
        timestep_s: timestep_s(scenario, &bounds_on_timestep(scenario, &kinds)),
        speed_limit_m_s: scenario.numerics.speed_limit_m_s,
        kinds,
        bodies,
        held: Vec::new(),
    }
}

/// The director of a free scene.
#[derive(Debug)]
struct SceneWatch {
    numerics: Numerics,
    low_m: DVec3,
    high_m: DVec3,
    /// Against the direction of gravity, of length 1.
    up: DVec3,
    radius_m: f64,
    /// What must be slow for this long to be at rest, in seconds.
    rest_for_s: f64,
    rest: RestDetector,
    escaped_kg: f64,
    max_overlap_m: f32,
    greatest_height_m: Option<f64>,
    /// Numbers of the bodies that are still there, and their centres of mass, in metres.
    centres_m: Vec<(u32, DVec3)>,
    t_s: Vec<f64>,
    kinetic_energy_j: Vec<f64>,
    bonds_intact: Vec<f64>,
    /// Names of the surfaces, and the force on each at each sample, in newton.
    forces_n: Vec<(String, Vec<DVec3>)>,
}

impl SceneWatch {
    fn new(scenario: &Scenario, free: &FreeScene, scene: &Scene) -> Self {
        let numerics = scenario.numerics.clone();
        // What is thrown up is slow for so long at its height, and is not at rest.
        let turning_s = 2.0 * numerics.rest_speed_m_s / numerics.gravity_m_s2;
        Self {
            low_m: scene.low,
            high_m: scene.high,
            up: -DVec3::from(free.gravity_direction).normalize_or_zero(),
            radius_m: scene.radius_m,
            rest_for_s: if turning_s.is_finite() {
                REST_DURATION_S.max(1.5 * turning_s)
            } else {
                REST_DURATION_S
            },
            rest: RestDetector::default(),
            escaped_kg: 0.0,
            max_overlap_m: 0.0,
            greatest_height_m: None,
            centres_m: Vec::new(),
            t_s: Vec::new(),
            kinetic_energy_j: Vec::new(),
            bonds_intact: Vec::new(),
            forces_n: scene.surfaces.iter().map(|surface| (surface.name.clone(), Vec::new())).collect(),
            numerics,
        }
    }

    fn is_inside(&self, x: DVec3) -> bool {
        x.cmpge(self.low_m).all() && x.cmple(self.high_m).all()
    }

    /// The sub-particles, by serial, that have gone beyond the margin.
    fn what_left(&mut self, state: &State) -> Vec<u32> {
        let mut left = Vec::new();
        for i in 0..state.particles.len() {
            if !self.is_inside(state.position(i)) {
                self.escaped_kg += f64::from(state.masses[i]);
                left.push(state.serials[i]);
            }
        }
        left
    }

    fn take_in(&mut self, sample: &Sample<'_>, now_s: f64) {
        let state = sample.state;
        self.max_overlap_m = sample.max_overlap_m;
        self.t_s.push(now_s);
        self.kinetic_energy_j.push(state.kinetic_energy());
        self.bonds_intact.push(state.bonds_intact_fraction());
        for ((_, forces), force) in self.forces_n.iter_mut().zip(sample.surface_forces) {
            forces.push(*force);
        }
        let heights = (0..state.particles.len()).map(|i| state.position(i).dot(self.up) + self.radius_m);
        self.greatest_height_m = heights.reduce(f64::max);
        let centres = state.body_ranges().filter_map(|(body, range)| {
            let inside = || range.clone().map(|i| state.position(i)).filter(|&x| self.is_inside(x));
            // Those of one body weigh the same.
            let count = inside().count();
            (count > 0).then(|| (body, inside().sum::<DVec3>() / count as f64))
        });
        self.centres_m = centres.collect();
        self.rest.record(now_s, state.faster_than(self.numerics.rest_speed_m_s), state.particles.len());
    }
}

impl ExperimentMonitor for SceneWatch {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        self.take_in(sample, now_s);
        let stop = &self.numerics.stop;
        if stop.when_empty && sample.state.particles.is_empty() {
            return Decision::End(EndReason::Empty);
        }
        if stop.when_done && self.rest.since_s(self.rest_for_s).is_some() {
            return Decision::End(EndReason::Done);
        }
        Decision::Continue { remove: self.what_left(sample.state) }
    }

    fn discharged_kg(&self) -> f64 {
        0.0
    }
}

impl Watch for SceneWatch {
    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("bodies", self.centres_m.len().into());
        add("escaped_kg", self.escaped_kg.into());
        add("bonds_intact_fraction", self.bonds_intact.last().copied().into());
        let at_rest_s = self.rest.since_s(self.rest_for_s).filter(|_| !self.centres_m.is_empty());
        add("time_to_rest_s", at_rest_s.into());
        add("max_overlap_ratio", (f64::from(self.max_overlap_m) / self.radius_m).into());
        add("kinetic_energy_end_j", self.kinetic_energy_j.last().copied().into());
        add("greatest_height_m", self.greatest_height_m.into());
        responses
    }

    // The force on a surface by its components: how much it bears and how much it is dragged depends on how it lies.
    fn series(&self) -> Vec<Series> {
        let series = |name: String, unit: &str, values: Vec<f64>| Series {
            name,
            unit: unit.into(),
            t_s: self.t_s.clone(),
            values,
        };
        let forces = self.forces_n.iter().flat_map(|(name, forces)| {
            [("x", DVec3::X), ("y", DVec3::Y), ("z", DVec3::Z)].map(|(axis, unit)| {
                let along = forces.iter().map(|force| force.dot(unit)).collect();
                series(format!("force_{name}_{axis}"), "N", along)
            })
        });
        let mut all = vec![
            series("kinetic_energy".into(), "J", self.kinetic_energy_j.clone()),
            series("bonds_intact_fraction".into(), "1", self.bonds_intact.clone()),
        ];
        all.extend(forces);
        all
    }

    fn curves(&self) -> Vec<Curve> {
        let curve = |(name, unit): (&str, DVec3)| Curve {
            name: name.into(),
            unit: "m".into(),
            over: "body".into(),
            over_unit: "1".into(),
            x: self.centres_m.iter().map(|(body, _)| f64::from(*body)).collect(),
            values: self.centres_m.iter().map(|(_, centre)| centre.dot(unit)).collect(),
        };
        [("position_x", DVec3::X), ("position_y", DVec3::Y), ("position_z", DVec3::Z)].map(curve).to_vec()
    }
}

//! A fillet on a plate that is tilted until it slides (paper sections 2.3.2 and 3.2, Fig. 8): the critical angle.
//!
//! The fillet is set flat on a level plate and comes to rest; from t = 0 on the plate turns steadily about an axis across the slope,
//! in its surface under the fillet. The critical angle is the tilt at which sliding sets in for good, from the speed of the centre
//! of mass in the plate's own frame ([`crate::observe::SlidingDetector`]).
//!
//! Expected: atan μ within 3° for μ ≤ 0.5, linear in μ, the surface energy being negligible.

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Map, Value};

use super::drop::height_over_plate;
use super::placement::uniform;
use super::{Prepared, Watch, bounds_on_timestep, kinds, laws, orientation, plan, strayed, timestep_s};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::observe::{REST_DURATION_S, RestDetector, SlidingDetector};
use crate::result::{EndReason, Series};
use crate::scenario::{Numerics, Scenario, Slide};

/// The plate is long enough to slide this far, in metres.
const SLIDING_M: f64 = 0.5;
/// Room around everything, in metres.
const MARGIN_M: f64 = 0.1;

/// The experiment of a fillet that slides.
pub(super) fn prepare(scenario: &Scenario, slide: &Slide, meshes: &Meshes) -> Prepared {
    let kinds = kinds(scenario, meshes);
    let radius_m = scenario.product.radius_m();
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    let yaw_deg = slide.yaw_deg + slide.scatter_deg * (2.0 * uniform(&mut rng) - 1.0);
    let orientation = orientation([yaw_deg, 0.0, 0.0]);
    let position = DVec3::Z * height_over_plate(&kinds[0], orientation, radius_m);
    let half_m = kinds[0].meta.bounding_radius_m + radius_m + SLIDING_M;
    let corner = DVec3::new(-half_m, -half_m, 0.0);
    let (u, v) = (DVec3::X * 2.0 * half_m, DVec3::Y * 2.0 * half_m);
    // The fillet's length points up the slope: +x rises.
    let tilting = Motion::Moving {
        velocity: DVec3::ZERO,
        pivot: DVec3::ZERO,
        spin: DVec3::NEG_Y * slide.tilt_rate_deg_s.to_radians(),
    };
    let plate = Surface::parallelogram("plate", SurfaceKind::Equipment, corner, u, v).moving(tilting);
    let room = DVec3::splat(half_m + MARGIN_M);
    let scene = Scene {
        radius_m,
        surfaces: vec![plate],
        laws: laws::laws(scenario),
        gravity: DVec3::NEG_Z * scenario.numerics.gravity_m_s2,
        low: -room,
        high: room,
        periodic_y: false,
        timestep_s: timestep_s(scenario, &bounds_on_timestep(scenario, &kinds)),
        speed_limit_m_s: scenario.numerics.speed_limit_m_s,
        bodies: vec![Placement { kind: 0, position, orientation, velocity: DVec3::ZERO }],
        held: Vec::new(),
        kinds,
    };
    let watch = Box::new(SlideWatch::new(scenario, slide, &scene, tilting));
    Prepared { plan: plan(scenario), watch, scene }
}

/// The centre of mass of a fillet in the plate's own frame.
#[derive(Clone, Copy, Debug, Default)]
struct Centre {
    position_m: DVec3,
    velocity_m_s: DVec3,
}

/// The director of a fillet that slides.
#[derive(Debug)]
struct SlideWatch {
    slide: Slide,
    numerics: Numerics,
    friction: f64,
    tilting: Motion,
    low_m: DVec3,
    high_m: DVec3,
    /// Heights of the sub-particles in the fillet's own axes, in metres.
    heights_m: Vec<f64>,
    rest: RestDetector,
    sliding: SlidingDetector,
    start: Option<DVec3>,
    rolled_over: bool,
    /// Simulated time at t = 0.
    start_s: f64,
    /// Simulated times of all samples.
    simulated_s: Vec<f64>,
    kinetic_energy_j: Vec<f64>,
    bonds_intact: Vec<f64>,
    /// From t = 0 on.
    t_s: Vec<f64>,
    tilt_deg: Vec<f64>,
    speed_m_s: Vec<f64>,
    displacement_m: Vec<f64>,
}

impl SlideWatch {
    fn new(scenario: &Scenario, slide: &Slide, scene: &Scene, tilting: Motion) -> Self {
        Self {
            slide: slide.clone(),
            numerics: scenario.numerics.clone(),
            friction: scenario.contact.fillet_equipment.static_friction,
            tilting,
            low_m: scene.low,
            high_m: scene.high,
            heights_m: scene.kinds[0].meta.points.iter().map(|point| point.z).collect(),
            rest: RestDetector::default(),
            sliding: SlidingDetector::default(),
            start: None,
            rolled_over: false,
            start_s: 0.0,
            simulated_s: Vec::new(),
            kinetic_energy_j: Vec::new(),
            bonds_intact: Vec::new(),
            t_s: Vec::new(),
            tilt_deg: Vec::new(),
            speed_m_s: Vec::new(),
            displacement_m: Vec::new(),
        }
    }

    /// Where the fillet is and how it moves, seen from the plate.
    fn centre(&self, state: &State, now_s: f64) -> Centre {
        let pose = self.tilting.pose(Some(now_s));
        let mean = |of: &dyn Fn(usize) -> DVec3| {
            (0..state.particles.len()).map(of).sum::<DVec3>() / state.particles.len() as f64
        };
        let position = mean(&|i| state.position(i));
        let velocity = mean(&|i| state.particles[i].velocity.as_dvec3());
        let to_plate = pose.turn.transpose();
        Centre {
            position_m: to_plate * position,
            velocity_m_s: to_plate * (velocity - pose.spin.cross(position)),
        }
    }

    /// Whether what was the fillet's upper side now faces the plate.
    fn is_turned(&self, state: &State, now_s: f64) -> bool {
        let up = self.tilting.pose(Some(now_s)).turn * DVec3::Z;
        let moment = |i: usize| self.heights_m[state.serials[i] as usize] * state.position(i).dot(up);
        (0..state.particles.len()).map(moment).sum::<f64>() < 0.0
    }

    fn take_in(&mut self, state: &State, now_s: f64) {
        let centre = self.centre(state, now_s);
        let start = *self.start.get_or_insert(centre.position_m);
        self.t_s.push(now_s);
        self.tilt_deg.push(self.slide.tilt_rate_deg_s * now_s);
        self.speed_m_s.push(-centre.velocity_m_s.x);
        self.displacement_m.push(start.x - centre.position_m.x);
        self.sliding.record(now_s, -centre.velocity_m_s.x);
        self.rolled_over = self.rolled_over || self.is_turned(state, now_s);
    }
}

impl ExperimentMonitor for SlideWatch {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let state = sample.state;
        // The sample at the start is looked at twice.
        if self.simulated_s.last() != Some(&sample.simulated_s) {
            self.simulated_s.push(sample.simulated_s);
            self.kinetic_energy_j.push(state.kinetic_energy());
            self.bonds_intact.push(state.bonds_intact_fraction());
        }
        if state.particles.is_empty() {
            return Decision::End(EndReason::Done);
        }
        let go_on = Decision::Continue { remove: strayed(state, self.low_m, self.high_m) };
        let Some(now_s) = sample.belt_time_s else {
            let moving = state.faster_than(self.numerics.rest_speed_m_s);
            self.rest.record(sample.simulated_s, moving, state.particles.len());
            // As long as it has not rested, its times end at 0.
            self.start_s = sample.simulated_s;
            return if self.rest.since_s(REST_DURATION_S).is_some() { Decision::Start } else { go_on };
        };
        self.take_in(state, now_s);
        let known = self.numerics.stop.when_done && self.sliding.is_confirmed();
        let at_the_end = self.displacement_m.last().is_some_and(|&way| way > SLIDING_M);
        if known || at_the_end { Decision::End(EndReason::Done) } else { go_on }
    }

    fn discharged_kg(&self) -> f64 {
        0.0
    }
}

impl Watch for SlideWatch {
    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let critical = self.sliding.onset_s().map(|t| t * self.slide.tilt_rate_deg_s);
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("critical_angle_deg", critical.into());
        add("friction_angle_deg", self.friction.atan().to_degrees().into());
        add("slid", critical.is_some().into());
        add("rolled_over", self.rolled_over.into());
        add("bonds_intact_fraction", self.bonds_intact.last().copied().into());
        responses
    }

    fn series(&self) -> Vec<Series> {
        let series = |name: &str, unit: &str, t_s: &[f64], values: &[f64]| Series {
            name: name.into(),
            unit: unit.into(),
            t_s: t_s.to_vec(),
            values: values.to_vec(),
        };
        let all: Vec<f64> = self.simulated_s.iter().map(|t| t - self.start_s).collect();
        vec![
            series("tilt_angle", "°", &self.t_s, &self.tilt_deg),
            series("sliding_speed", "m/s", &self.t_s, &self.speed_m_s),
            series("displacement", "m", &self.t_s, &self.displacement_m),
            series("kinetic_energy", "J", &all, &self.kinetic_energy_j),
            series("bonds_intact_fraction", "1", &all, &self.bonds_intact),
        ]
    }
}

//! The monitor of a free scene: rest, bonds, and the force on each surface.

use glam::DVec3;
use serde_json::{Map, Value};

use super::{MASS, POSITIONS, POWER};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::equipment::Motion;
use crate::experiments::energy::{ENERGY_MARGIN, given_j, start_overlap_j};
use crate::experiments::interpenetration::Interpenetration;
use crate::experiments::loads::{AXES, LoadSeries, SampleStats, power_w};
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::warnings::TEST_NEVER_BEGAN;
use crate::observe::{REST_DURATION_S, Recorder, RestDetector, SeriesId};
use crate::result::{Curve, EndReason, Warning};
use crate::scenario::{FreeScene, Numerics, Scenario};

/// The monitor of a free scene.
#[derive(Debug)]
pub(super) struct SceneMonitor {
    numerics: Numerics,
    low_m: DVec3,
    high_m: DVec3,
    /// Against the direction of gravity, of length 1.
    up: DVec3,
    radius_m: f64,
    /// Time below the speed of rest that counts as rest, in seconds.
    rest_for_s: f64,
    rest: RestDetector,
    /// Kinetic energy beyond which the run has diverged, in joule.
    most_energy_j: f64,
    escaped_kg: f64,
    max_overlap_m: f32,
    greatest_height_m: Option<f64>,
    interpenetration: Interpenetration,
    /// State at the last sample, if a sub-particle can be inside a body.
    last: Option<State>,
    /// Numbers of the bodies that are still there, and their centres of mass, in metres.
    centres_m: Vec<(u32, DVec3)>,
    recorder: Recorder,
    kinetic_energy: SeriesId,
    bonds_intact: SeriesId,
    mass: SeriesId,
    power: SeriesId,
    power_w: SampleStats,
    loads: LoadSeries,
    motions: Vec<Motion>,
    max_force_n: SampleStats,
    max_torque_n_m: SampleStats,
    passed_through: u64,
}

/// [`ENERGY_MARGIN`] times the energy of the bodies at the start, which may overlap and fall to the farthest corner. Moving surfaces do work
/// without a bound, so that it is infinite with them.
fn most_energy_j(scenario: &Scenario, free: &FreeScene, scene: &Scene) -> f64 {
    if scene.surfaces.iter().any(|surface| surface.motion != Motion::Fixed) {
        return f64::INFINITY;
    }
    let given_j = scene.bodies.iter().map(|body| {
        let kind = &scene.kinds[body.kind];
        let down = free.down();
        let fall_m =
            ((scene.low - body.position) * down).max((scene.high - body.position) * down).element_sum();
        let fall = scenario.numerics.gravity_m_s2 * fall_m;
        given_j(kind, &scenario.contact, scene.radius_m, body.velocity.length(), fall)
            + start_overlap_j(kind, &scenario.material, scene.radius_m)
    });
    ENERGY_MARGIN * given_j.sum::<f64>()
}

impl SceneMonitor {
    pub(super) fn new(scenario: &Scenario, free: &FreeScene, scene: &Scene) -> Self {
        let numerics = scenario.numerics.clone();
        // A body thrown up is slow for this long at its maximum height without being at rest.
        let turning_s = 2.0 * numerics.rest_speed_m_s / numerics.gravity_m_s2;
        let mut recorder = Recorder::default();
        Self {
            low_m: scene.low,
            high_m: scene.high,
            up: -free.down(),
            radius_m: scene.radius_m,
            rest_for_s: if turning_s.is_finite() {
                REST_DURATION_S.max(1.5 * turning_s)
            } else {
                REST_DURATION_S
            },
            rest: RestDetector::default(),
            most_energy_j: most_energy_j(scenario, free, scene),
            escaped_kg: 0.0,
            max_overlap_m: 0.0,
            greatest_height_m: None,
            interpenetration: Interpenetration::new(scene),
            last: None,
            centres_m: Vec::new(),
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            mass: recorder.add_row(&MASS),
            power: recorder.add_row(&POWER),
            power_w: SampleStats::default(),
            loads: LoadSeries::new(&scene.surfaces, &mut recorder),
            motions: scene.surfaces.iter().map(|surface| surface.motion).collect(),
            max_force_n: SampleStats::default(),
            max_torque_n_m: SampleStats::default(),
            passed_through: 0,
            recorder,
            numerics,
        }
    }

    fn is_inside(&self, x: DVec3) -> bool {
        x.cmpge(self.low_m).all() && x.cmple(self.high_m).all()
    }

    /// Serials of the sub-particles that have gone beyond the margin.
    fn leaving(&mut self, state: &State) -> Vec<u32> {
        let mut left = Vec::new();
        for i in 0..state.particles.len() {
            if !self.is_inside(state.position(i)) {
                self.escaped_kg += f64::from(state.masses[i]);
                left.push(state.serials[i]);
            }
        }
        left
    }

    fn record(&mut self, sample: &Sample<'_>, now_s: f64) {
        let state = sample.state;
        self.max_overlap_m = sample.max_overlap_m;
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        let mass_kg: f64 = state.masses.iter().map(|&m| f64::from(m)).sum();
        self.recorder.record(self.mass, mass_kg);
        let power = self.motions.iter().zip(sample.surface_loads);
        let power_now_w =
            power.map(|(motion, load)| power_w(motion, load, now_s)).fold(0.0, |sum, one| sum + one);
        self.recorder.record(self.power, power_now_w);
        self.power_w.add(power_now_w);
        if !self.motions.is_empty() {
            let [force_n, torque_n_m] = self.loads.record(sample.surface_loads, now_s, &mut self.recorder);
            self.max_force_n.add(force_n);
            self.max_torque_n_m.add(torque_n_m);
        }
        self.passed_through = sample.passed_through;
        let heights = (0..state.particles.len()).map(|i| state.position(i).dot(self.up) + self.radius_m);
        self.greatest_height_m = heights.reduce(f64::max);
        let centres = state.body_ranges().filter_map(|(body, range)| {
            let inside = || range.clone().map(|i| state.position(i)).filter(|&x| self.is_inside(x));
            // Those of one body weigh the same.
            let count = inside().count();
            (count > 0).then(|| (body, inside().sum::<DVec3>() / count as f64))
        });
        self.centres_m = centres.collect();
        self.last = self.interpenetration.has_cells().then(|| state.clone());
        self.rest.record(now_s, state.faster_than(self.numerics.rest_speed_m_s), state.particles.len());
    }
}

impl ExperimentMonitor for SceneMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        self.record(sample, now_s);
        let energy_j = sample.state.kinetic_energy();
        if energy_j > self.most_energy_j {
            let most = self.most_energy_j;
            return Decision::Diverged(format!(
                "the bodies have {energy_j:.2e} J of kinetic energy; the limit is {most:.2e} J, twice the energy that they can have"
            ));
        }
        let stop = &self.numerics.stop;
        if stop.when_empty && sample.state.particles.is_empty() {
            return Decision::End(EndReason::Empty);
        }
        if stop.when_done && self.rest.since_s(self.rest_for_s).is_some() {
            return Decision::End(EndReason::Done);
        }
        Decision::Continue { remove: self.leaving(sample.state) }
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(
            self.recorder.save(),
            &self.rest,
            &self.escaped_kg,
            &self.max_overlap_m,
            &self.greatest_height_m,
            &self.last,
            &self.centres_m,
            &self.power_w,
            &self.max_force_n,
            &self.max_torque_n_m,
            &self.passed_through,
        ))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let samples;
        (
            samples,
            self.rest,
            self.escaped_kg,
            self.max_overlap_m,
            self.greatest_height_m,
            self.last,
            self.centres_m,
            self.power_w,
            self.max_force_n,
            self.max_torque_n_m,
            self.passed_through,
        ) = saved.read()?;
        if self.recorder.restore(samples) && self.last.as_ref().is_none_or(State::is_consistent) {
            Ok(())
        } else {
            Err(SavedFieldsError)
        }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("bodies", self.centres_m.len().into());
        add("escaped_kg", self.escaped_kg.into());
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        let at_rest_s = self.rest.since_s(self.rest_for_s).filter(|_| !self.centres_m.is_empty());
        add("time_to_rest_s", at_rest_s.into());
        add("max_overlap_ratio", (f64::from(self.max_overlap_m) / self.radius_m).into());
        add("kinetic_energy_end_j", self.recorder.last(self.kinetic_energy).into());
        add("passed_through", self.passed_through.into());
        add("max_surface_force_n", self.max_force_n.max().into());
        add("max_surface_torque_n_m", self.max_torque_n_m.max().into());
        add("mean_power_w", self.power_w.mean().into());
        add("max_power_w", self.power_w.max().into());
        let interpenetrated = self.last.as_ref().and_then(|state| self.interpenetration.fraction(state));
        let none_inside = self.greatest_height_m.map(|_| 0.0);
        add("interpenetrated_fraction", interpenetrated.or(none_inside).into());
        add("greatest_height_m", self.greatest_height_m.into());
        responses
    }

    fn warnings(&self, _reason: EndReason) -> Vec<Warning> {
        let touched = self.max_force_n.max().is_some_and(|force_n| force_n > 0.0);
        let end_s = self.recorder.belt_s(self.power).last().unwrap_or(&0.0);
        let figures = format!("No body touched a surface until the end at {end_s:.3} s.");
        (!touched && !self.motions.is_empty()).then(|| TEST_NEVER_BEGAN.with(&figures)).into_iter().collect()
    }

    fn curves(&self) -> Vec<Curve> {
        let bodies = || self.centres_m.iter().map(|(body, _)| f64::from(*body)).collect();
        let along = |axis| self.centres_m.iter().map(|(_, centre)| centre.dot(axis)).collect();
        POSITIONS.iter().zip(AXES).map(|(row, (_, axis))| row.curve(bodies(), along(axis))).collect()
    }
}

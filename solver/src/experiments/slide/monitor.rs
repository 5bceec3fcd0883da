//! The monitor of a slide: waits for rest, then observes the fillet in the frame of the tilting plate.

use glam::DVec3;
use serde_json::{Map, Value};

use super::{DISPLACEMENT, SLIDING_M, SLIDING_SPEED, TILT_ANGLE};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::equipment::Motion;
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::placement::outside;
use crate::experiments::warnings::{TEST_NEVER_BEGAN, never_at_rest};
use crate::observe::{REST_DURATION_S, Recorder, RestDetector, SeriesId, SlidingDetector};
use crate::result::{EndReason, Warning};
use crate::scenario::{Numerics, Scenario, Slide};

/// The centre of mass of a fillet in the plate's own frame.
#[derive(Clone, Copy, Debug, Default)]
struct Centre {
    position_m: DVec3,
    velocity_m_s: DVec3,
}

/// The monitor of a slide.
#[derive(Debug)]
pub(super) struct SlideMonitor {
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
    recorder: Recorder,
    tilt: SeriesId,
    speed: SeriesId,
    displacement: SeriesId,
    kinetic_energy: SeriesId,
    bonds_intact: SeriesId,
}

impl SlideMonitor {
    pub(super) fn new(scenario: &Scenario, slide: &Slide, scene: &Scene) -> Self {
        let mut recorder = Recorder::default();
        Self {
            slide: slide.clone(),
            numerics: scenario.numerics.clone(),
            friction: scenario.contact.fillet_equipment.static_friction,
            tilting: slide.tilting(),
            low_m: scene.low,
            high_m: scene.high,
            heights_m: scene.kinds[0].meta.points.iter().map(|point| point.z).collect(),
            rest: RestDetector::default(),
            sliding: SlidingDetector::default(),
            start: None,
            rolled_over: false,
            tilt: recorder.add_row(&TILT_ANGLE),
            speed: recorder.add_row(&SLIDING_SPEED),
            displacement: recorder.add_row(&DISPLACEMENT),
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            recorder,
        }
    }

    /// Position and velocity of the fillet in the plate's frame.
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

    /// Whether the fillet's upper side now faces the plate.
    fn is_turned(&self, state: &State, now_s: f64) -> bool {
        let up = self.tilting.pose(Some(now_s)).turn * DVec3::Z;
        let moment = |i: usize| self.heights_m[state.serials[i] as usize] * state.position(i).dot(up);
        (0..state.particles.len()).map(moment).sum::<f64>() < 0.0
    }

    fn record_motion(&mut self, state: &State, now_s: f64) {
        let centre = self.centre(state, now_s);
        let start = *self.start.get_or_insert(centre.position_m);
        self.recorder.record(self.tilt, self.slide.tilt_rate_deg_s * now_s);
        self.recorder.record(self.speed, -centre.velocity_m_s.x);
        self.recorder.record(self.displacement, start.x - centre.position_m.x);
        self.sliding.record(now_s, -centre.velocity_m_s.x);
        self.rolled_over = self.rolled_over || self.is_turned(state, now_s);
    }
}

impl ExperimentMonitor for SlideMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let state = sample.state;
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        if state.particles.is_empty() {
            return Decision::End(EndReason::Done);
        }
        let go_on = Decision::Continue { remove: outside(state, self.low_m, self.high_m) };
        let Some(now_s) = sample.belt_time_s else {
            let moving = state.faster_than(self.numerics.rest_speed_m_s);
            self.rest.record(sample.simulated_s, moving, state.particles.len());
            return if self.rest.since_s(REST_DURATION_S).is_some() { Decision::Start } else { go_on };
        };
        self.record_motion(state, now_s);
        let known = self.numerics.stop.when_done && self.sliding.is_confirmed();
        let at_the_end = self.recorder.last(self.displacement).is_some_and(|slid_m| slid_m > SLIDING_M);
        if known || at_the_end { Decision::End(EndReason::Done) } else { go_on }
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(self.recorder.save(), &self.rest, &self.sliding, &self.start, &self.rolled_over))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let samples;
        (samples, self.rest, self.sliding, self.start, self.rolled_over) = saved.read()?;
        if self.recorder.restore(samples) { Ok(()) } else { Err(SavedFieldsError) }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let critical = self.sliding.onset_s().map(|t| t * self.slide.tilt_rate_deg_s);
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("critical_angle_deg", critical.into());
        add("friction_angle_deg", self.friction.atan().to_degrees().into());
        add("slid", critical.is_some().into());
        add("rolled_over", self.rolled_over.into());
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        responses
    }

    fn warnings(&self, reason: EndReason) -> Vec<Warning> {
        if reason == EndReason::FillNotAtRest {
            return vec![never_at_rest(self.numerics.max_fill_s)];
        }
        let tilt_deg = self.recorder.last(self.tilt).unwrap_or(0.0);
        let figures = format!("The fillet did not slide up to a tilt of {tilt_deg:.1}°.");
        let slid = self.sliding.onset_s().is_some();
        (!slid).then(|| TEST_NEVER_BEGAN.with(&figures)).into_iter().collect()
    }
}

//! The monitor of a bend: the bend angle, and whether the fillet comes to rest, falls off or tears.

use std::sync::Arc;

use glam::DVec3;
use serde_json::{Map, Value};

use super::{BEND_ANGLE, SINKING_M_S, TIP_DEFLECTION};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::placement::outside;
use crate::experiments::warnings::{TEST_NEVER_BEGAN, never_at_rest};
use crate::observe::{BendGauge, REST_DURATION_S, Recorder, RestDetector, SeriesId};
use crate::result::{EndReason, Warning};
use crate::scenario::{Bend, Numerics, Scenario, Support};
use crate::shape::lattice::{MetaParticle, connected_components};

/// A hanging fillet is at rest once it has been slow for this long, in seconds: a swing is slow where it turns.
const HANGS_FOR_S: f64 = 0.25;
/// The angle of a fillet that still swings is a mean over this long, in seconds.
const AVERAGED_S: f64 = 1.0;

/// The monitor of a bend.
#[derive(Debug)]
pub(super) struct BendMonitor {
    bend: Bend,
    numerics: Numerics,
    shape: Arc<MetaParticle>,
    gauge: BendGauge,
    /// Length beyond which a bond is broken, in metres.
    break_length_m: f64,
    /// The sub-particles of the last layer at the blunt end, and at the tail.
    blunt: Vec<usize>,
    tip: Vec<usize>,
    /// Height at which the tip starts, in metres.
    tip_start_m: f64,
    low_m: DVec3,
    high_m: DVec3,
    rest: RestDetector,
    fell_off: bool,
    torn: bool,
    recorder: Recorder,
    /// Sampled while the fillet was whole and on its support.
    angle: SeriesId,
    deflection: SeriesId,
    kinetic_energy: SeriesId,
    bonds_intact: SeriesId,
}

impl BendMonitor {
    pub(super) fn new(scenario: &Scenario, bend: &Bend, scene: &Scene) -> Self {
        let (body, shape) = (&scene.bodies[0], scene.kinds[0].meta.clone());
        let places = || shape.points.iter().map(|&point| body.position + body.orientation * point);
        // The outermost layer, seen along x or against it.
        let layer = |way: f64| -> Vec<usize> {
            let last = shape.points.iter().map(|point| way * point.x).fold(f64::NEG_INFINITY, f64::max);
            let outermost = |i: &usize| way * shape.points[*i].x > last - scene.radius_m;
            (0..shape.points.len()).filter(outermost).collect()
        };
        let (blunt, tip) = (layer(-1.0), layer(1.0));
        let mut recorder = Recorder::default();
        Self {
            break_length_m: f64::from(scene.laws.bond.break_length),
            bend: bend.clone(),
            numerics: scenario.numerics.clone(),
            tip_start_m: mean_height(&places().collect::<Vec<_>>(), &tip),
            blunt,
            tip,
            gauge: BendGauge::new(&shape.points),
            shape,
            low_m: scene.low,
            high_m: scene.high,
            rest: RestDetector::default(),
            fell_off: false,
            torn: false,
            angle: recorder.add_row(&BEND_ANGLE),
            deflection: recorder.add_row(&TIP_DEFLECTION),
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            recorder,
        }
    }

    fn record_rest(&mut self, state: &State, now_s: f64) {
        // A fillet that sinks with the table is not at rest.
        let moving = state.faster_than(self.numerics.rest_speed_m_s.min(SINKING_M_S / 2.0));
        self.rest.record(now_s, moving, state.particles.len());
    }

    /// Time since which it has been hanging still, in seconds; none on a conveyor that runs.
    fn hangs_since_s(&self) -> Option<f64> {
        let carried = self.bend.support == Support::OffLedge && self.bend.belt_speed_m_s > 0.0;
        self.rest.since_s(HANGS_FOR_S).filter(|_| !carried && !self.fell_off && !self.torn)
    }

    /// The samples since the fillet has been hanging still, or over the last second of its swings.
    fn last_samples(&self, series: SeriesId) -> &[f64] {
        let t_s = self.recorder.belt_s(series);
        let end_s = t_s.last().copied().unwrap_or(0.0);
        let from_s = self.hangs_since_s().unwrap_or(end_s - AVERAGED_S);
        &self.recorder.values(series)[t_s.partition_point(|&t| t < from_s)..]
    }

    /// Mean of the last samples.
    fn mean_at_end(&self, series: SeriesId) -> Option<f64> {
        let last = self.last_samples(series);
        (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64)
    }

    /// Half of the range of the last samples.
    fn swing(&self, series: SeriesId) -> Option<f64> {
        let last = || self.last_samples(series).iter().copied();
        Some((last().reduce(f64::max)? - last().reduce(f64::min)?) / 2.0)
    }

    /// Whether all of it is below the axis of its support.
    fn is_off(&self, state: &State) -> bool {
        let axis = -self.bend.bar_radius_m;
        let below = || (0..state.particles.len()).all(|i| state.position(i).z < axis);
        self.bend.support != Support::Clamped && below()
    }

    /// Whether no bonds lead from one end to the other any more.
    fn is_torn(&self, places: &[DVec3]) -> bool {
        let length = |i: u32, j: u32| places[i as usize].distance(places[j as usize]);
        let pairs = self.shape.bonds.iter().map(|bond| (bond.i, bond.j));
        let part =
            connected_components(places.len(), pairs.filter(|&(i, j)| length(i, j) <= self.break_length_m));
        self.tip.iter().all(|&tip| self.blunt.iter().all(|&blunt| part[tip] != part[blunt]))
    }

    fn record_shape(&mut self, state: &State) {
        self.fell_off = self.fell_off || self.is_off(state);
        let whole = state.particles.len() == self.shape.points.len();
        let places: Vec<DVec3> = (0..state.particles.len()).map(|i| state.position(i)).collect();
        self.torn = self.torn || !whole || (state.bonds_broken > 0 && self.is_torn(&places));
        if self.fell_off || self.torn {
            return;
        }
        if let Some(angle) = self.gauge.angle_deg(|i| places[i + 1] - places[i]) {
            self.recorder.record(self.angle, angle);
            self.recorder.record(self.deflection, self.tip_start_m - mean_height(&places, &self.tip));
        }
    }
}

/// Mean height of some of these places, in metres.
fn mean_height(places: &[DVec3], some: &[usize]) -> f64 {
    some.iter().map(|&i| places[i].z).sum::<f64>() / some.len() as f64
}

impl ExperimentMonitor for BendMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let state = sample.state;
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        let remove = outside(state, self.low_m, self.high_m);
        let Some(now_s) = sample.belt_time_s else {
            self.record_rest(state, sample.simulated_s);
            let lies = self.rest.since_s(REST_DURATION_S).is_some();
            if lies {
                // From now on it is to hang.
                self.rest = RestDetector::default();
                return Decision::Start;
            }
            return Decision::Continue { remove };
        };
        self.record_rest(state, now_s);
        self.record_shape(state);
        let known = self.numerics.stop.when_done && self.hangs_since_s().is_some();
        match known || self.fell_off || self.torn {
            true => Decision::End(EndReason::Done),
            false => Decision::Continue { remove },
        }
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(self.recorder.save(), &self.rest, &self.fell_off, &self.torn))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let samples;
        (samples, self.rest, self.fell_off, self.torn) = saved.read()?;
        if self.recorder.restore(samples) { Ok(()) } else { Err(SavedFieldsError) }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let largest = self.recorder.values(self.angle).iter().copied().reduce(f64::max);
        let clamped = self.bend.support == Support::Clamped;
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        let hangs = !self.fell_off && !self.torn;
        let angle = if hangs { self.mean_at_end(self.angle) } else { largest };
        add("bend_angle_deg", angle.into());
        add("bend_swing_deg", self.swing(self.angle).filter(|_| hangs).into());
        add("largest_bend_angle_deg", largest.into());
        add("tip_deflection_m", self.mean_at_end(self.deflection).filter(|_| clamped).into());
        add("fell_off", self.fell_off.into());
        add("torn", self.torn.into());
        add("time_to_rest_s", self.hangs_since_s().into());
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        responses
    }

    fn warnings(&self, reason: EndReason) -> Vec<Warning> {
        if reason == EndReason::FillNotAtRest {
            return vec![never_at_rest(self.numerics.max_fill_s)];
        }
        // A conveyor is to carry the fillet off.
        let fell = self.fell_off && self.bend.support != Support::OffLedge;
        let hung = !self.recorder.values(self.angle).is_empty() && !fell;
        let end_s = self.recorder.belt_s(self.angle).last().copied().unwrap_or(0.0);
        let figures = match (self.torn, self.fell_off) {
            (true, _) => format!("The fillet did not stay hanging: it tore after {end_s:.2} s."),
            (_, true) => {
                format!("The fillet did not stay hanging: it fell off its support after {end_s:.2} s.")
            }
            _ => "The run ended before a bend angle was measured.".to_owned(),
        };
        (!hung).then(|| TEST_NEVER_BEGAN.with(&figures)).into_iter().collect()
    }
}

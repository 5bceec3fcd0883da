//! Watching a fillet bend: how far, whether it comes to rest, falls off or tears.

use std::sync::Arc;

use glam::DVec3;
use serde_json::{Map, Value};

use super::bend::SINKING_M_S;
use super::{Watch, strayed};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::observe::{BendGauge, REST_DURATION_S, RestDetector};
use crate::result::{EndReason, Series};
use crate::scenario::{Bend, Numerics, Scenario, Support};
use crate::shape::lattice::{MetaParticle, connected_components};

/// What swings is slow where it turns; what hangs is at rest once it has been slow for this long, in seconds.
const HANGS_FOR_S: f64 = 0.25;
/// How what still swings hangs is averaged over this long, some of its swings, in seconds.
const AVERAGED_S: f64 = 1.0;

/// The director of a fillet that bends.
#[derive(Debug)]
pub(super) struct BendWatch {
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
    /// Simulated time at t = 0.
    start_s: f64,
    /// Simulated times of all samples.
    simulated_s: Vec<f64>,
    kinetic_energy_j: Vec<f64>,
    bonds_intact: Vec<f64>,
    /// Belt times at which the fillet was whole and on its support, its bend angle and how low its tip hung.
    t_s: Vec<f64>,
    angle_deg: Vec<f64>,
    deflection_m: Vec<f64>,
}

impl BendWatch {
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
            start_s: 0.0,
            simulated_s: Vec::new(),
            kinetic_energy_j: Vec::new(),
            bonds_intact: Vec::new(),
            t_s: Vec::new(),
            angle_deg: Vec::new(),
            deflection_m: Vec::new(),
        }
    }

    fn note_rest(&mut self, state: &State, now_s: f64) {
        // What goes down with the table does not rest.
        let moving = state.faster_than(self.numerics.rest_speed_m_s.min(SINKING_M_S / 2.0));
        self.rest.record(now_s, moving, state.particles.len());
    }

    /// Since when it has been hanging still, in seconds. What a conveyor carries is not to come to rest.
    fn hangs_since_s(&self) -> Option<f64> {
        let carried = self.bend.support == Support::OffLedge && self.bend.belt_speed_m_s > 0.0;
        self.rest.since_s(HANGS_FOR_S).filter(|_| !carried && !self.fell_off && !self.torn)
    }

    /// What was sampled since the fillet has been hanging still, or over the last second of its swings.
    fn last<'a>(&self, values: &'a [f64]) -> &'a [f64] {
        let end_s = self.t_s.last().copied().unwrap_or(0.0);
        let from_s = self.hangs_since_s().unwrap_or(end_s - AVERAGED_S);
        &values[self.t_s.partition_point(|&t| t < from_s)..]
    }

    /// Mean of what was sampled last.
    fn at_the_end(&self, values: &[f64]) -> Option<f64> {
        let last = self.last(values);
        (!last.is_empty()).then(|| last.iter().sum::<f64>() / last.len() as f64)
    }

    /// Half of the range of what was sampled last.
    fn swing(&self, values: &[f64]) -> Option<f64> {
        let last = || self.last(values).iter().copied();
        Some((last().reduce(f64::max)? - last().reduce(f64::min)?) / 2.0)
    }

    /// Whether all of it is below the axis of what it lay on.
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

    fn take_in(&mut self, state: &State, now_s: f64) {
        self.fell_off = self.fell_off || self.is_off(state);
        let whole = state.particles.len() == self.shape.points.len();
        let places: Vec<DVec3> = (0..state.particles.len()).map(|i| state.position(i)).collect();
        self.torn = self.torn || !whole || (state.bonds_broken > 0 && self.is_torn(&places));
        if self.fell_off || self.torn {
            return;
        }
        if let Some(angle) = self.gauge.angle_deg(|i| places[i + 1] - places[i]) {
            self.t_s.push(now_s);
            self.angle_deg.push(angle);
            self.deflection_m.push(self.tip_start_m - mean_height(&places, &self.tip));
        }
    }
}

/// Mean height of some of these places, in metres.
fn mean_height(places: &[DVec3], some: &[usize]) -> f64 {
    some.iter().map(|&i| places[i].z).sum::<f64>() / some.len() as f64
}

impl ExperimentMonitor for BendWatch {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let state = sample.state;
        // The sample at the start is looked at twice.
        if self.simulated_s.last() != Some(&sample.simulated_s) {
            self.simulated_s.push(sample.simulated_s);
            self.kinetic_energy_j.push(state.kinetic_energy());
            self.bonds_intact.push(state.bonds_intact_fraction());
        }
        let remove = strayed(state, self.low_m, self.high_m);
        let Some(now_s) = sample.belt_time_s else {
            self.note_rest(state, sample.simulated_s);
            // As long as it has not rested, its times end at 0.
            self.start_s = sample.simulated_s;
            let lies = self.rest.since_s(REST_DURATION_S).is_some();
            if lies {
                // From now on it is to hang.
                self.rest = RestDetector::default();
                return Decision::Start;
            }
            return Decision::Continue { remove };
        };
        self.note_rest(state, now_s);
        self.take_in(state, now_s);
        let known = self.numerics.stop.when_done && self.hangs_since_s().is_some();
        match known || self.fell_off || self.torn {
            true => Decision::End(EndReason::Done),
            false => Decision::Continue { remove },
        }
    }

    fn discharged_kg(&self) -> f64 {
        0.0
    }
}

impl Watch for BendWatch {
    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let largest = self.angle_deg.iter().copied().reduce(f64::max);
        let clamped = self.bend.support == Support::Clamped;
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        let hangs = !self.fell_off && !self.torn;
        let angle = if hangs { self.at_the_end(&self.angle_deg) } else { largest };
        add("bend_angle_deg", angle.into());
        add("bend_swing_deg", self.swing(&self.angle_deg).filter(|_| hangs).into());
        add("largest_bend_angle_deg", largest.into());
        add("tip_deflection_m", self.at_the_end(&self.deflection_m).filter(|_| clamped).into());
        add("fell_off", self.fell_off.into());
        add("torn", self.torn.into());
        add("time_to_rest_s", self.hangs_since_s().into());
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
            series("bend_angle", "°", &self.t_s, &self.angle_deg),
            series("tip_deflection", "m", &self.t_s, &self.deflection_m),
            series("kinetic_energy", "J", &all, &self.kinetic_energy_j),
            series("bonds_intact_fraction", "1", &all, &self.bonds_intact),
        ]
    }
}

//! Power of the belt, force on the gate, and the series of loads on request.

use std::ops::RangeInclusive;

use serde_json::{Map, Value};

use super::BELT_POWER;
use crate::engine::run::Sample;
use crate::engine::scene::Scene;
use crate::equipment::Motion;
use crate::experiments::loads::{LoadSeries, SampleStats, power_w};
use crate::observe::{Recorder, SeriesId};
use crate::scenario::Equipment;

/// Name of the surface whose force is a response.
const GATE: &str = "gate";

/// Loads on the surfaces of a hopper.
#[derive(Debug)]
pub(super) struct LoadMonitor {
    belt_power: SeriesId,
    loads: Option<LoadSeries>,
    /// Belts by their number among the surfaces.
    belts: Vec<(usize, Motion)>,
    gate: Option<usize>,
    /// Belt time in seconds, power in W and force on the gate in N of each sample.
    pub(super) samples: Vec<[f64; 3]>,
    pub(super) passed_through: u64,
}

impl LoadMonitor {
    pub(super) fn new(equipment: &Equipment, scene: &Scene, recorder: &mut Recorder) -> Self {
        let surfaces = || scene.surfaces.iter().enumerate();
        let belts = surfaces().filter(|(_, surface)| matches!(surface.motion, Motion::Belt { .. }));
        Self {
            belt_power: recorder.add_row(&BELT_POWER),
            loads: equipment.surface_loads.then(|| LoadSeries::new(&scene.surfaces, recorder)),
            belts: belts.map(|(k, surface)| (k, surface.motion)).collect(),
            gate: surfaces().find(|(_, surface)| surface.name == GATE).map(|(k, _)| k),
            samples: Vec::new(),
            passed_through: 0,
        }
    }

    /// Records the loads at belt time `now_s` in seconds.
    pub(super) fn record(&mut self, sample: &Sample<'_>, now_s: f64, recorder: &mut Recorder) {
        let of_surface = |k: usize| sample.surface_loads.get(k).copied().unwrap_or_default();
        let of_belt = |(k, motion): &(usize, Motion)| power_w(motion, &of_surface(*k), now_s);
        // `sum` would return -0 without belts.
        let belt_power_w = self.belts.iter().map(of_belt).fold(0.0, |sum, one| sum + one);
        recorder.record(self.belt_power, belt_power_w);
        let gate_n = self.gate.map_or(0.0, |gate| of_surface(gate).force.length());
        self.samples.push([now_s, belt_power_w, gate_n]);
        if let Some(loads) = &self.loads {
            loads.record(sample.surface_loads, now_s, recorder);
        }
    }

    /// Adds the responses; means are taken over these belt times in seconds.
    pub(super) fn add_responses(&self, times_s: RangeInclusive<f64>, responses: &mut Map<String, Value>) {
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        let always = f64::NEG_INFINITY..=f64::INFINITY;
        let stats = |column: usize, times_s: &RangeInclusive<f64>| {
            let mut stats = SampleStats::default();
            let samples = self.samples.iter().filter(|sample| times_s.contains(&sample[0]));
            samples.for_each(|sample| stats.add(sample[column]));
            stats
        };
        // At t = 0 the gate has only just opened, and bears nothing yet.
        let opened = |times_s: &RangeInclusive<f64>| times_s.start().max(f64::MIN_POSITIVE)..=*times_s.end();
        let gate = |value: Option<f64>| self.gate.and(value);
        add("passed_through", self.passed_through.into());
        add("mean_belt_power_w", stats(1, &times_s).mean().into());
        add("max_belt_power_w", stats(1, &always).max().into());
        add("mean_gate_force_n", gate(stats(2, &opened(&times_s)).mean()).into());
        add("max_gate_force_n", gate(stats(2, &opened(&always)).max()).into());
    }
}

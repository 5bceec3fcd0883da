//! The monitor of a compression test: stress, strain by the plates and by the extensometer.

use glam::DVec3;
use serde_json::{Map, Value};

use super::{LOWER_PLATE_FORCE, STRESS, STRESS_LATTICE, UPPER_PLATE_FORCE};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::experiments::CurveRow;
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::placement::outside;
use crate::experiments::warnings::TEST_NEVER_BEGAN;
use crate::observe::{Compression, CompressionSample, Recorder, SeriesId, StressStrain, modulus_pa};
use crate::result::{Curve, EndReason, Warning};
use crate::scenario::{Compress, Numerics, Scenario};

/// The monitor of a compression test.
#[derive(Debug)]
pub(super) struct CompressMonitor {
    compress: Compress,
    numerics: Numerics,
    size_m: DVec3,
    speed_m_s: f64,
    low_m: DVec3,
    high_m: DVec3,
    compression: Compression,
    recorder: Recorder,
    lower_plate: SeriesId,
    upper_plate: SeriesId,
    kinetic_energy: SeriesId,
    bonds_intact: SeriesId,
}

impl CompressMonitor {
    pub(super) fn new(scenario: &Scenario, compress: &Compress, scene: &Scene) -> Self {
        let size_m = compress.size_m(scene.radius_m);
        let mut recorder = Recorder::default();
        Self {
            compress: compress.clone(),
            numerics: scenario.numerics.clone(),
            size_m,
            speed_m_s: compress.speed_m_s(size_m),
            low_m: scene.low,
            high_m: scene.high,
            compression: Compression::default(),
            lower_plate: recorder.add_row(&LOWER_PLATE_FORCE),
            upper_plate: recorder.add_row(&UPPER_PLATE_FORCE),
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            recorder,
        }
    }

    /// Distance of the centres of the outermost layers, in metres. Sub-particles are numbered layer by layer.
    fn gauge_m(&self, state: &State) -> f64 {
        let layer = (self.compress.lattice[0] * self.compress.lattice[1]) as usize;
        let height = |range: std::ops::Range<usize>| range.map(|i| state.position(i).z).sum::<f64>();
        let count = state.particles.len();
        (height(count - layer..count) - height(0..layer)) / layer as f64
    }

    /// Maximum difference of the forces on the plates under load, over the maximum force: small when the test was slow
    /// enough.
    fn plate_imbalance(&self) -> Option<f64> {
        let forces = |series| self.recorder.values(series).iter().copied();
        let both = || forces(self.lower_plate).zip(forces(self.upper_plate));
        let pressed = || both().filter(|(lower, upper)| lower + upper > 0.0);
        let most = pressed().map(|(lower, upper)| lower.max(upper)).reduce(f64::max)?;
        let apart = pressed().map(|(lower, upper)| (lower - upper).abs()).fold(0.0, f64::max);
        Some(apart / most)
    }

    fn modulus_pa(&self, strain: fn(&StressStrain) -> f64) -> Option<f64> {
        let points = self.compression.curve().into_iter().map(|point| (strain(&point), point.stress_pa));
        modulus_pa(points, self.compress.modulus_from_strain, self.compress.modulus_to_strain)
    }
}

impl ExperimentMonitor for CompressMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        let state = sample.state;
        if !outside(state, self.low_m, self.high_m).is_empty() {
            // The block has burst, or fallen from between the plates.
            return Decision::End(EndReason::Done);
        }
        let plates_n = [-sample.surface_loads[0].force.z, sample.surface_loads[1].force.z];
        self.compression.record(CompressionSample {
            stress_pa: (plates_n[0] + plates_n[1]) / 2.0 / (self.size_m.x * self.size_m.y),
            height_m: self.size_m.z - self.speed_m_s * now_s,
            gauge_m: self.gauge_m(state),
        });
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.lower_plate, plates_n[0]);
        self.recorder.record(self.upper_plate, plates_n[1]);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        let compressed = self.compression.strain().is_some_and(|strain| strain >= self.compress.max_strain);
        match self.numerics.stop.when_done && compressed {
            true => Decision::End(EndReason::Done),
            false => Decision::Continue { remove: Vec::new() },
        }
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(self.recorder.save(), &self.compression))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let samples;
        (samples, self.compression) = saved.read()?;
        if self.recorder.restore(samples) && self.compression.is_consistent() {
            Ok(())
        } else {
            Err(SavedFieldsError)
        }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let end = self.compression.curve().pop();
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("modulus_pa", self.modulus_pa(|point| point.strain).into());
        add("modulus_lattice_pa", self.modulus_pa(|point| point.gauge_strain).into());
        add("stress_at_end_pa", end.map(|point| point.stress_pa).into());
        add("largest_strain", end.map(|point| point.strain).into());
        add("plate_imbalance_fraction", self.plate_imbalance().into());
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        responses
    }

    fn warnings(&self, _reason: EndReason) -> Vec<Warning> {
        let pressed = self.recorder.values(self.upper_plate).iter().any(|force| *force > 0.0);
        let end_s = self.recorder.belt_s(self.upper_plate).last().copied().unwrap_or(0.0);
        let figures = format!("The upper plate never pressed the block until the end at {end_s:.3} s.");
        (!pressed).then(|| TEST_NEVER_BEGAN.with(&figures)).into_iter().collect()
    }

    fn curves(&self) -> Vec<Curve> {
        let points = self.compression.curve();
        let curve = |row: &CurveRow, strain: fn(&StressStrain) -> f64| {
            row.curve(
                points.iter().map(strain).collect(),
                points.iter().map(|point| point.stress_pa).collect(),
            )
        };
        vec![curve(&STRESS, |point| point.strain), curve(&STRESS_LATTICE, |point| point.gauge_strain)]
    }
}

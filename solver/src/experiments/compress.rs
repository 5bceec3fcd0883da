//! A block of tissue between two plates (paper sections 2.3.2 and 3.1, Fig. 6): stress over strain, and Young's modulus.
//!
//! A block of the lattice stands on a fixed plate; from t = 0 on a second one comes down on it, at the strain rate times the block's
//! height. The stress is the mean of the forces on both plates over the block's cross-section, each sub-particle taking (2R)² of it.
//! Strain is measured twice: by the plates, as in the paper, and by an extensometer between the centres of the outermost layers,
//! which leaves out how the plates press into them.
//!
//! Expected: by the extensometer S_n π R/2 with the contact between bonded neighbours off (6.28 kPa at Table 2), 8 to 10 kPa with
//! it. The paper's 48.6 kPa are that of its sub-particles; its lattice cannot reach them, nor the stiffening to 4 kPa.

use glam::DVec3;
use serde_json::{Map, Value, json};

use super::{Prepared, Watch, bounds_on_timestep, kinds, laws, plan, strayed, timestep_s};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::observe::{Compression, CompressionSample, StressStrain, modulus_pa};
use crate::result::{Curve, EndReason, Series};
use crate::scenario::{Compress, Fault, Numerics, Plates, Scenario};
use crate::shape::{MAX_LATTICE_CELLS, ShapeError};

/// Strain that the plates may take up before they press: adhesion shrinks a block by up to about 1 %.
const TAKE_UP_STRAIN: f64 = 0.03;
/// Plates reach this far beyond the block, as a share of its width.
const PLATE_RIM: f64 = 0.5;
/// Room around everything, in metres.
const MARGIN_M: f64 = 0.1;

/// How long a compression test may take, in seconds.
pub(super) fn duration_s(compress: &Compress) -> f64 {
    (compress.max_strain + TAKE_UP_STRAIN) / compress.strain_rate_1_s
}

/// The experiment of a compression test.
pub(super) fn prepare(scenario: &Scenario, compress: &Compress, meshes: &Meshes) -> Prepared {
    let kinds = kinds(scenario, meshes);
    let radius_m = scenario.product.radius_m();
    let size = DVec3::from(compress.lattice.map(f64::from)) * 2.0 * radius_m;
    let half = size / 2.0 + PLATE_RIM * size.truncate().max_element();
    let kind = match compress.plates {
        Plates::Rough => SurfaceKind::Equipment,
        Plates::Frictionless => SurfaceKind::Frictionless,
    };
    let plate = |name: &str, z: f64| {
        let (u, v) = (DVec3::X * 2.0 * half.x, DVec3::Y * 2.0 * half.y);
        Surface::parallelogram(name, kind, DVec3::new(-half.x, -half.y, z), u, v)
    };
    let speed_m_s = compress.strain_rate_1_s * size.z;
    let down =
        Motion::Moving { velocity: DVec3::NEG_Z * speed_m_s, pivot: DVec3::Z * size.z, spin: DVec3::ZERO };
    let body = Placement {
        kind: 0,
        position: DVec3::Z * size.z / 2.0,
        orientation: glam::DQuat::IDENTITY,
        velocity: DVec3::ZERO,
    };
    let room = half.with_z(size.z) + MARGIN_M;
    let scene = Scene {
        radius_m,
        surfaces: vec![plate("lower plate", 0.0), plate("upper plate", size.z).moving(down)],
        laws: laws::laws(scenario),
        gravity: DVec3::NEG_Z * scenario.numerics.gravity_m_s2,
        low: -room,
        high: room,
        periodic_y: false,
        timestep_s: timestep_s(scenario, &bounds_on_timestep(scenario, &kinds)),
        speed_limit_m_s: scenario.numerics.speed_limit_m_s,
        kinds,
        bodies: vec![body],
        held: Vec::new(),
    };
    let watch = Box::new(CompressWatch::new(scenario, compress, &scene, size, speed_m_s));
    Prepared { plan: plan(scenario), watch, scene }
}

/// A block that nobody would wait for.
pub(crate) fn lattice_fault(compress: &Compress, error: &ShapeError) -> Fault {
    let allowed =
        format!("at most {MAX_LATTICE_CELLS:.0e} sub-particles, with a layer to spare on every side");
    Fault::new("/compress/lattice", &json!(compress.lattice), error.to_string(), Some(allowed))
}

/// The compression test's director.
#[derive(Debug)]
struct CompressWatch {
    compress: Compress,
    numerics: Numerics,
    size_m: DVec3,
    speed_m_s: f64,
    low_m: DVec3,
    high_m: DVec3,
    compression: Compression,
    t_s: Vec<f64>,
    /// Forces that the block presses on the lower and the upper plate with, in newton.
    plates_n: Vec<[f64; 2]>,
    kinetic_energy_j: Vec<f64>,
    bonds_intact: Vec<f64>,
}

impl CompressWatch {
    fn new(scenario: &Scenario, compress: &Compress, scene: &Scene, size_m: DVec3, speed_m_s: f64) -> Self {
        Self {
            compress: compress.clone(),
            numerics: scenario.numerics.clone(),
            size_m,
            speed_m_s,
            low_m: scene.low,
            high_m: scene.high,
            compression: Compression::default(),
            t_s: Vec::new(),
            plates_n: Vec::new(),
            kinetic_energy_j: Vec::new(),
            bonds_intact: Vec::new(),
        }
    }

    /// Distance of the centres of the outermost layers, in metres. Sub-particles are numbered layer by layer.
    fn gauge_m(&self, state: &State) -> f64 {
        let layer = (self.compress.lattice[0] * self.compress.lattice[1]) as usize;
        let height = |range: std::ops::Range<usize>| range.map(|i| state.position(i).z).sum::<f64>();
        let count = state.particles.len();
        (height(count - layer..count) - height(0..layer)) / layer as f64
    }

    /// The greatest difference of the forces on the plates under load, over the greatest force: whether the test was slow
    /// enough.
    fn plate_imbalance(&self) -> Option<f64> {
        let pressed = || self.plates_n.iter().filter(|[lower, upper]| lower + upper > 0.0);
        let most = pressed().map(|[lower, upper]| lower.max(*upper)).reduce(f64::max)?;
        let apart = pressed().map(|[lower, upper]| (lower - upper).abs()).fold(0.0, f64::max);
        Some(apart / most)
    }

    fn modulus_pa(&self, strain: fn(&StressStrain) -> f64) -> Option<f64> {
        let points = self.compression.curve().into_iter().map(|point| (strain(&point), point.stress_pa));
        modulus_pa(points, self.compress.modulus_from_strain, self.compress.modulus_to_strain)
    }
}

impl ExperimentMonitor for CompressWatch {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        let state = sample.state;
        if !strayed(state, self.low_m, self.high_m).is_empty() {
            // What has burst or fallen from between the plates is no block any more.
            return Decision::End(EndReason::Done);
        }
        let plates_n = [-sample.surface_forces[0].z, sample.surface_forces[1].z];
        self.compression.record(CompressionSample {
            stress_pa: (plates_n[0] + plates_n[1]) / 2.0 / (self.size_m.x * self.size_m.y),
            height_m: self.size_m.z - self.speed_m_s * now_s,
            gauge_m: self.gauge_m(state),
        });
        self.t_s.push(now_s);
        self.plates_n.push(plates_n);
        self.kinetic_energy_j.push(state.kinetic_energy());
        self.bonds_intact.push(state.bonds_intact_fraction());
        let compressed = self.compression.strain().is_some_and(|strain| strain >= self.compress.max_strain);
        match self.numerics.stop.when_done && compressed {
            true => Decision::End(EndReason::Done),
            false => Decision::Continue { remove: Vec::new() },
        }
    }

    fn discharged_kg(&self) -> f64 {
        0.0
    }
}

impl Watch for CompressWatch {
    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let end = self.compression.curve().pop();
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("modulus_pa", self.modulus_pa(|point| point.strain).into());
        add("modulus_lattice_pa", self.modulus_pa(|point| point.gauge_strain).into());
        add("stress_at_end_pa", end.map(|point| point.stress_pa).into());
        add("largest_strain", end.map(|point| point.strain).into());
        add("plate_imbalance_fraction", self.plate_imbalance().into());
        add("bonds_intact_fraction", self.bonds_intact.last().copied().into());
        responses
    }

    fn series(&self) -> Vec<Series> {
        let series = |name: &str, unit: &str, values: Vec<f64>| Series {
            name: name.into(),
            unit: unit.into(),
            t_s: self.t_s.clone(),
            values,
        };
        let plate = |k: usize| self.plates_n.iter().map(|forces| forces[k]).collect();
        vec![
            series("lower_plate_force", "N", plate(0)),
            series("upper_plate_force", "N", plate(1)),
            series("kinetic_energy", "J", self.kinetic_energy_j.clone()),
            series("bonds_intact_fraction", "1", self.bonds_intact.clone()),
        ]
    }

    fn curves(&self) -> Vec<Curve> {
        let points = self.compression.curve();
        let curve = |name: &str, over: &str, strain: fn(&StressStrain) -> f64| Curve {
            name: name.into(),
            unit: "Pa".into(),
            over: over.into(),
            over_unit: "1".into(),
            x: points.iter().map(strain).collect(),
            values: points.iter().map(|point| point.stress_pa).collect(),
        };
        vec![
            curve("stress", "strain", |point| point.strain),
            curve("stress_lattice", "strain_lattice", |point| point.gauge_strain),
        ]
    }
}

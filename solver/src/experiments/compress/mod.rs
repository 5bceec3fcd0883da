//! A block of tissue between two plates (paper sections 2.3.2 and 3.1, Fig. 6): stress over strain, and Young's modulus.
//!
//! A block of the lattice stands on a fixed plate; from t = 0 on a second one comes down on it, at the strain rate times the block's
//! height. The stress is the mean of the forces on both plates over the block's cross-section, each sub-particle taking (2R)² of it.
//! Strain is measured twice: by the plates, as in the paper, and by an extensometer between the centres of the outermost layers,
//! which leaves out how the plates press into them.
//!
//! Expected: by the extensometer S_n π R/2 with the contact between bonded neighbours off (6.28 kPa at Table 2), 8 to 10 kPa with
//! it. The paper's 48.6 kPa are that of its sub-particles; its lattice cannot reach them, nor the stiffening to 4 kPa.

mod monitor;

use glam::{DQuat, DVec3};
use serde_json::{Value, json};

use super::bodies::body_kind;
use super::outputs::{BONDS_INTACT, BONDS_INTACT_FRACTION, KINETIC_ENERGY, curve, number, series};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{CurveRow, Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::scenario::{Compress, Fault, Numerics, Plates, Product, Scenario};
use crate::shape::lattice::max_bond_class;
use crate::shape::{MAX_LATTICE_CELLS, from_block};

/// Strain that the plates may take up before they press: adhesion shrinks a block by up to about 1 %.
const TAKE_UP_STRAIN: f64 = 0.03;
/// Plates reach this far beyond the block, as a share of its width.
const PLATE_RIM: f64 = 0.5;
/// Margin of the domain around everything, in metres.
const MARGIN_M: f64 = 0.1;

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    number("modulus_pa", "Pa",
        "Elastic modulus of the block: the slope of a straight line through the curve of stress over strain. The line covers the strains \
         from `modulus_from_strain` to `modulus_to_strain`. The strain comes from the distance between the plates. Null if fewer than \
         three samples are in this strain range.").headline(),
    number("modulus_lattice_pa", "Pa",
        "Elastic modulus as in `modulus_pa`, but with another strain. This strain comes from the distance between the centres of the \
         lowest and the highest layer of the block. In a laboratory, an extensometer measures such a strain. Null for a block of one \
         layer.").headline(),
    number("stress_at_end_pa", "Pa", "Stress at the end of the simulation."),
    number("largest_strain", "",
        "Strain at the end of the simulation. The strain comes from the distance between the plates."),
    number("plate_imbalance_fraction", "",
        "Maximum difference between the forces on the two plates, divided by the maximum force on a plate. This ratio is small if the \
         compression was slow enough."),
    BONDS_INTACT_FRACTION,
    WARNING_COUNT,
    WARNING_CODES,
];

#[rustfmt::skip]
const LOWER_PLATE_FORCE: SeriesRow = series("lower_plate_force", "N",
    "Force of the block on the lower plate. The force is negative when the block pulls the plate.");
const UPPER_PLATE_FORCE: SeriesRow = series(
    "upper_plate_force",
    "N",
    "Force of the block on the upper plate. The force is negative when the block pulls the plate.",
);
const STRESS: CurveRow = curve(
    "stress",
    "Pa",
    ("strain", "1"),
    "Stress over strain. The strain comes from the distance between the plates.",
)
.headline();
const STRESS_LATTICE: CurveRow = curve(
    "stress_lattice",
    "Pa",
    ("strain_lattice", "1"),
    "Stress over strain. The strain comes from the distance between the centres of the lowest and the highest layer of the block.",
);

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[LOWER_PLATE_FORCE, UPPER_PLATE_FORCE, KINETIC_ENERGY.headline(), BONDS_INTACT],
    curves: &[STRESS, STRESS_LATTICE],
};

impl Definition for Compress {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn kinds(&self, scenario: &Scenario, _meshes: &Meshes) -> Result<Vec<BodyKind>, Vec<Fault>> {
        let (product, bonds) = (&scenario.product, &scenario.bonds);
        let reach = max_bond_class(bonds.types, bonds.contact_radius_ratio);
        let block = from_block(self.lattice, product.radius_m(), reach).map_err(|error| {
            let allowed =
                format!("at most {MAX_LATTICE_CELLS:.0e} sub-particles, with a layer to spare on every side");
            vec![Fault::at("/compress/lattice", json!(self.lattice), error.to_string(), allowed)]
        })?;
        Ok(vec![body_kind(product, block)])
    }

    fn scene(&self, setup: &Setup) -> Scene {
        let size = self.size_m(setup.scenario.product.radius_m());
        let half = size / 2.0 + PLATE_RIM * size.truncate().max_element();
        let kind = match self.plates {
            Plates::Rough => SurfaceKind::Equipment,
            Plates::Frictionless => SurfaceKind::Frictionless,
        };
        let plate = |name: &str, z: f64| {
            let (u, v) = (DVec3::X * 2.0 * half.x, DVec3::Y * 2.0 * half.y);
            Surface::parallelogram(name, kind, DVec3::new(-half.x, -half.y, z), u, v)
        };
        let velocity = DVec3::NEG_Z * self.speed_m_s(size);
        let down = Motion::Moving { velocity, pivot: DVec3::Z * size.z, spin: DVec3::ZERO };
        let body = Placement {
            kind: 0,
            position: DVec3::Z * size.z / 2.0,
            orientation: DQuat::IDENTITY,
            velocity: DVec3::ZERO,
        };
        let domain = half.with_z(size.z) + MARGIN_M;
        Scene {
            surfaces: vec![plate("lower plate", 0.0), plate("upper plate", size.z).moving(down)],
            low: -domain,
            high: domain,
            bodies: vec![body],
            ..setup.empty_scene()
        }
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        Box::new(monitor::CompressMonitor::new(scenario, self, scene))
    }

    fn duration_s(&self, _numerics: &Numerics) -> f64 {
        (self.max_strain + TAKE_UP_STRAIN) / self.strain_rate_1_s
    }

    fn size_field(&self, _scenario: &Scenario, _bodies: u64) -> (&'static str, Value) {
        ("/compress/lattice", json!(self.lattice))
    }

    fn duration_field(&self, _numerics: &Numerics) -> (&'static str, f64) {
        ("/compress/strain_rate_1_s", self.strain_rate_1_s)
    }

    fn lattice_points(&self, _product: &Product) -> f64 {
        self.lattice.map(f64::from).iter().product()
    }
}

impl Compress {
    /// Sides of the block, in metres.
    fn size_m(&self, radius_m: f64) -> DVec3 {
        DVec3::from(self.lattice.map(f64::from)) * 2.0 * radius_m
    }

    /// Speed of the upper plate, in m/s.
    fn speed_m_s(&self, size_m: DVec3) -> f64 {
        self.strain_rate_1_s * size_m.z
    }
}

//! Bodies and surfaces, freely placed: fillets on any piece of equipment.
//!
//! The run begins at t = 0 with everything as placed; surfaces move from there on. A sub-particle that goes farther than the margin
//! beyond everything at the start leaves, and is counted as escaped. The monitor observes rest, bonds, and the force on each surface.

mod checks;
mod monitor;

use glam::DVec3;
use serde_json::Value;

use super::loads::LOADS;
use super::outputs::{
    BONDS_INTACT, BONDS_INTACT_FRACTION, ESCAPED_KG, KINETIC_ENERGY, KINETIC_ENERGY_END_J, MAX_OVERLAP_RATIO,
    PASSED_THROUGH, curve, number, series,
};
use super::placement::orientation;
use super::surfaces::{extent, surfaces};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{CurveRow, Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::scenario::{Fault, FreeScene, Scenario};

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    number("time_to_rest_s", "s",
        "Time at which all bodies came to rest. From this time to the end, 99.9 % of the sub-particles are slower than `rest_speed_m_s`. \
         This state must last for at least 0.1 s, or for longer if gravity is weak. Null if the bodies did not come to rest.").headline(),
    number("greatest_height_m", "m",
        "Height of the top of the highest sub-particle at the end. Roost measures this height from the origin of the coordinates, \
         against the direction of gravity. Null if no sub-particle is left.").headline(),
    number("interpenetrated_fraction", "",
        "Share of the sub-particles that lie inside another body at the end. The lattice of a body consists of cubic cells with a \
         sub-particle at each corner. A sub-particle lies inside a body if its centre is in one of these cells. Null if no sub-particle \
         is left."),
    number("bodies", "",
        "Number of bodies at the end. A body counts if at least a part of the body is left."),
    BONDS_INTACT_FRACTION,
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
    PASSED_THROUGH,
    number("max_surface_force_n", "N",
        "Maximum force on a single surface: the maximum over all surfaces and all samples. Null if the scene has no surfaces."),
    number("max_surface_torque_n_m", "N·m",
        "Maximum torque on a single surface: the maximum over all surfaces and all samples. Null if the scene has no surfaces."),
    number("mean_power_w", "W", "Mean of the series `power`."),
    number("max_power_w", "W", "Maximum of the series `power`."),
    WARNING_COUNT,
    WARNING_CODES,
];

const MASS: SeriesRow = series("mass", "kg", "Mass of all sub-particles that have not left the simulation.");
#[rustfmt::skip]
const POWER: SeriesRow = series("power", "W",
    "Power of all belts and moving surfaces together, at the time of the sample: the work per second that these surfaces do on the \
     bodies. For a belt, the power is the friction force times the belt speed.");

const OVER: (&str, &str) = ("body", "1");
#[rustfmt::skip]
const POSITIONS: [CurveRow; 3] = [
    curve("position_x", "m", OVER,
        "Position along x of each body's centre of mass at the end. The numbers of the bodies start at 0. The curve omits bodies that \
         left the simulation.").per_body(),
    curve("position_y", "m", OVER, "Position along y of each body's centre of mass at the end.").per_body(),
    curve("position_z", "m", OVER, "Position along z of each body's centre of mass at the end.").per_body(),
];

#[rustfmt::skip]
pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[
        KINETIC_ENERGY.headline(),
        BONDS_INTACT.headline(),
        MASS,
        POWER,
        LOADS[0],
        LOADS[1],
        LOADS[2],
        LOADS[3],
        LOADS[4],
        LOADS[5],
    ],
    curves: &POSITIONS,
};

impl Definition for FreeScene {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn kind_of_each(&self, _scenario: &Scenario, _kinds: &[BodyKind]) -> Vec<usize> {
        self.bodies.iter().map(|body| body.shape as usize).collect()
    }

    fn scene(&self, setup: &Setup) -> Scene {
        let (kinds, radius_m) = (&setup.kinds, setup.scenario.product.radius_m());
        let placed = setup.kind_of_each().into_iter().zip(&self.bodies);
        let bodies: Vec<Placement> = placed
            .map(|(kind, body)| Placement {
                kind,
                position: body.position_m.into(),
                orientation: orientation(body.orientation_deg),
                velocity: body.velocity_m_s.into(),
            })
            .collect();
        let surfaces = surfaces(&self.surfaces, &setup.meshes);
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
        Scene {
            surfaces,
            gravity: self.down() * setup.scenario.numerics.gravity_m_s2,
            low: low - self.margin_m,
            high: high + self.margin_m,
            bodies,
            ..setup.empty_scene()
        }
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        Box::new(monitor::SceneMonitor::new(scenario, self, scene))
    }

    fn start_speed_m_s(&self) -> f64 {
        let speeds = self.bodies.iter().map(|body| DVec3::from(body.velocity_m_s).length());
        speeds.fold(0.0, f64::max)
    }

    fn size_field(&self, _scenario: &Scenario, bodies: u64) -> (&'static str, Value) {
        ("/scene/bodies", bodies.into())
    }

    fn start_faults(&self, setup: &Setup) -> Vec<Fault> {
        checks::faults(setup, self)
    }
}

impl FreeScene {
    /// Direction of gravity, of length 1.
    fn down(&self) -> DVec3 {
        DVec3::from(self.gravity_direction).normalize_or_zero()
    }
}

//! Fillets that hit a plate, each by itself (paper sections 2.3.3 and 3.3, Fig. 9 to 12): the share of bonds that hold, and
//! the time until 99 % of the kinetic energy are lost.
//!
//! Each fillet starts just above a plate of its own and moves down at the speed of the impact. The plates lie so far apart
//! that nothing gets from one to another. A part that leaves the space over its plate leaves the simulation, counted as
//! escaped and not as broken. Expected at Table 2: 99 % intact flat to 4 m/s and 85 % end on, settled after
//! 0.1 to 0.35 s, later at larger scale; S_t ≫ S_n breaks bonds, and the published bond diverges at S_n 1e7, S_t 1e5.
//!
//! A fillet has *settled* when its kinetic energy stays under 1 % of the value at first contact. Gravity feeds the energy
//! of a fillet that topples over, so one dropped on end settles once it has come to lie.

mod monitor;
mod scene;

use serde_json::Value;

use super::outputs::{
    BONDS_INTACT, BONDS_INTACT_FRACTION, ESCAPED_KG, KINETIC_ENERGY, KINETIC_ENERGY_END_J, MAX_OVERLAP_RATIO,
    PASSED_THROUGH, curve, number, series,
};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{CurveRow, Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::Scene;
use crate::scenario::{Drop, Numerics, Scenario};

/// Simulated time after which dropped fillets usually are at rest, in seconds.
const USUAL_DROP_S: f64 = 1.5;

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    BONDS_INTACT_FRACTION.headline(),
    number("settle_time_s", "s",
        "Mean settle time of all fillets. The settle time of a fillet is the time from its first contact with the plate until the fillet \
         has settled. Null if at least one fillet has not settled.").headline(),
    number("lowest_bonds_intact_fraction", "",
        "Lowest share of unbroken bonds in a single fillet.").headline(),
    number("longest_settle_time_s", "s",
        "Longest settle time of a single fillet. Null if at least one fillet has not settled."),
    number("settled_fraction", "", "Number of settled fillets, divided by the number of all fillets."),
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
    PASSED_THROUGH,
    WARNING_COUNT,
    WARNING_CODES,
];

const PLATE_FORCE: SeriesRow = series(
    "plate_force",
    "N",
    "Sum of the vertical forces of the fillets on all plates, at the time of the sample.",
);
const OVER: (&str, &str) = ("fillet", "1");
#[rustfmt::skip]
const SETTLE_TIME: CurveRow = curve("settle_time", "s", OVER,
    "Settle time of each settled fillet. The numbers of the fillets start at 0.").headline().per_body();
const BONDS_OF_EACH: CurveRow = curve(
    "bonds_intact_fraction",
    "1",
    OVER,
    "Share of unbroken bonds in each fillet. The numbers of the fillets start at 0.",
)
.per_body();

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[KINETIC_ENERGY.headline(), BONDS_INTACT, PLATE_FORCE],
    curves: &[BONDS_OF_EACH, SETTLE_TIME],
};

impl Definition for Drop {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn scene(&self, setup: &Setup) -> Scene {
        scene::scene(setup, self)
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        let grid = scene::Grid::new(scenario, self, scene::bounding_radius_m(&scene.kinds));
        Box::new(monitor::DropMonitor::new(scenario, self, scene, grid))
    }

    fn usual_s(&self, numerics: &Numerics) -> f64 {
        if numerics.stop.when_done { numerics.duration_s.min(USUAL_DROP_S) } else { numerics.duration_s }
    }

    fn start_speed_m_s(&self) -> f64 {
        self.speed_m_s
    }

    fn size_field(&self, _scenario: &Scenario, bodies: u64) -> (&'static str, Value) {
        ("/product/count", bodies.into())
    }
}

//! A fillet that bends under its own weight (paper sections 2.3.2 and 3.2, Fig. 7): how far.
//!
//! Three ways to let it bend. *Over a bar*: it lies flat on a table, its centre of mass above the axis of a bar that is flush with
//! it, and from t = 0 on the table sinks, until both ends hang. *Clamped*: likewise, but a share of its length at the blunt
//! end is held. *Off a ledge*: it lies on a conveyor, which carries it over its end from t = 0 on. The table sinks slowly: let go at
//! once, a fillet whips round the bar and flings itself off, or tears at the clamp. The bend angle is the turning of its centre line
//! from end to end ([`crate::observe::BendGauge`]): 0° flat, 180° folded double.
//!
//! Expected over a bar: more than 120° for size 2 at Table 2, less with stiffer bonds wherever all of them hold.

mod monitor;
mod scene;

use super::outputs::{BONDS_INTACT, BONDS_INTACT_FRACTION, KINETIC_ENERGY, boolean, number, series};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::Scene;
use crate::scenario::{Bend, Fault, Numerics, Scenario};

/// The table sinks at this speed, in m/s.
const SINKING_M_S: f64 = 0.1;

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    number("bend_angle_deg", "°",
        "Mean bend angle after the fillet came to rest. If the fillet did not come to rest, the response is the mean bend angle over the \
         last second. If the fillet fell off or tore, the response is the maximum bend angle before this event.").headline(),
    number("tip_deflection_m", "m",
        "For the support `clamped`: distance by which the last layer of sub-particles at the tail sank from its start position. The \
         response is a mean over the same time as in `bend_angle_deg`. For the other supports, the response is null.").headline(),
    number("time_to_rest_s", "s",
        "Time at which the fillet came to rest. Null if the fillet did not come to rest, fell off or tore. Also null if the support is \
         `off_ledge` and the conveyor moves.").headline(),
    number("bend_swing_deg", "°",
        "Swing of the fillet: half of the difference between the maximum and the minimum of the bend angle. Both values cover the same \
         time as in `bend_angle_deg`. Null if the fillet fell off or tore."),
    number("largest_bend_angle_deg", "°",
        "Maximum bend angle, including swings of the fillet. If the fillet fell off or tore, only the time before this event counts."),
    boolean("fell_off",
        "Whether the fillet fell off its support: the whole fillet was below the axis of the bar, or below the axis of the roller at the \
         conveyor's end."),
    boolean("torn",
        "Whether the fillet tore: no chain of bonds connects the two ends of the fillet, or a part of the fillet left the simulation."),
    BONDS_INTACT_FRACTION,
    WARNING_COUNT,
    WARNING_CODES,
];

#[rustfmt::skip]
const BEND_ANGLE: SeriesRow = series("bend_angle", "°",
    "Bend angle of the fillet. The series ends when the fillet falls off or tears.").headline();
#[rustfmt::skip]
const TIP_DEFLECTION: SeriesRow = series("tip_deflection", "m",
    "Distance by which the last layer of sub-particles at the tail sank from its start position. The series ends when the fillet falls off \
     or tears.").headline();

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[BEND_ANGLE, TIP_DEFLECTION, KINETIC_ENERGY.headline(), BONDS_INTACT],
    curves: &[],
};

impl Definition for Bend {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn scene(&self, setup: &Setup) -> Scene {
        scene::scene(setup, self)
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        Box::new(monitor::BendMonitor::new(scenario, self, scene))
    }

    fn longest_fill_s(&self, numerics: &Numerics) -> f64 {
        numerics.max_fill_s
    }

    fn start_faults(&self, setup: &Setup) -> Vec<Fault> {
        scene::clamp_fault(setup, self).into_iter().collect()
    }
}

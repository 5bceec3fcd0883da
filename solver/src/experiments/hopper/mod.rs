//! Bulk discharge of a hopper by a belt under a gate (paper sections 2.4 and 3.4, Fig. 5, 13, 14, Table 3).
//!
//! The gate plane is x = 0, the hopper lies at x < 0, the belt runs along +x at z = 0. Fillets are dropped in
//! random orientation; when they have come to rest the belt starts, and that is t = 0. Expected at 6 cm: linear
//! discharge, 33.2 kg in 4 s within 7 %. The hopper's dimensions are derived (ARCHITECTURE.md), and so the
//! mass after 4 s is a consistency check and no validation.

mod checks;
mod curl;
mod monitor;
mod scene;

use glam::DVec2;
use serde_json::Value;

use super::outputs::{
    BONDS_INTACT, BONDS_INTACT_FRACTION, ESCAPED_KG, KINETIC_ENERGY, KINETIC_ENERGY_END_J, MAX_OVERLAP_RATIO,
    boolean, number, series, word,
};
use super::placement::Floor;
use super::{Definition, Outputs, Response, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::Scene;
use crate::scenario::{Equipment, Fault, Numerics, Scenario, SideWalls};

/// Distance beyond the gate at which a fillet that has wholly passed it leaves the simulation, in metres.
const GONE_BEYOND_M: f64 = 0.25;
/// Mean share of the sub-particles that are present while the hopper empties.
const USUAL_SHARE: f64 = 0.6;

#[rustfmt::skip]
const RESPONSES: &[Response] = &[
    word("regime",
        "`no_flow` for q < 0.15, `inconsistent` for q < 0.55, else `constant`, with q = `lowest_rate_ratio`. `too_short` when under \
         4 s were run and the hopper was neither empty nor jammed. One standstill of a second makes `no_flow`.").headline(),
    number("effective_throughput_kg_s", "kg/s",
        "95 % of the filled mass over the time until it was out; null when it was not. The paper quotes 7.6 kg/s without a \
         definition; this one is ours.").headline(),
    number("mean_rate_kg_s", "kg/s", "Mean rate from 0.5 s, past the opening spill, until 80 % is out.").headline(),
    number("discharged_kg", "kg", "Mass out at the end.").headline(),
    number("discharged_kg_at_4s", "kg",
        "Mass out at 4 s; a hopper that is empty or jams sooner keeps its last value.").headline(),
    number("time_to_95_percent_s", "s", "Time at which 95 % was out; null when not reached.").headline(),
    number("time_to_99_percent_s", "s", "Time at which 99 % was out; sensitive, since the last fillets straddle the gate."),
    number("loaded_kg", "kg", "Mass of all fillets of the scenario."),
    number("filled_kg", "kg", "Mass in the hopper when the belt starts."),
    number("fill_duration_s", "s", "Simulated time from dropping the fillets until the bed is at rest."),
    number("bulk_density_kg_m3", "kg/m³",
        "Filled mass over the bed's volume: hopper area times the height that 95 % of the floor stays below. Soft fillets nest and \
         overlap, so it can exceed the density of a fillet."),
    number("peak_rate_kg_s", "kg/s",
        "Maximum running mean of the rate over 1 s. The plotted rate is a mean over 0.25 s and peaks higher."),
    number("rate_variation", "",
        "Standard deviation over mean of the 1 s running mean of the rate, from 0.5 s until 80 % is out."),
    boolean("steady", "Whether `rate_variation` is under 0.2."),
    number("longest_stoppage_s", "s",
        "Longest stretch with the rate (over 0.25 s) under 0.15 of the belt's capacity, until 80 % is out."),
    number("belt_capacity_kg_s", "kg/s",
        "Q_b = bulk density × belt speed × width × opening: the rate that the belt carries when the opening is full."),
    number("lowest_rate_ratio", "", "q: minimum 1 s running mean of the rate from 0.5 s until 80 % is out, over Q_b."),
    number("linearity_r2", "", "R² of a straight line through the curve from 0 to `linearity_until_s`."),
    number("linearity_until_s", "s", "4 s, or when 80 % was out or the run ended, if that was sooner."),
    number("greatest_height_m", "m",
        "Height of the fillets left in the hopper at the end; fillets that hang on a wall look like a jam."),
    number("curl_angle_deg", "°",
        "Mean bend angle of the fillets whose centre of mass lies within 0.2 m past the gate, over all samples until 80 % is out. \
         The bend angle is the turning of the centre line between its ends: 0 flat, 180 folded double."),
    number("largest_curl_angle_deg", "°", "Maximum bend angle among them."),
    BONDS_INTACT_FRACTION,
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
];

const DISCHARGED_MASS: SeriesRow = series("discharged_mass", "kg", "Mass out.").headline();
#[rustfmt::skip]
const MASS_RATE: SeriesRow = series("mass_rate", "kg/s",
    "Rate: mean over 0.25 s about each time, over what there is at both ends.").headline();

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[DISCHARGED_MASS, MASS_RATE, BONDS_INTACT, KINETIC_ENERGY],
    curves: &[],
};

impl Definition for Equipment {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn scene(&self, setup: &Setup) -> Scene {
        scene::scene(setup, self)
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        Box::new(monitor::HopperMonitor::new(scenario, self, scene))
    }

    fn longest_fill_s(&self, numerics: &Numerics) -> f64 {
        numerics.max_fill_s
    }

    fn usual_s(&self, numerics: &Numerics) -> f64 {
        numerics.max_fill_s.min(super::definition::USUAL_FILL_S) + USUAL_SHARE * numerics.duration_s
    }

    fn size_field(&self, _scenario: &Scenario, bodies: u64) -> (&'static str, Value) {
        ("/product/count", bodies.into())
    }

    fn floor_cells(&self, radius_m: f64) -> f64 {
        self.hopper_length_m * self.hopper_width_m / (radius_m * radius_m)
    }

    fn fit_faults(&self, setup: &Setup) -> Vec<Fault> {
        checks::fit_faults(setup, self)
    }

    fn start_faults(&self, setup: &Setup) -> Vec<Fault> {
        checks::surface_faults(setup, self)
    }
}

/// The floor of the hopper.
fn floor(equipment: &Equipment) -> Floor {
    let half = equipment.hopper_width_m / 2.0;
    Floor {
        low: DVec2::new(-equipment.hopper_length_m, -half),
        high: DVec2::new(0.0, half),
        periodic_y: equipment.side_walls == SideWalls::Periodic,
    }
}

//! Bulk discharge of a hopper by a belt under a gate (paper sections 2.4 and 3.4, Fig. 5, 13, 14, Table 3).
//!
//! The gate plane is x = 0, the hopper lies at x < 0, the belt runs along +x at z = 0. Fillets are dropped in
//! random orientation; when they have come to rest the belt starts, and that is t = 0. Expected at 6 cm: linear
//! discharge, 33.2 kg in 4 s within 7 %. The hopper's dimensions are derived (ARCHITECTURE.md), and so the
//! mass after 4 s is a consistency check and no validation.

mod checks;
mod curl;
mod feed;
mod loads;
mod monitor;
mod opening;
mod scene;

use glam::DVec2;
use serde_json::Value;

use super::loads::LOADS;
use super::outputs::{
    BONDS_INTACT, BONDS_INTACT_FRACTION, ESCAPED_KG, KINETIC_ENERGY, KINETIC_ENERGY_END_J, MAX_OVERLAP_RATIO,
    PASSED_THROUGH, boolean, curve, indicator, number, series, word,
};
use super::placement::Floor;
use super::warnings::WARNING_COUNT;
use super::{CurveRow, Definition, Outputs, Response, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{BodyKind, Scene};
use crate::scenario::{Equipment, Fault, Numerics, Scenario, SideWalls};
pub(super) use opening::belt_speed_m_s;

/// Distance beyond the gate at which a fillet that has wholly passed it leaves the simulation, in metres.
const GONE_BEYOND_M: f64 = 0.25;
/// Mean share of the sub-particles that are present while the hopper empties.
const USUAL_SHARE: f64 = 0.6;

#[rustfmt::skip]
const RESPONSES: &[Response] = &[
    word("regime",
        "By q = `lowest_rate_ratio`: `no_flow` below 0.15 unless 95 % came out, `inconsistent` (uneven) below 0.55, else \
         `constant`. `outrun`: at `belt_capacity_kg_s` the filled mass is out within 0.5 s, so that q says nothing. `too_short`: less \
         than 4 s simulated, neither empty nor jammed. Null without a belt capacity.").headline(),
    number("effective_throughput_kg_s", "kg/s",
        "95 % of the filled mass, divided by the time until it was out; null when it was not. The definition is ours: the paper \
         quotes 7.6 kg/s without one.").headline(),
    number("mean_rate_kg_s", "kg/s", "Mean rate from 0.5 s until 80 % is out. The first 0.5 s, the spill at the start, does not count.").headline(),
    indicator("jammed",
        "Whether the hopper jammed: nothing passed the gate for `jam_after_s`, or for a shorter `when_jammed_s`, while at least 5 % of \
         the filled mass was inside. An arch that collapses later was a jam. Null when the simulation is shorter and the hopper not \
         empty.").headline(),
    number("time_to_jam_s", "s",
        "Time of the last passage before the first jam, 0 without a passage; null without a jam: its mean over replicates is that of the \
         jammed runs alone."),
    number("discharged_kg", "kg", "Mass out at the end.").headline(),
    number("discharged_kg_at_4s", "kg",
        "Mass out at 4 s; the last value if the simulation ended sooner, empty or jammed.").headline(),
    number("time_to_95_percent_s", "s", "Time at which 95 % was out; null when not reached.").headline(),
    number("time_to_99_percent_s", "s", "Time at which 99 % was out; it depends on the last few fillets, so it varies a lot."),
    number("loaded_kg", "kg", "Mass of all fillets of the scenario."),
    number("filled_kg", "kg", "Mass in the hopper when the belt starts."),
    number("fill_duration_s", "s", "Simulated time from dropping the fillets until the bed is at rest."),
    number("bulk_density_kg_m3", "kg/m³",
        "Filled mass divided by the volume of the bed: hopper area times bed height, which 95 % of the floor does not exceed. Soft \
         fillets overlap, so it can exceed the density of a fillet."),
    number("interpenetrated_fraction", "",
        "Share of the sub-particles that lie inside another fillet when the belt starts: their centre is between the eight \
         corners of one of its lattice cells."),
    number("peak_rate_kg_s", "kg/s",
        "Maximum of the 1 s running mean of the rate. The plotted rate is a mean over 0.25 s, so its maximum is higher."),
    number("rate_variation", "",
        "Standard deviation divided by mean, of the 1 s running mean of the rate, from 0.5 s until 80 % is out."),
    boolean("steady", "Whether `rate_variation` is under 0.2."),
    number("longest_stoppage_s", "s",
        "Longest time with a rate (mean over 0.25 s) below 0.15 `belt_capacity_kg_s`, until 80 % is out."),
    number("belt_capacity_kg_s", "kg/s",
        "Rate that the belt carries when the opening is full: `bulk_density_kg_m3` × `belt_speed_m_s` × `hopper_width_m` × \
         `gate_opening_m`. With `parametric` false: × velocity of the belt's surface × `opening_width_m` × `opening_height_m`; null \
         when these are not declared."),
    number("lowest_rate_ratio", "", "q: minimum of the 1 s running mean of the rate from 0.5 s until 80 % is out, divided by `belt_capacity_kg_s`."),
    number("linearity_r2", "", "R² of a straight line through the curve from 0 to `linearity_until_s`."),
    number("linearity_until_s", "s", "End of the straight line: 4 s, or sooner if 80 % was out or the simulation ended."),
    number("greatest_height_m", "m",
        "Height of the highest fillet left in the hopper at the end. A fillet that hangs on a wall counts."),
    number("residence_mean_s", "s",
        "Mean residence time of the fillets that left: from t = 0, or a later entry, until the centre of mass passes the gate plane.").headline(),
    number("residence_5_percent_s", "s",
        "Residence time that 5 % of the fillets do not exceed, by the estimator of Kaplan and Meier: fillets still inside count as \
         longer than their time so far."),
    number("residence_median_s", "s", "The same for 50 %; null if `residence_share` ends below."),
    number("residence_95_percent_s", "s", "The same for 95 %; null if `residence_share` ends below."),
    number("fillets_remaining", "", "Fillets in the hopper at the end whose centre of mass has not passed the gate plane."),
    number("curl_angle_deg", "°",
        "Mean bend angle of fillets up to 0.2 m past the gate, over all samples until 80 % is out. The bend angle is the angle \
         between the directions of the two ends: 0 flat, 180 folded double."),
    number("largest_curl_angle_deg", "°", "Maximum bend angle of these fillets."),
    number("fed_kg", "kg", "Mass that the feed has brought in. It is below the mass due where fillets found no free place over the hopper, with the \
         warning `feed_short`."),
    number("inside_kg", "kg", "Mass in the hopper at the end, which has not passed the gate."),
    number("steady_rate_kg_s", "kg/s",
        "Mean rate in the second half of the time from t = 0 on, for a hopper with a feed; null without one, or when nothing was simulated."),
    BONDS_INTACT_FRACTION,
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
    PASSED_THROUGH,
    number("mean_belt_power_w", "W", "Mean of the series `belt_power` until 80 % is out; with a feed, in the second half of the time from t = 0 on."),
    number("max_belt_power_w", "W", "Maximum of the series `belt_power`."),
    number("mean_gate_force_n", "N",
        "Mean force on the surface named `gate` until 80 % is out; with a feed, in the second half of the time from t = 0 on. Null without such a surface."),
    number("max_gate_force_n", "N", "Maximum of this force over all samples."),
    WARNING_COUNT,
];

const DISCHARGED_MASS: SeriesRow = series("discharged_mass", "kg", "Mass out.").headline();
#[rustfmt::skip]
const MASS_RATE: SeriesRow = series("mass_rate", "kg/s",
    "Rate: mean over the 0.25 s around each sample; over a shorter time at both ends.").headline();

const INSIDE_MASS: SeriesRow =
    series("inside_mass", "kg", "Mass in the hopper, which has not passed the gate.");

#[rustfmt::skip]
const BELT_POWER: SeriesRow = series("belt_power", "W",
    "Power of all belts at the time of the sample: friction times belt speed, positive when the belt drives the fillets.");

const RESIDENCE_SHARE: CurveRow = curve(
    "residence_share",
    "1",
    ("residence_time", "s"),
    "Share of the fillets that had left after this residence time (Kaplan and Meier). It ends below 1 when the longest times are \
     those of fillets still inside.",
);

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[
        DISCHARGED_MASS,
        MASS_RATE,
        BONDS_INTACT,
        KINETIC_ENERGY,
        INSIDE_MASS,
        BELT_POWER,
        LOADS[0],
        LOADS[1],
        LOADS[2],
        LOADS[3],
        LOADS[4],
        LOADS[5],
    ],
    curves: &[RESIDENCE_SHARE],
};

impl Definition for Equipment {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn kind_of_each(&self, scenario: &Scenario, kinds: &[BodyKind]) -> Vec<usize> {
        let filled = (0..scenario.product.count as usize).map(|i| i % kinds.len());
        filled.chain(feed::fed_kinds(scenario, self, kinds)).collect()
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
        // The bodies include those of the feed.
        if self.feed_kg_s > 0.0 {
            return ("/equipment/feed_kg_s", self.feed_kg_s.into());
        }
        ("/product/count", bodies.into())
    }

    fn floor_cells(&self, radius_m: f64) -> f64 {
        self.hopper_length_m * self.hopper_width_m / (radius_m * radius_m)
    }

    fn fit_faults(&self, setup: &Setup) -> Vec<Fault> {
        checks::fit_faults(setup, self)
    }

    fn start_faults(&self, setup: &Setup) -> Vec<Fault> {
        checks::start_faults(setup, self)
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

//! Bulk discharge of a hopper by a belt under a gate (paper sections 2.4 and 3.4, Fig. 5, 13, 14, Table 3).
//!
//! The gate plane is x = 0, the hopper lies at x < 0, the belt runs along +x at z = 0. Fillets are dropped in
//! random orientation; when they have come to rest the belt starts, and that is t = 0. Expected at 6 cm: linear
//! discharge, 33.2 kg in 4 s within 7 %. The hopper's dimensions are derived (docs/validation.md), and so the
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
use super::warnings::{WARNING_CODES, WARNING_COUNT};
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
        "Kind of discharge, from q = `lowest_rate_ratio`. `no_flow`: q below 0.15, and less than 95 % out. `inconsistent` (uneven): \
         any other q below 0.55. `constant`: q of 0.55 and more. `outrun`: the belt at its capacity would empty the hopper within \
         0.5 s, so q has no meaning. `too_short`: less than 4 s were simulated, and the hopper neither emptied nor jammed. Null \
         without a belt capacity.").headline(),
    number("effective_throughput_kg_s", "kg/s",
        "95 % of the filled mass, divided by the time until this mass was out. Null if less than 95 % of the filled mass came out. \
         The paper gives 7.6 kg/s without a definition, so the definition of this response is an assumption.").headline(),
    number("mean_rate_kg_s", "kg/s", "Mean rate from 0.5 s until 80 % of the filled mass is out. The first 0.5 s do not count, \
                                      because fillets spill out when the shutter opens.").headline(),
    indicator("jammed",
        "Whether the hopper jammed: nothing passed the gate for the jam time, while at least 5 % of the filled mass was inside. The \
         jam time is `jam_after_s`, or `when_jammed_s` if this time is set and shorter. A jam counts even if the flow starts again \
         later. Null if the simulation was shorter than the jam time and the hopper did not empty.").headline(),
    number("time_to_jam_s", "s",
        "Time of the last passage of mass through the gate plane before the first jam. The time is 0 if nothing passed before the \
         jam. Null without a jam. The mean over replicates is therefore a mean over the jammed runs only."),
    number("discharged_kg", "kg", "Mass that has passed the gate plane by the end of the simulation.").headline(),
    number("discharged_kg_at_4s", "kg",
        "Mass that has passed the gate plane by t = 4 s. If the simulation ended earlier with an empty or jammed hopper, the \
         response is the mass at the end of the simulation.").headline(),
    number("time_to_95_percent_s", "s", "Time at which 95 % of the filled mass was out; null if less than 95 % came out.").headline(),
    number("time_to_99_percent_s", "s", "Time at which 99 % of the filled mass was out. This time depends on the last few fillets, so \
                                         it varies a lot."),
    number("loaded_kg", "kg", "Mass of all fillets of the scenario."),
    number("filled_kg", "kg", "Mass in the hopper when the belt starts."),
    number("fill_duration_s", "s", "Simulated time from the drop of the fillets until they are at rest in the hopper."),
    number("bulk_density_kg_m3", "kg/m³",
        "Filled mass divided by the volume of the bed. This volume is the hopper area times the bed height. The bed height is the \
         height that the bed does not exceed on 95 % of the floor area. Soft fillets overlap, so the bulk density can exceed the \
         density of a fillet."),
    number("interpenetrated_fraction", "",
        "Share of the sub-particles that lie inside another fillet when the belt starts. A sub-particle lies inside a fillet if its \
         centre is in a cubic cell of the fillet's lattice."),
    number("peak_rate_kg_s", "kg/s",
        "Maximum of the 1 s running mean of the rate. The maximum of the series `mass_rate` is higher, because this series is a mean \
         over 0.25 s."),
    number("rate_variation", "",
        "Standard deviation of the 1 s running mean of the rate, divided by the mean of this running mean. Both values refer to the \
         time from 0.5 s until 80 % of the filled mass is out."),
    boolean("steady", "Whether `rate_variation` is under 0.2."),
    number("longest_stoppage_s", "s",
        "Longest time during which the rate (mean over 0.25 s) stays below 0.15 × `belt_capacity_kg_s`, before 80 % of the filled \
         mass is out."),
    number("belt_capacity_kg_s", "kg/s",
        "Rate that the belt carries when the opening is full: `bulk_density_kg_m3` × `belt_speed_m_s` × `hopper_width_m` × \
         `gate_opening_m`. If `parametric` is false: `bulk_density_kg_m3` × velocity of the belt's surface × `opening_width_m` × \
         `opening_height_m`; null if one of these fields is null."),
    number("lowest_rate_ratio", "", "The ratio q: minimum of the 1 s running mean of the rate, divided by `belt_capacity_kg_s`. The \
                                     minimum is taken from 0.5 s until 80 % of the filled mass is out."),
    number("linearity_r2", "", "R² of a straight line through the series `discharged_mass`, from 0 to `linearity_until_s`."),
    number("linearity_until_s", "s", "Time at which the straight line of `linearity_r2` ends: 4 s, or the earlier time at which 80 % \
                                      of the filled mass was out or the simulation ended."),
    number("greatest_height_m", "m",
        "Height of the top of the highest sub-particle that is in the hopper at the end, measured from the plane z = 0. A fillet \
         that hangs on a wall also counts."),
    number("residence_mean_s", "s",
        "Mean residence time of the fillets that left. The residence time runs from t = 0 until the centre of mass passes the gate \
         plane. For a fillet of the feed, the residence time starts when the fillet enters.").headline(),
    number("residence_5_percent_s", "s",
        "Residence time that 5 % of the fillets do not exceed, by the estimator of Kaplan and Meier. The estimator also counts a \
         fillet that is still inside: its residence time is longer than its time in the hopper so far."),
    number("residence_median_s", "s", "Residence time that 50 % of the fillets do not exceed; null if the curve `residence_share` \
                                       ends below 50 %."),
    number("residence_95_percent_s", "s", "Residence time that 95 % of the fillets do not exceed; null if the curve `residence_share` \
                                           ends below 95 %."),
    number("fillets_remaining", "", "Number of fillets in the hopper at the end: their centre of mass has not passed the gate plane."),
    number("curl_angle_deg", "°",
        "Mean bend angle of the fillets within 0.2 m past the gate, over all samples until 80 % of the filled mass is out. The bend \
         angle is the angle between the directions of the two ends. The bend angle is 0° for a flat fillet, and 180° for a fillet \
         that is folded double."),
    number("largest_curl_angle_deg", "°", "Maximum bend angle of the fillets that count for `curl_angle_deg`."),
    number("fed_kg", "kg", "Mass that the feed has brought in. This mass is less than `feed_kg_s` × time if fillets found no free \
                            place above the hopper. The result then has the warning `feed_short`."),
    number("inside_kg", "kg", "Mass in the hopper at the end: the mass that has not passed the gate."),
    number("steady_rate_kg_s", "kg/s",
        "Mean rate in the second half of the time from t = 0 to the end, for a hopper with a feed. Null without a feed, or if \
         nothing was simulated after t = 0."),
    BONDS_INTACT_FRACTION,
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
    PASSED_THROUGH,
    number("mean_belt_power_w", "W", "Mean of the series `belt_power` until 80 % of the filled mass is out. With a feed: mean over \
                                      the second half of the time from t = 0 to the end."),
    number("max_belt_power_w", "W", "Maximum of the series `belt_power`."),
    number("mean_gate_force_n", "N",
        "Mean force on the surface named `gate` until 80 % of the filled mass is out. With a feed: mean over the second half of the \
         time from t = 0 to the end. Null without a surface of this name."),
    number("max_gate_force_n", "N", "Maximum force on the surface named `gate`, over all samples."),
    WARNING_COUNT,
    WARNING_CODES,
];

const DISCHARGED_MASS: SeriesRow =
    series("discharged_mass", "kg", "Mass that has passed the gate plane.").headline();
#[rustfmt::skip]
const MASS_RATE: SeriesRow = series("mass_rate", "kg/s",
    "Rate, as a mean over a window of 0.25 s around each sample. At the first and last samples, this window is shorter.").headline();

const INSIDE_MASS: SeriesRow =
    series("inside_mass", "kg", "Mass in the hopper: the mass that has not passed the gate.");

#[rustfmt::skip]
const BELT_POWER: SeriesRow = series("belt_power", "W",
    "Power of all belts at the time of the sample: friction force times belt speed. The power is positive when the belt drives the \
     fillets.");

const RESIDENCE_SHARE: CurveRow = curve(
    "residence_share",
    "1",
    ("residence_time", "s"),
    "Share of the fillets with at most this residence time, by the estimator of Kaplan and Meier. The curve ends below 1 if the \
     fillets with the longest times are still inside.",
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

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

use serde_json::Value;

use super::filling::floor;
use super::loads::LOADS;
use super::outputs::{
    BONDS_INTACT, BONDS_INTACT_FRACTION, ESCAPED_KG, KINETIC_ENERGY, KINETIC_ENERGY_END_J, MAX_OVERLAP_RATIO,
    PASSED_THROUGH, boolean, curve, indicator, number, series, word,
};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{CurveRow, Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{BodyKind, Scene};
use crate::scenario::{Equipment, Fault, Numerics, Scenario};

/// Distance beyond the gate at which a fillet that has wholly passed it leaves the simulation, in metres.
const GONE_BEYOND_M: f64 = 0.25;
/// Mean share of the sub-particles that are present while the hopper empties.
const USUAL_SHARE: f64 = 0.6;

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    word("regime",
        "Kind of discharge, from the ratio q (the response `lowest_rate_ratio`). `no_flow`: q is below 0.15, and less than 95 % of the \
         filled mass is out. `inconsistent` (uneven): q is below 0.55, and the regime is not `no_flow`. `constant`: q is 0.55 or more. \
         `outrun`: the belt at its capacity would empty the hopper within 0.5 s. For such a fast belt, q has no meaning. If almost nothing \
         flows on such a fast belt, the regime is `no_flow`. `too_short`: the simulation is too short to decide. The simulation ended \
         before t = 4 s, with less than 80 % of the filled mass out, and did not end because of an empty or jammed hopper. Null if the \
         belt capacity is null or 0.").headline(),
    number("effective_throughput_kg_s", "kg/s",
        "95 % of the filled mass, divided by the time at which this mass was out. Null if less than 95 % of the filled mass came out. The \
         paper gives a throughput of 7.6 kg/s, but no definition. The definition of this response is therefore an assumption.").headline(),
    number("mean_rate_kg_s", "kg/s",
        "Mean discharge rate from t = 0.5 s until 80 % of the filled mass is out. The first 0.5 s do not count, because \
         fillets spill out when the shutter opens.").headline(),
    indicator("jammed",
        "Whether the hopper jammed. In a jam, nothing passes the gate for the jam time, while at least 5 % of the filled mass is inside. \
         The jam time is the shorter one of the times `jam_after_s` and `when_jammed_s`. If `when_jammed_s` is null, the jam time is \
         `jam_after_s`. A jam counts even if the flow starts again later. Null if the simulation was shorter than the jam time, and at \
         least 5 % of the filled mass was inside at the end.").headline(),
    number("time_to_jam_s", "s",
        "Time at which the last mass passed the gate plane before the first jam. The time is 0 if nothing passed before the jam. Null if \
         the hopper did not jam. A mean over several simulations therefore covers only the simulations with a jam."),
    number("discharged_kg", "kg", "Mass that has passed the gate plane by the end of the simulation.").headline(),
    number("discharged_kg_at_4s", "kg",
        "Mass that has passed the gate plane by t = 4 s. If an empty or jammed hopper ended the simulation earlier, the response is the \
         mass that has passed by the end. Null if the simulation ended before 4 s for another reason.").headline(),
    number("time_to_95_percent_s", "s",
        "Time at which 95 % of the filled mass was out. Null if less than 95 % came out.").headline(),
    number("time_to_99_percent_s", "s",
        "Time at which 99 % of the filled mass was out. Null if less than 99 % came out. This time depends on the last few fillets. \
         Therefore this time varies a lot between simulations with different random numbers."),
    number("loaded_kg", "kg", "Mass of all fillets that drop into the hopper before t = 0."),
    number("filled_kg", "kg", "Filled mass: the mass in the hopper at t = 0, when the belt starts."),
    number("fill_duration_s", "s",
        "Simulated time from the moment at which the fillets begin to drop until they are at rest in the hopper."),
    number("bulk_density_kg_m3", "kg/m³",
        "Filled mass divided by the volume of the bed. The bed consists of all fillets in the hopper at t = 0. The volume of the bed is \
         the floor area of the hopper times the bed height. On 95 % of the floor area, the bed is at most as high as the bed height. In \
         the model, fillets can penetrate each other and then share the same space. Therefore the bulk density can be above the density of \
         a fillet."),
    number("interpenetrated_fraction", "",
        "Share of the sub-particles that lie inside another fillet when the belt starts. The lattice of a fillet consists of cubic cells \
         with a sub-particle at each corner. A sub-particle lies inside a fillet if its centre is in one of these cells."),
    number("peak_rate_kg_s", "kg/s",
        "Maximum of the running mean of the discharge rate over 1 s. The series `mass_rate` is a mean over only 0.25 s. Therefore the \
         maximum of this series is higher than `peak_rate_kg_s`."),
    number("rate_variation", "",
        "Standard deviation of the discharge rate, divided by the mean of the discharge rate. Roost computes the deviation and the mean \
         from the running mean of the rate over 1 s, from t = 0.5 s until 80 % of the filled mass is out."),
    boolean("steady", "Whether the discharge rate is steady: `rate_variation` is below 0.2."),
    number("longest_stoppage_s", "s",
        "Longest time during which the discharge rate stays below 0.15 × `belt_capacity_kg_s`. This rate is a mean over 0.25 s. The time \
         after 80 % of the filled mass is out does not count."),
    number("belt_capacity_kg_s", "kg/s",
        "Mass per second that the belt carries out when fillets fill the whole opening under the gate: `bulk_density_kg_m3` × \
         `belt_speed_m_s` × `hopper_width_m` × `gate_opening_m`. If `parametric` is false, this mass per second is `bulk_density_kg_m3` × \
         speed of the belt's surface × `opening_width_m` × `opening_height_m`. Null if the belt speed or the opening is unknown, or if \
         the belt does not carry fillets out of the hopper."),
    number("lowest_rate_ratio", "",
        "The ratio q: the lowest discharge rate, divided by `belt_capacity_kg_s`. The lowest rate is the minimum of the running mean \
         over 1 s, from t = 0.5 s until 80 % of the filled mass is out."),
    number("linearity_r2", "",
        "Coefficient of determination R² (not the square of the radius R) of a straight line through the series `discharged_mass`. The \
         line covers the time from t = 0 to `linearity_until_s`."),
    number("linearity_until_s", "s",
        "Time at which the straight line of `linearity_r2` ends: t = 4 s. The line ends earlier if 80 % of the filled mass was out \
         before 4 s, or if the simulation ended before 4 s."),
    number("greatest_height_m", "m",
        "Height of the top of the highest sub-particle that is in the hopper at the end. Roost measures this height from the plane z = 0 \
         (by default, the surface of the belt). A fillet that hangs on a wall also counts. Null if no sub-particle is in the hopper."),
    number("residence_mean_s", "s",
        "Mean residence time of the fillets that left. The residence time of a fillet runs from t = 0 until its centre of mass passes \
         the gate plane. For a fillet of the feed, the residence time starts when this fillet enters.").headline(),
    number("residence_5_percent_s", "s",
        "5th percentile of the residence time: 5 % of the fillets have this residence time or a shorter one. The method of Kaplan \
         and Meier also counts the fillets that are still inside. The residence time of such a fillet is longer than its time in the \
         hopper so far."),
    number("residence_median_s", "s",
        "Median residence time: 50 % of the fillets have this residence time or a shorter one. Null if the curve `residence_share` \
         ends below 50 %."),
    number("residence_95_percent_s", "s",
        "95th percentile of the residence time: 95 % of the fillets have this residence time or a shorter one. Null if the curve \
         `residence_share` ends below 95 %."),
    number("fillets_remaining", "",
        "Number of fillets in the hopper at the end. The centre of mass of these fillets has not passed the gate plane."),
    number("curl_angle_deg", "°",
        "Mean bend angle of the fillets whose centre of mass has passed the gate plane by at most 0.2 m. The mean covers all samples \
         until 80 % of the filled mass is out. The bend angle is the angle between the directions of the two ends of a fillet. A flat \
         fillet has 0°, and a fillet that is folded in half has 180°."),
    number("largest_curl_angle_deg", "°",
        "Maximum bend angle of a single fillet, among the fillets and samples that count for `curl_angle_deg`."),
    number("fed_kg", "kg",
        "Mass that the feed has brought in. If some fillets found no free place above the hopper, this mass is less than `feed_kg_s` times \
         the time since t = 0. If the difference is large, the result has the warning `feed_short`."),
    number("inside_kg", "kg", "Mass in the hopper at the end. This mass has not passed the gate."),
    number("steady_rate_kg_s", "kg/s",
        "Mean discharge rate of a hopper with a feed, over the second half of the time from t = 0 to the end. Null without a feed. Also \
         null if nothing was simulated after t = 0."),
    BONDS_INTACT_FRACTION,
    KINETIC_ENERGY_END_J,
    MAX_OVERLAP_RATIO,
    ESCAPED_KG,
    PASSED_THROUGH,
    number("mean_belt_power_w", "W",
        "Mean of the series `belt_power` from t = 0 until 80 % of the filled mass is out. For a hopper with a feed, the mean covers \
         the second half of the time from t = 0 to the end."),
    number("max_belt_power_w", "W", "Maximum of the series `belt_power`."),
    number("mean_gate_force_n", "N",
        "Mean force on the surface with the name `gate`, such as Roost's own gate. The mean covers the time after t = 0 until 80 % of the \
         filled mass is out. For a hopper with a feed, the mean covers the second half of the time from t = 0 to the end. Null if no \
         surface has the name `gate`."),
    number("max_gate_force_n", "N",
        "Maximum force on the surface with the name `gate`, over all samples after t = 0. Null if no surface has the name `gate`."),
    WARNING_COUNT,
    WARNING_CODES,
];

const DISCHARGED_MASS: SeriesRow =
    series("discharged_mass", "kg", "Mass that has passed the gate plane.").headline().constant_after_end();
#[rustfmt::skip]
const MASS_RATE: SeriesRow = series("mass_rate", "kg/s",
    "Discharge rate: the mass per second that passes the gate plane, as a mean over 0.25 s around each sample. For the first and the \
     last samples, the mean covers a shorter time.").headline();

const INSIDE_MASS: SeriesRow =
    series("inside_mass", "kg", "Mass in the hopper. This mass has not passed the gate.");

#[rustfmt::skip]
const BELT_POWER: SeriesRow = series("belt_power", "W",
    "Power of all belts at the time of the sample: the friction force times the belt speed. The power is positive when the belts drive \
     the fillets.");

const RESIDENCE_SHARE: CurveRow = curve(
    "residence_share",
    "1",
    ("residence_time", "s"),
    "Share of the fillets that have this residence time or a shorter one, by the method of Kaplan and Meier. The curve ends below 1 if \
     the fillets with the longest residence times are still inside.",
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

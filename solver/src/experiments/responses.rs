//! The names of the responses of each experiment, once: a result of other names is none of ours, and the docs explain these.
//!
//! An experiment returns every response of its list whatever its options and however the run ended; one that was not reached is null. A
//! cancelled run has none.

use crate::scenario::Experiment;

/// Names of the responses that a run of this experiment returns, sorted.
pub fn response_names(experiment: &Experiment) -> &'static [&'static str] {
    match experiment {
        Experiment::Hopper { .. } => HOPPER,
        Experiment::Drop { .. } => DROP,
        Experiment::Bend { .. } => BEND,
        Experiment::Slide { .. } => SLIDE,
        Experiment::Compress { .. } => COMPRESS,
        Experiment::Scene { .. } => SCENE,
    }
}

const HOPPER: &[&str] = &[
    "belt_capacity_kg_s",
    "bonds_intact_fraction",
    "bulk_density_kg_m3",
    "curl_angle_deg",
    "discharged_kg",
    "discharged_kg_at_4s",
    "effective_throughput_kg_s",
    "escaped_kg",
    "fill_duration_s",
    "filled_kg",
    "greatest_height_m",
    "kinetic_energy_end_j",
    "largest_curl_angle_deg",
    "linearity_r2",
    "linearity_until_s",
    "loaded_kg",
    "longest_stoppage_s",
    "lowest_rate_ratio",
    "max_overlap_ratio",
    "mean_rate_kg_s",
    "peak_rate_kg_s",
    "rate_variation",
    "regime",
    "steady",
    "time_to_95_percent_s",
    "time_to_99_percent_s",
];

const DROP: &[&str] = &[
    "bonds_intact_fraction",
    "escaped_kg",
    "kinetic_energy_end_j",
    "longest_settle_time_s",
    "lowest_bonds_intact_fraction",
    "max_overlap_ratio",
    "settle_time_s",
    "settled_fraction",
];

const BEND: &[&str] = &[
    "bend_angle_deg",
    "bend_swing_deg",
    "bonds_intact_fraction",
    "fell_off",
    "largest_bend_angle_deg",
    "time_to_rest_s",
    "tip_deflection_m",
    "torn",
];

const SLIDE: &[&str] =
    &["bonds_intact_fraction", "critical_angle_deg", "friction_angle_deg", "rolled_over", "slid"];

const COMPRESS: &[&str] = &[
    "bonds_intact_fraction",
    "largest_strain",
    "modulus_lattice_pa",
    "modulus_pa",
    "plate_imbalance_fraction",
    "stress_at_end_pa",
];

const SCENE: &[&str] = &[
    "bodies",
    "bonds_intact_fraction",
    "escaped_kg",
    "greatest_height_m",
    "kinetic_energy_end_j",
    "max_overlap_ratio",
    "time_to_rest_s",
];

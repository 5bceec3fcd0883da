//! Profiles: the sizes of all simulations of a report, from some minutes to a night.

use clap::ValueEnum;

/// The sizes of all simulations of a report.
#[derive(Debug)]
pub(crate) struct Profile {
    pub(crate) name: &'static str,
    /// Sub-particle radius of single fillets, in metres.
    pub(crate) radius_m: f64,
    /// Fillets of each of the six shapes in a drop.
    pub(crate) of_each_shape: u32,
    /// Stiffnesses per area of the grid of Fig. 7 and 9, normal and shear, ascending, in N/m³.
    pub(crate) stiffnesses_n_m3: &'static [f64],
    /// Impact speeds of Fig. 11, ascending, in m/s.
    pub(crate) speeds_m_s: &'static [f64],
    /// Scales of Fig. 12, ascending.
    pub(crate) scales: &'static [f64],
    /// Replicates of bending with Table 2.
    pub(crate) fillet_seeds: u64,
    /// Replicates of each drop; the seed draws the angles of every fillet.
    pub(crate) drop_seeds: u64,
    /// Replicates of sliding; the seed draws the heading.
    pub(crate) headings: u64,
    /// Coefficients of friction of Fig. 8, ascending.
    pub(crate) frictions: &'static [f64],
    /// Tilt rate of the plate of Fig. 8, in °/s.
    pub(crate) tilt_rate_deg_s: f64,
    /// Strain rate of Fig. 6, in 1/s.
    pub(crate) strain_rate_1_s: f64,
    /// The hopper of Fig. 13, 14 and Table 3.
    pub(crate) bed: Bed,
    /// Replicates of the dry hopper.
    pub(crate) dry_seeds: u64,
    /// Replicates of the wet hopper.
    pub(crate) wet_seeds: u64,
    /// Replicates of the dry hopper with less friction on the belt, or with more adhesion.
    pub(crate) traction_seeds: u64,
    /// The hopper of the test of the time step.
    pub(crate) timestep_bed: Bed,
    /// Replicates for each time step.
    pub(crate) timestep_seeds: u64,
}

/// The hopper or a slice of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bed {
    /// Sub-particle radius, in metres.
    pub(crate) radius_m: f64,
    /// Inner width, in metres.
    pub(crate) width_m: f64,
    /// Number of fillets.
    pub(crate) count: u32,
    /// Simulated belt time, in seconds.
    pub(crate) duration_s: f64,
}

/// Inner width of the whole hopper, in metres: derived from 33.2 kg in 4 s.
pub(crate) const WHOLE_WIDTH_M: f64 = 0.59;

/// A coarse slice of the hopper, single fillets with the paper's sub-particles, few replicates.
const QUICK: Profile = Profile {
    name: "quick",
    radius_m: 0.004,
    of_each_shape: 1,
    stiffnesses_n_m3: &[1e5, 1e6, 1e7],
    speeds_m_s: &[1.0, 2.0, 4.0],
    scales: &[0.25, 0.5, 1.0, 2.0, 4.0, 10.0],
    fillet_seeds: 5,
    drop_seeds: 3,
    headings: 5,
    frictions: &[0.1, 0.3, 0.5, 0.7],
    tilt_rate_deg_s: 3.0,
    strain_rate_1_s: 0.05,
    bed: Bed { radius_m: 0.0075, width_m: 0.15, count: 48, duration_s: 6.0 },
    dry_seeds: 5,
    wet_seeds: 3,
    traction_seeds: 1,
    timestep_bed: Bed { radius_m: 0.0075, width_m: 0.15, count: 48, duration_s: 4.0 },
    timestep_seeds: 5,
};

/// The whole hopper, with about the paper's number of sub-particles.
const STANDARD: Profile = Profile {
    name: "standard",
    stiffnesses_n_m3: &[1e5, 3e5, 1e6, 3e6, 1e7],
    speeds_m_s: &[0.5, 1.0, 2.0, 3.0, 4.0, 6.0],
    scales: &[0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 4.0, 7.0, 10.0],
    drop_seeds: 5,
    frictions: &[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8],
    tilt_rate_deg_s: 1.5,
    strain_rate_1_s: 0.01,
    bed: Bed { radius_m: 0.005, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 6.0 },
    wet_seeds: 5,
    traction_seeds: 2,
    timestep_bed: Bed { radius_m: 0.006, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 4.0 },
    ..QUICK
};

/// The whole hopper with the paper's sub-particles, and 90 fillets per drop.
const FULL: Profile = Profile {
    name: "full",
    of_each_shape: 15,
    stiffnesses_n_m3: &[1e5, 3e5, 6e5, 1e6, 3e6, 6e6, 1e7],
    fillet_seeds: 10,
    strain_rate_1_s: 1.0 / 600.0,
    bed: Bed { radius_m: 0.004, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 6.0 },
    dry_seeds: 8,
    timestep_bed: Bed { radius_m: 0.005, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 4.0 },
    ..STANDARD
};

/// Simulations of a minute in all, for tests.
const TINY: Profile = Profile {
    name: "tiny",
    radius_m: 0.009,
    of_each_shape: 1,
    stiffnesses_n_m3: &[1e6],
    speeds_m_s: &[1.0, 4.0],
    scales: &[1.0, 2.0],
    fillet_seeds: 1,
    drop_seeds: 2,
    headings: 1,
    frictions: &[0.3, 0.5],
    tilt_rate_deg_s: 30.0,
    strain_rate_1_s: 1.0,
    bed: Bed { radius_m: 0.012, width_m: 0.2, count: 6, duration_s: 1.0 },
    dry_seeds: 2,
    wet_seeds: 1,
    traction_seeds: 1,
    timestep_bed: Bed { radius_m: 0.012, width_m: 0.2, count: 2, duration_s: 0.6 },
    timestep_seeds: 2,
};

/// All profiles, in the order of [`Name`].
pub(crate) const PROFILES: [&Profile; 4] = [&QUICK, &STANDARD, &FULL, &TINY];

/// The name of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Name {
    Quick,
    Standard,
    Full,
    Tiny,
}

impl Name {
    pub(crate) fn profile(self) -> &'static Profile {
        PROFILES[self as usize]
    }
}

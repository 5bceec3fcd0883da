//! How much is simulated: the same figures for ten minutes, two hours or a night.

use clap::ValueEnum;

/// The sizes of everything that a report simulates.
#[derive(Debug)]
pub(super) struct Profile {
    pub(super) name: &'static str,
    /// Sub-particle radius of single fillets, in metres.
    pub(super) radius_m: f64,
    /// Fillets of a drop: so many of each of the six shapes.
    pub(super) of_each_shape: u32,
    /// Stiffnesses per area that Fig. 7 and 9 cross, normal and shear alike, rising, in N/m³.
    pub(super) stiffnesses_n_m3: &'static [f64],
    /// Speeds of impact of Fig. 11, rising, in m/s.
    pub(super) speeds_m_s: &'static [f64],
    /// Scales of Fig. 12, rising.
    pub(super) scales: &'static [f64],
    /// Seeds of bending at Table 2.
    pub(super) fillet_seeds: u64,
    /// Seeds of each drop: every fillet's angles are drawn by them.
    pub(super) drop_seeds: u64,
    /// Seeds of sliding, each another heading.
    pub(super) headings: u64,
    /// Coefficients of friction of Fig. 8, rising.
    pub(super) frictions: &'static [f64],
    /// Rate at which the plate of Fig. 8 is tilted, in °/s.
    pub(super) tilt_rate_deg_s: f64,
    /// Rate of strain of Fig. 6, in 1/s.
    pub(super) strain_rate_1_s: f64,
    /// The hopper of Fig. 13, 14 and Table 3.
    pub(super) bed: Bed,
    /// Seeds of the dry hopper, and of the wet one.
    pub(super) dry_seeds: u64,
    pub(super) wet_seeds: u64,
    /// Seeds of the dry hopper with less friction on the belt, or with more adhesion.
    pub(super) traction_seeds: u64,
    /// The hopper that the time step is judged on.
    pub(super) proof: Bed,
    pub(super) proof_seeds: u64,
}

/// A hopper or a slice of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Bed {
    /// Sub-particle radius, in metres.
    pub(super) radius_m: f64,
    /// Inner width, in metres.
    pub(super) width_m: f64,
    /// Fillets.
    pub(super) count: u32,
    /// Belt time, in seconds.
    pub(super) duration_s: f64,
}

/// Inner width of the whole hopper, in metres: derived from 33.2 kg in 4 s.
pub(super) const WHOLE_WIDTH_M: f64 = 0.59;

/// A slice of the hopper, coarse; single fillets as in the paper; few of everything.
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
    proof: Bed { radius_m: 0.0075, width_m: 0.15, count: 48, duration_s: 4.0 },
    proof_seeds: 5,
};

/// The whole hopper, as many sub-particles as in the paper's.
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
    proof: Bed { radius_m: 0.006, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 4.0 },
    ..QUICK
};

/// As the paper: its sub-particles in the hopper too, 90 fillets a drop.
const FULL: Profile = Profile {
    name: "full",
    of_each_shape: 15,
    stiffnesses_n_m3: &[1e5, 3e5, 6e5, 1e6, 3e6, 6e6, 1e7],
    fillet_seeds: 10,
    strain_rate_1_s: 1.0 / 600.0,
    bed: Bed { radius_m: 0.004, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 6.0 },
    dry_seeds: 8,
    proof: Bed { radius_m: 0.005, width_m: WHOLE_WIDTH_M, count: 191, duration_s: 4.0 },
    ..STANDARD
};

/// A minute's worth of nothing, for tests.
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
    proof: Bed { radius_m: 0.012, width_m: 0.2, count: 2, duration_s: 0.6 },
    proof_seeds: 2,
};

/// All of them.
pub(super) const PROFILES: [&Profile; 4] = [&QUICK, &STANDARD, &FULL, &TINY];

/// The name of a profile.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(super) enum Name {
    Quick,
    Standard,
    Full,
    Tiny,
}

impl Name {
    pub(super) fn profile(self) -> &'static Profile {
        PROFILES[self as usize]
    }
}

//! The typed scenario: complete, every default written out. What a field may hold, its unit, default and
//! source stand in the field table ([`super::fields::FIELDS`]).

use serde::{Deserialize, Serialize};

/// The complete input of one simulation, every default written out. SI units; t = 0 is belt start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Always [`super::SCHEMA`].
    pub schema: String,
    /// The family of scenarios this one belongs to.
    pub experiment: Experiment,
    /// The fillets: how many, of what size, made of what sub-particles.
    pub product: Product,
    /// Elastic constants of the tissue (Table 2).
    pub material: Material,
    /// The bonds between the sub-particles of a fillet.
    pub bonds: Bonds,
    /// The contacts between fillets and with the equipment.
    pub contact: Contact,
    /// Hopper, gate and belt.
    pub equipment: Equipment,
    /// Time step, duration, sampling and stopping.
    pub numerics: Numerics,
    /// Seed of everything drawn at random; at most 2^53 - 1.
    pub seed: u64,
}

/// A family of scenarios.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Experiment {
    /// Bulk discharge of a hopper by a belt under a gate (sections 2.4 and 3.4).
    Hopper,
}

/// The fillets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// Number of fillets. Fillet `i` has shape `i mod (2 * sizes)`: each size and its mirror image in turn.
    pub count: u32,
    /// Length, width and thickness of each size, in metres (Table 1).
    pub sizes_m: Vec<[f64; 3]>,
    /// Radius of a sub-particle, in metres.
    pub subparticle_radius_m: f64,
    /// Which lattice points become sub-particles.
    pub fill: Fill,
    /// Density of a fillet, in kg/m³; null when `subparticle_density_kg_m3` is given.
    pub density_kg_m3: Option<f64>,
    /// Density of a sub-particle, in kg/m³ (Table 2 has 2200); null when `density_kg_m3` is used.
    pub subparticle_density_kg_m3: Option<f64>,
}

/// Which lattice points of a shape become sub-particles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Fill {
    /// Those whose centre lies inside the surface.
    Centres,
    /// Those whose whole sphere lies inside the surface.
    WholeSpheres,
}

/// Elastic constants of the tissue (Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Material {
    /// Young's modulus, in pascal.
    pub youngs_modulus_pa: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
}

/// The bonds between the sub-particles of a fillet (eq. 6, Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bonds {
    /// How the bond force is formed.
    pub formulation: Formulation,
    /// Sub-particle types: 2 bonds only differing types (a checkerboard), 1 all within reach (Fig. 2).
    pub types: u32,
    /// Normal stiffness per unit area S_n, in N/m³.
    pub normal_stiffness_n_m3: f64,
    /// Shear stiffness per unit area S_t, in N/m³.
    pub shear_stiffness_n_m3: f64,
    /// Contact radius over sub-particle radius; a bond breaks beyond twice the contact radius.
    pub contact_radius_ratio: f64,
    /// Bond disk radius over sub-particle radius (R_b / R).
    pub disk_scale: f64,
    /// Whether bonded neighbours also act on each other by contact, as in the commercial model.
    pub contact_between_bonded: bool,
    /// Normal strength, in pascal; null is unbreakable by stress (the paper's 1e300 Pa).
    pub normal_strength_pa: Option<f64>,
    /// Shear strength, in pascal; null is unbreakable by stress.
    pub shear_strength_pa: Option<f64>,
}

/// How the bond force is formed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Formulation {
    /// Total normal force, incremental shear force that turns with the bond.
    Corotated,
    /// One raw force vector accumulated in the global frame and never turned.
    AsPublished,
    /// Corotated, with a normal force that grows without bound towards the breaking length.
    FiniteExtension,
}

/// The contacts between fillets and with the equipment (Table 2).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Contact {
    /// Dry or wet fillets: chooses other defaults below, nothing else.
    pub condition: Condition,
    /// Between sub-particles.
    pub fillet_fillet: PairContact,
    /// Between sub-particles and walls, gate and back plate.
    pub fillet_equipment: PairContact,
    /// Between sub-particles and the belt.
    pub fillet_belt: PairContact,
}

/// Surface condition of the fillets.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Condition {
    /// Normal fillets.
    Dry,
    /// Fillets with water added.
    Wet,
}

/// The parameters of one kind of contact.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PairContact {
    /// Coulomb coefficient of friction.
    pub static_friction: f64,
    /// Coefficient of restitution.
    pub restitution: f64,
    /// Interfacial surface energy γ, in J/m².
    pub surface_energy_j_m2: f64,
}

/// Hopper, gate and belt. The dimensions of the paper's Fig. 5 are derived (see ARCHITECTURE.md).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Equipment {
    /// Height of the gate's lower edge above the belt, in metres.
    pub gate_opening_m: f64,
    /// Inner width of the hopper across the belt (y), in metres.
    pub hopper_width_m: f64,
    /// Inner length of the hopper along the belt (x) at the belt, in metres.
    pub hopper_length_m: f64,
    /// Height of the hopper walls above the belt, in metres.
    pub hopper_height_m: f64,
    /// Slope of the back wall from the vertical, opening upwards, in degrees.
    pub wall_slope_deg: f64,
    /// The two walls along the belt.
    pub side_walls: SideWalls,
    /// Speed of the belt from t = 0 on, in m/s.
    pub belt_speed_m_s: f64,
    /// Whether a shutter closes the opening until the belt starts.
    pub shutter_while_filling: bool,
}

/// The two walls along the belt.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SideWalls {
    /// With the friction of the equipment.
    Rough,
    /// Without friction: a slice of a wide hopper.
    Frictionless,
    /// No walls: what leaves on one side enters on the other.
    Periodic,
}

/// Time step, duration, sampling and stopping.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Numerics {
    /// Time step.
    pub timestep_s: Timestep,
    /// Simulated time from belt start, in seconds.
    pub duration_s: f64,
    /// Interval between samples, in seconds.
    pub output_interval_s: f64,
    /// What ends a run before its duration.
    pub stop: Stop,
    /// Acceleration of gravity, in m/s².
    pub gravity_m_s2: f64,
    /// The bed is at rest once all but one in a thousand of its sub-particles are slower than this, in m/s.
    pub rest_speed_m_s: f64,
    /// A fill that has not come to rest after this long ends the run, in seconds.
    pub max_fill_s: f64,
    /// A sub-particle faster than this makes the run `unstable`, in m/s.
    pub speed_limit_m_s: f64,
    /// Run time steps past the stability limit, as a stability study needs.
    pub allow_unstable: bool,
}

/// A time step: a number of seconds, or `"auto"` for the largest safe one.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged)]
pub enum Timestep {
    /// Seconds.
    Fixed(f64),
    /// Chosen from stiffness, mass and damping.
    Auto(Auto),
}

/// The word `"auto"`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Auto {
    /// The only value.
    Auto,
}

/// What ends a run before its duration.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stop {
    /// Stop once every fillet has left.
    pub when_empty: bool,
    /// Stop once nothing has passed the gate for this long, in seconds; null never.
    pub when_jammed_s: Option<f64>,
}

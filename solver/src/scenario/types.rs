//! The typed scenario: complete, every default written out. What a field may hold, its unit, default and
//! source stand in the field table ([`super::fields::FIELDS`]).

use serde::{Deserialize, Serialize};

pub use crate::mesh::Units;

/// The complete input of one simulation, every default written out. SI units; t = 0 is belt start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Scenario {
    /// Always [`super::SCHEMA`].
    pub schema: String,
    /// The family of scenarios this one belongs to, with the section of its own.
    #[serde(flatten)]
    pub experiment: Experiment,
    /// The fillets: how many, of what size, made of what sub-particles.
    pub product: Product,
    /// Elastic constants of the tissue (Table 2).
    pub material: Material,
    /// The bonds between the sub-particles of a fillet.
    pub bonds: Bonds,
    /// The contacts between fillets and with the equipment.
    pub contact: Contact,
    /// Time step, duration, sampling and stopping.
    pub numerics: Numerics,
    /// Seed of everything drawn at random; at most 2^53 - 1.
    pub seed: u64,
}

/// A family of scenarios; in JSON, the word under `experiment` and a section of its name (the hopper's is `equipment`).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "experiment", rename_all = "snake_case")]
pub enum Experiment {
    /// Bulk discharge of a hopper by a belt under a gate (sections 2.4 and 3.4).
    Hopper {
        /// Hopper, gate and belt.
        equipment: Equipment,
    },
    /// Fillets that hit a plate (section 2.3.3).
    Drop {
        /// Speed and orientation.
        drop: Drop,
    },
    /// A fillet that bends under its own weight (section 2.3.2).
    Bend {
        /// What it is held by.
        bend: Bend,
    },
    /// A fillet on a plate that is tilted (section 2.3.2).
    Slide {
        /// How the plate is tilted.
        slide: Slide,
    },
    /// A block of tissue between plates (section 2.3.2).
    Compress {
        /// The block and how it is compressed.
        compress: Compress,
    },
    /// Bodies and surfaces, freely placed.
    Scene {
        /// All of them.
        scene: FreeScene,
    },
}

impl Scenario {
    /// Hopper, gate and belt, if this is the hopper.
    pub fn equipment(&self) -> Option<&Equipment> {
        match &self.experiment {
            Experiment::Hopper { equipment } => Some(equipment),
            _ => None,
        }
    }

    /// The meshes that it names, each with the pointer of where.
    pub fn named_meshes(&self) -> Vec<(String, &MeshRef)> {
        let (list, surfaces): (_, &[SurfaceSpec]) = match &self.experiment {
            Experiment::Hopper { equipment } => ("/equipment/surfaces", &equipment.surfaces),
            Experiment::Scene { scene } => ("/scene/surfaces", &scene.surfaces),
            _ => ("", &[]),
        };
        let of_surfaces = surfaces.iter().enumerate().filter_map(|(index, surface)| {
            surface.mesh.as_ref().map(|mesh| (format!("{list}/{index}/mesh"), mesh))
        });
        let of_product = self.product.mesh.iter().map(|mesh| ("/product/mesh".to_owned(), mesh));
        of_product.chain(of_surfaces).collect()
    }

    /// Digests of the mesh files that it names, each once, sorted.
    pub fn meshes(&self) -> Vec<&str> {
        let mut digests: Vec<&str> =
            self.named_meshes().into_iter().map(|(_, mesh)| mesh.digest.as_str()).collect();
        digests.sort_unstable();
        digests.dedup();
        digests
    }
}

/// Fillets that hit a plate: orientation, and speed at the plate.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Drop {
    /// Downward speed at which fillets reach the plate, in m/s.
    pub speed_m_s: f64,
    /// First turn, about the vertical, in degrees.
    pub yaw_deg: f64,
    /// Second turn, about the fillet's width, in degrees.
    pub pitch_deg: f64,
    /// Third turn, about the fillet's length, in degrees.
    pub roll_deg: f64,
    /// Greatest random deviation of each of the three, in degrees.
    pub scatter_deg: f64,
}

/// A fillet that bends under its own weight.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Bend {
    /// What it is held by.
    pub support: Support,
    /// Radius of the bar or of the roller at the conveyor's end, in metres.
    pub bar_radius_m: f64,
    /// Speed of the conveyor, in m/s.
    pub belt_speed_m_s: f64,
    /// Share of the fillet's length that is held.
    pub clamped_share: f64,
    /// Greatest random deviation of the yaw, in degrees.
    pub scatter_deg: f64,
}

/// What a bending fillet is held by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Support {
    /// Laid across a bar, both ends hanging.
    OverBar,
    /// Carried off the end of a conveyor.
    OffLedge,
    /// Held at its blunt end.
    Clamped,
}

/// A fillet on a plate that is tilted.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slide {
    /// Rate of tilting, in degrees a second.
    pub tilt_rate_deg_s: f64,
    /// Greatest tilt, in degrees.
    pub max_tilt_deg: f64,
    /// Heading of the fillet, in degrees; 0 points its length up the slope.
    pub yaw_deg: f64,
    /// Greatest random deviation of the heading, in degrees.
    pub scatter_deg: f64,
}

/// A block of tissue between plates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Compress {
    /// Sub-particles along x, y and z.
    pub lattice: [u32; 3],
    /// Rate of strain, in 1/s.
    pub strain_rate_1_s: f64,
    /// Strain at which the test ends.
    pub max_strain: f64,
    /// Start of the window of the modulus.
    pub modulus_from_strain: f64,
    /// End of the window of the modulus.
    pub modulus_to_strain: f64,
    /// Plates with friction or without.
    pub plates: Plates,
}

/// The plates of a compression test.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Plates {
    /// With the friction of the equipment.
    Rough,
    /// Without friction.
    Frictionless,
}

/// Bodies and surfaces, freely placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FreeScene {
    /// Direction of gravity, of any length.
    pub gravity_direction: [f64; 3],
    /// What goes this far beyond all that is there at the start leaves, in metres.
    pub margin_m: f64,
    /// The bodies.
    pub bodies: Vec<BodySpec>,
    /// The surfaces.
    pub surfaces: Vec<SurfaceSpec>,
}

/// A body of a scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodySpec {
    /// Its shape: 2 · (number of the size), plus 1 for the mirror image.
    pub shape: u32,
    /// Where its centre of mass starts, in metres.
    pub position_m: [f64; 3],
    /// Yaw, pitch and roll, in degrees.
    pub orientation_deg: [f64; 3],
    /// Its velocity at the start, in m/s.
    pub velocity_m_s: [f64; 3],
}

/// A surface of a scene, or one added to the hopper's.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfaceSpec {
    /// Its name.
    pub name: String,
    /// Its triangles from CAD, unless it is a plate.
    pub mesh: Option<MeshRef>,
    /// A corner and two edges, in metres, unless it is a mesh.
    pub plate_m: Option<[[f64; 3]; 3]>,
    /// Whose contact parameters it takes.
    pub kind: SurfaceMaterial,
    /// A Coulomb coefficient of its own.
    pub static_friction: Option<f64>,
    /// Where the origin of its triangles lies, in metres.
    pub position_m: [f64; 3],
    /// Yaw, pitch and roll about that origin, in degrees.
    pub orientation_deg: [f64; 3],
    /// How it moves from t = 0 on.
    pub motion: MotionKind,
    /// Velocity of the belt's material or of the pivot, in m/s.
    pub velocity_m_s: [f64; 3],
    /// Angular velocity about the pivot, in degrees a second.
    pub spin_deg_s: [f64; 3],
    /// Point that it turns about, where it is at t = 0, in metres.
    pub pivot_m: [f64; 3],
    /// When it is there.
    pub presence: PresenceKind,
}

/// A mesh by the digest of its file.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshRef {
    /// blake3 of the STL file, in hex.
    pub digest: String,
    /// The unit of its coordinates, which an STL file does not tell.
    pub units: Units,
}

/// Whose contact parameters a surface takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SurfaceMaterial {
    /// `contact.fillet_equipment`.
    Equipment,
    /// `contact.fillet_belt`.
    Belt,
    /// `contact.fillet_equipment` without friction.
    Frictionless,
}

/// How a surface moves from t = 0 on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum MotionKind {
    /// Not at all.
    Fixed,
    /// Its material runs along it.
    Belt,
    /// It moves and turns as a whole.
    Moving,
}

/// When a surface is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PresenceKind {
    /// All the time.
    Always,
    /// Until t = 0.
    UntilStart,
}

/// The fillets.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Product {
    /// Number of fillets. Fillet `i` has shape `i mod (2 * sizes)`: each size and its mirror image in turn.
    pub count: u32,
    /// Length, width and thickness of each size, in metres (Table 1).
    pub sizes_m: Vec<[f64; 3]>,
    /// The one shape that all fillets have; null takes each in turn.
    pub shape: Option<u32>,
    /// A closed mesh in place of the teardrops.
    pub mesh: Option<MeshRef>,
    /// Scale of fillets and sub-particles alike.
    pub scale: f64,
    /// Radius of a sub-particle, in metres.
    pub subparticle_radius_m: f64,
    /// Which lattice points become sub-particles.
    pub fill: Fill,
    /// Density of a fillet, in kg/m³; null when `subparticle_density_kg_m3` is given.
    pub density_kg_m3: Option<f64>,
    /// Density of a sub-particle, in kg/m³ (Table 2 has 2200); null when `density_kg_m3` is used.
    pub subparticle_density_kg_m3: Option<f64>,
}

impl Product {
    /// Radius of a sub-particle after scaling, in metres.
    pub fn radius_m(&self) -> f64 {
        self.subparticle_radius_m * self.scale
    }

    /// Length, width and thickness of each size after scaling, in metres.
    pub fn scaled_sizes_m(&self) -> impl Iterator<Item = [f64; 3]> + '_ {
        self.sizes_m.iter().map(|size| size.map(|edge| edge * self.scale))
    }

    /// Number of shapes that `shape` and a body's shape may name: each size and its mirror image, or the mesh.
    pub fn shapes(&self) -> u32 {
        if self.mesh.is_some() { 1 } else { 2 * self.sizes_m.len() as u32 }
    }
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
    /// Whether belt, walls, gate and shutter are made from these fields.
    pub parametric: bool,
    /// Further surfaces.
    pub surfaces: Vec<SurfaceSpec>,
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
    /// Stop once what the run measures is known.
    pub when_done: bool,
}

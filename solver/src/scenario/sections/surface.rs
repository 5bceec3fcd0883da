//! Surfaces of a scene, or added to the hopper's.

use serde::{Deserialize, Serialize};

pub use crate::mesh::Units;
use crate::scenario::field::{Field, FieldKind, Preset, from_to};
use crate::scenario::row::{ANGLE, FRICTION, ORIGIN, PLACE, SPEED, choice, field, nullable, vector};

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

/// The pointer under which the table holds the fields of a surface, whatever list it is in.
pub(in crate::scenario) const ITEMS: &str = "/scene/surfaces/*";

/// Its fields in the table.
#[rustfmt::skip]
pub(in crate::scenario) const FIELDS: &[Field] = &[
    field("/scene/surfaces/*/name", FieldKind::Text, "", Preset::Required, "assumed",
        "Name of the surface in messages and series. Two surfaces must not have the same name."),
    field("/scene/surfaces/*/mesh", FieldKind::Mesh, "", Preset::Null, "assumed",
        "Triangles of the surface, from an STL file. Set either `mesh` or `plate_m`. The normal of a triangle is a direction at a right \
         angle to the triangle. If the normals of a closed part point outwards, the part is solid. If fillets are inside a closed box, the \
         normals of the box must point inwards."),
    field("/scene/surfaces/*/plate_m", FieldKind::Plate(PLACE), "m", Preset::Null, "assumed",
        "Flat plate (parallelogram), instead of `mesh`: one corner, and two edges as vectors from this corner."),
    choice("/scene/surfaces/*/kind", &["equipment", "belt", "frictionless"], "Table 2",
        "Kind of the surface, which selects its contact parameters. `equipment`: the parameters of `/contact/fillet_equipment`. `belt`: \
         the parameters of `/contact/fillet_belt`. `frictionless`: as `equipment`, but without friction."),
    nullable("/scene/surfaces/*/static_friction", "", FRICTION, "assumed",
        "Coulomb coefficient of friction of this surface. Null: the coefficient follows from `kind`."),
    vector("/scene/surfaces/*/position_m", "m", ORIGIN, PLACE, "assumed",
        "Position of the surface. Roost moves the origin of the surface's triangles to this position."),
    vector("/scene/surfaces/*/orientation_deg", "°", ORIGIN, ANGLE, "assumed",
        "Rotation of the surface about `position_m` by three angles: first yaw (about z), then pitch (about the turned y axis), then \
         roll (about the turned x axis)."),
    choice("/scene/surfaces/*/motion", &["fixed", "belt", "moving"], "assumed",
        "Motion of the surface from t = 0 on. `fixed`: no motion. `belt`: the surface stays in its place, but its material runs like a \
         belt. `moving`: the whole surface moves and turns."),
    vector("/scene/surfaces/*/velocity_m_s", "m/s", ORIGIN, SPEED, "assumed",
        "For the motion `belt`: velocity of the belt's material. For the motion `moving`: velocity of the pivot, which is the point about \
         which the surface turns."),
    vector("/scene/surfaces/*/spin_deg_s", "°/s", ORIGIN, from_to(-36_000.0, 36_000.0), "assumed",
        "For the motion `moving`: angular velocity of the surface about the pivot, as a vector."),
    vector("/scene/surfaces/*/pivot_m", "m", ORIGIN, PLACE, "assumed",
        "For the motion `moving`: position of the pivot at t = 0. The pivot is the point about which the surface turns."),
    choice("/scene/surfaces/*/presence", &["always", "until_start"], "assumed",
        "Time during which the surface exists. `always`: during the whole simulation. `until_start`: only before t = 0, like a shutter."),
];

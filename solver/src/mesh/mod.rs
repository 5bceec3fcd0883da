//! Triangles from CAD files, and geometry of triangles.
//!
//! [`stl`] reads a file, [`Meshes`] stores files by digest, [`Mesh`] is a file in metres with its properties.
//! [`mod@weld`], [`bvh`], [`nearest`], [`ray`] and [`mod@winding`] also serve the surfaces that experiments make.

pub mod bvh;
mod collection;
mod error;
pub mod nearest;
pub mod ray;
pub mod stl;
pub mod weld;
pub mod winding;

use std::sync::Arc;

use glam::DVec3;
use serde::{Deserialize, Serialize};

pub use collection::{DIGEST_DIGITS, Meshes, Stl, digest, is_digest};
pub use error::MeshError;
use weld::weld;

/// Maximum size of a file, in bytes: enough for [`MAX_TRIANGLES`] as ASCII.
pub const MAX_FILE_BYTES: usize = 64 * 1024 * 1024;
/// Maximum number of triangles of a file.
pub const MAX_TRIANGLES: usize = 200_000;
/// Minimum of the longest side of a mesh's box, in metres.
pub const MIN_SIZE_M: f64 = 1e-3;
/// Maximum of the longest side of a mesh's box, in metres.
pub const MAX_SIZE_M: f64 = 100.0;
/// Twice the area up to which a triangle is degenerate, in m².
pub const NO_AREA_M2: f64 = 1e-14;

/// Units of the numbers in a file, which STL does not state.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Units {
    /// Millimetres.
    Mm,
    /// Metres.
    M,
}

impl Units {
    /// Length of one unit, in metres.
    pub fn in_metres(self) -> f64 {
        match self {
            Self::Mm => 1e-3,
            Self::M => 1.0,
        }
    }
}

/// The triangles of a file in metres, with their properties.
#[derive(Clone, Debug, PartialEq)]
pub struct Mesh {
    /// Corners in metres, welded: neighbours share corners to the bit. Triangles with coinciding corners are
    /// dropped. Triangles with collinear corners stay, since they close seams.
    pub triangles: Arc<[[DVec3; 3]]>,
    /// Digest of the file, see [`digest`].
    pub digest: String,
    /// Units that were assumed for the file.
    pub units: Units,
    /// Degenerate triangles of the file. They have no area and no contact.
    pub degenerate: usize,
    /// Edges with an odd number of triangles: rims and holes. A closed mesh has none.
    pub open_edges: usize,
    /// Edges with an even number of triangles, not half of them in each direction: neighbours that face
    /// opposite ways.
    pub turned_edges: usize,
    /// Enclosed volume in m³, negative when the triangles face inwards. Meaningless for an open or
    /// misoriented mesh.
    pub signed_volume_m3: f64,
    /// Corner of its box with the smallest coordinates, in metres.
    pub low: DVec3,
    /// The opposite corner, in metres.
    pub high: DVec3,
}

impl Mesh {
    /// A mesh from at least one triangle in a file's units.
    ///
    /// # Errors
    /// A size outside the limits for these units, or no triangle with an area.
    fn new(triangles: &[[DVec3; 3]], digest: &str, units: Units) -> Result<Self, MeshError> {
        let found = triangles.len();
        let mut triangles: Vec<[DVec3; 3]> =
            triangles.iter().map(|corners| corners.map(|corner| corner * units.in_metres())).collect();
        let corners = || triangles.iter().flatten().copied();
        let low = corners().fold(DVec3::INFINITY, DVec3::min);
        let high = corners().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size_m = high - low;
        if !(MIN_SIZE_M..=MAX_SIZE_M).contains(&size_m.max_element()) {
            return Err(MeshError::Size { size_m: size_m.to_array(), units });
        }
        let welded = weld(&triangles);
        let solid = |[a, b, c]: &[u32; 3]| a != b && b != c && c != a;
        let kept: Vec<[u32; 3]> = welded.triangles.into_iter().filter(solid).collect();
        triangles.clear();
        triangles.extend(kept.iter().map(|corners| corners.map(|k| welded.points[k as usize])));
        let areas = triangles.iter().filter(|triangle| doubled_area(triangle) > NO_AREA_M2).count();
        if areas == 0 {
            return Err(MeshError::AllDegenerate { triangles: found });
        }
        let (open_edges, turned_edges) = edges(&kept);
        let centre = (low + high) / 2.0;
        let wedge = |t: &[DVec3; 3]| (t[0] - centre).dot((t[1] - centre).cross(t[2] - centre)) / 6.0;
        Ok(Self {
            signed_volume_m3: triangles.iter().map(wedge).sum(),
            triangles: triangles.into(),
            digest: digest.to_owned(),
            units,
            degenerate: found - areas,
            open_edges,
            turned_edges,
            low,
            high,
        })
    }

    /// Whether it encloses a volume: no rims, no holes.
    pub fn is_closed(&self) -> bool {
        self.open_edges == 0
    }

    /// Whether all triangles face the same way.
    pub fn is_oriented(&self) -> bool {
        self.turned_edges == 0
    }

    /// Sides of its box, in metres.
    pub fn size_m(&self) -> DVec3 {
        self.high - self.low
    }
}

/// Twice the area of a triangle, in m².
pub fn doubled_area([a, b, c]: &[DVec3; 3]) -> f64 {
    (b - a).cross(c - a).length()
}

/// Numbers of open and of misoriented edges.
fn edges(triangles: &[[u32; 3]]) -> (usize, usize) {
    let around = |&[a, b, c]: &[u32; 3]| [(a, b), (b, c), (c, a)];
    let mut edges: Vec<(u32, u32, i32)> = triangles
        .iter()
        .flat_map(around)
        .map(|(from, to)| if from < to { (from, to, 1) } else { (to, from, -1) })
        .collect();
    edges.sort_unstable();
    let (mut open, mut turned) = (0, 0);
    for edge in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        if edge.len() % 2 == 1 {
            open += 1;
        } else if edge.iter().map(|&(.., way)| way).sum::<i32>() != 0 {
            turned += 1;
        }
    }
    (open, turned)
}

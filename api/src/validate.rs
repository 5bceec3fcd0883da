//! Validation without running: what `POST /v1/validate` and `roost validate` answer.

use roost_solver::mesh::Units;
use roost_solver::result::Estimate;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// What a valid document would cost.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ValidationReport {
    /// `scenario` or `sweep`.
    pub document: String,
    /// Jobs it makes.
    pub jobs: u64,
    /// Cost of the scenario, or of the base scenario of the sweep.
    #[schema(value_type = Object)]
    pub estimate: Estimate,
    /// Forecast wall time of all jobs on two cores, one after the other, in seconds; what the store answers takes none of it.
    pub wall_s: f64,
    /// The scenario as it would run, every default written out.
    #[schema(value_type = Object)]
    pub scenario: serde_json::Value,
    /// The meshes that it names, each once; those of a sweep's levels too.
    pub meshes: Vec<MeshReport>,
}

/// A mesh as a scenario reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeshReport {
    /// Where a scenario names it (first).
    pub pointer: String,
    /// Digest of the file.
    pub digest: String,
    /// What the scenario says that its numbers are: `mm` or `m`.
    #[schema(value_type = String)]
    pub units: Units,
    /// Triangles in it.
    pub triangles: u64,
    /// Those without an area, which act on nothing.
    pub degenerate: u64,
    /// Sides of its box, in metres.
    pub size_m: [f64; 3],
    /// Whether it encloses a volume: it has no open edge.
    pub closed: bool,
    /// Edges where an odd number of triangles meet: rims and holes.
    pub open_edges: u64,
    /// Edges between triangles that face opposite ways.
    pub turned_edges: u64,
}

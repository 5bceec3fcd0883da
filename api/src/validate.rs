//! The report of `POST /v1/validate` and `roost validate`.

use roost_solver::mesh::Units;
use roost_solver::result::Estimate;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::forecast::CostForecast;
use crate::solver_documents::EstimateSchema;

/// The cost of a valid document.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ValidationReport {
    /// `scenario`, `sweep` or `study`.
    pub document: String,
    /// Number of jobs; of a study, at most so many.
    pub jobs: u64,
    /// Number of jobs in the best case: of a study, the fewest after which its rule could end it.
    #[serde(default)]
    pub min_jobs: u64,
    /// Of a study whose budget is too small for the asked confidence: the number of runs that the best case needs, in words.
    #[serde(default)]
    pub shortage: Option<String>,
    /// Runs, processor time and time of completion as ranges; null where the server makes no forecast.
    #[serde(default)]
    pub forecast: Option<CostForecast>,
    /// Cost of the scenario, or of the base scenario of the sweep or study.
    #[schema(value_type = EstimateSchema)]
    pub estimate: Estimate,
    /// Predicted wall time of all jobs on two cores, one after another, in seconds. Cached results take no time. 0 for a study whose runs
    /// clients make.
    pub wall_s: f64,
    /// The scenario with all defaults.
    #[schema(value_type = Object)]
    pub scenario: serde_json::Value,
    /// The meshes that the document names, also in levels, each once.
    pub meshes: Vec<MeshReport>,
}

/// A mesh as a scenario reads it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MeshReport {
    /// Pointer of the first field that names it.
    pub pointer: String,
    /// Digest of the file.
    pub digest: String,
    /// Unit of its numbers by the scenario: `mm` or `m`.
    #[schema(value_type = String)]
    pub units: Units,
    /// Number of triangles.
    pub triangles: u64,
    /// Triangles without an area, which have no effect.
    pub degenerate: u64,
    /// Size of its bounding box in x, y and z, in metres.
    pub size_m: [f64; 3],
    /// Lowest and highest corner of its box in the axes of the scenario, in metres, after `orientation_deg` and `position_m` of the first
    /// surface that names it. Rounded to a micrometre. Null for the shape of a product.
    #[serde(default)]
    pub placed_m: Option<[[f64; 3]; 2]>,
    /// Whether it encloses a volume, without open edges.
    pub closed: bool,
    /// Edges of an odd number of triangles, as at holes.
    pub open_edges: u64,
    /// Edges between triangles of opposite orientation.
    pub turned_edges: u64,
}

//! Measurements: results of laboratory tests, each beside the scenario that simulates the test.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// The schema of measurements.
pub const SCHEMA: &str = "roost.measurements/1";

/// Measurements of one product.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Measurements {
    /// `roost.measurements/1`, or left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub schema: Option<String>,
    /// A name for people, of at most 256 bytes.
    #[schema(max_length = 256)]
    pub name: String,
    /// The person or laboratory that measured, and the date; or a citation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub source: Option<String>,
    /// The tests.
    pub tests: Vec<LabTest>,
}

/// A test in a laboratory or a kitchen, with its replicates.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct LabTest {
    /// Its name, of at most 256 bytes; no other test has it.
    #[schema(max_length = 256)]
    pub name: String,
    /// The scenario that simulates the test; fields that are left out have their defaults.
    #[schema(value_type = Object)]
    pub scenario: Value,
    /// Conditions as text, such as temperature, moisture and surface: at most 64, with names and texts of at most 256 bytes.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub conditions: BTreeMap<String, String>,
    /// The results of the test.
    pub measured: Measured,
}

/// The results of a test: at least one.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Measured {
    /// Single numbers.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub responses: Vec<MeasuredResponse>,
    /// Curves.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curves: Vec<MeasuredCurve>,
}

/// A measured number: either its `values`, or their mean, standard deviation and number.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredResponse {
    /// The response of the experiment that it is compared with.
    pub response: String,
    /// Unit of the numbers: that of the response, or one that is converted to it. Left out for a response without a unit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub unit: Option<String>,
    /// The number of each replicate.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub values: Option<Vec<f64>>,
    /// Mean of the replicates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mean: Option<f64>,
    /// Standard deviation of the replicates, with n − 1. A single value needs one from elsewhere, such as the instrument's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<f64>,
    /// Number of replicates.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1)]
    pub n: Option<u32>,
}

/// A measured curve: either `points`, or the text of a CSV file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredCurve {
    /// The quantity along the curve, such as `strain` or `time`.
    pub x: String,
    /// Its unit; left out without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub x_unit: Option<String>,
    /// The measured quantity, such as `stress`: a curve or series of the experiment.
    pub y: String,
    /// Its unit; left out without one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub y_unit: Option<String>,
    /// The points, strictly rising in x.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub points: Option<Vec<MeasuredPoint>>,
    /// The text of a CSV file with the columns `x`, `mean`, `deviation` and `n`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub table: Option<String>,
}

/// A point of a measured curve.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredPoint {
    /// Place along the curve, in `x_unit`.
    pub x: f64,
    /// Mean of the replicates, in `y_unit`.
    pub mean: f64,
    /// Standard deviation of the replicates, in `y_unit`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub deviation: Option<f64>,
    /// Number of replicates.
    #[schema(minimum = 1)]
    pub n: u32,
}

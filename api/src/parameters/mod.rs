//! The parameter library: published properties of meat, poultry and fish for fields of the scenario.
//!
//! The data is `library.json`. Each entry is an interval with its source and conditions, or says that no interval is published and
//! names the test that measures it. `tests/parameters.rs` holds the entries to the field table, and generates `docs/reference/parameters.md`.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The data, as text.
const LIBRARY: &str = include_str!("library.json");

/// Properties by field, with their sources.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterLibrary {
    /// Format: `roost.parameters/1`.
    pub schema: String,
    /// Sources, which entries name by `key`.
    pub sources: Vec<ParameterSource>,
    /// The entries.
    pub entries: Vec<ParameterEntry>,
}

/// A publication.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterSource {
    /// Name by which entries refer to the source.
    pub key: String,
    /// Short name, such as authors and year.
    pub short: String,
    /// Authors, year, title and journal, as far as the page that was read states them.
    pub citation: String,
    /// Address of the page that was read, or its DOI.
    pub url: String,
    /// Part of the publication that was read.
    pub read: String,
}

/// A property of a product: an interval, or the test that would measure it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ParameterEntry {
    /// JSON pointers of the scenario's fields.
    pub fields: Vec<String>,
    /// Product.
    pub product: String,
    /// Surface or product that it touches; empty without one.
    pub counterpart: String,
    /// Whether the entry has an interval.
    pub status: ParameterStatus,
    /// Conditions of the measurement, and how the interval follows from the published numbers.
    pub conditions: String,
    /// Unit of the numbers: that of the fields.
    pub unit: String,
    /// Lower end.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// Published deviation of the replicates.
    pub deviation: Option<f64>,
    /// Published number of replicates.
    pub n: Option<u32>,
    /// Without an interval: a value that was published without a deviation.
    pub single_value: Option<f64>,
    /// Key of the source.
    pub source: String,
    /// Section, table or figure of the source.
    pub place: String,
    /// Relation of the property to the parameter of the model.
    pub mapping: String,
    /// Test that measures the property.
    pub test: ParameterTest,
}

/// Whether an interval is published.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterStatus {
    /// The entry has an interval.
    Interval,
    /// No interval was found in a source that could be read.
    NotPublished,
}

/// A test of `docs/howto/kitchen-tests.md`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ParameterTest {
    /// A piece on a plate that is tilted.
    Slide,
    /// A piece over a bar.
    Bend,
    /// A block under weights.
    Compress,
    /// A piece that falls onto a plate.
    Drop,
    /// Discharge of a hopper or tray.
    Hopper,
    /// Mass over volume.
    Density,
    /// Force that pulls a piece off a plate.
    Pull,
}

impl ParameterTest {
    /// The word in documents.
    pub fn as_str(self) -> &'static str {
        match self {
            Self::Slide => "slide",
            Self::Bend => "bend",
            Self::Compress => "compress",
            Self::Drop => "drop",
            Self::Hopper => "hopper",
            Self::Density => "density",
            Self::Pull => "pull",
        }
    }
}

impl ParameterLibrary {
    /// The library of this version.
    ///
    /// # Panics
    /// Never: a test reads the same data.
    pub fn of_this_version() -> Self {
        serde_json::from_str(LIBRARY).expect("the library is valid")
    }
}

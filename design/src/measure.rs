//! Measures: the probability of a response, or its mean.

use serde::{Deserialize, Serialize};

use crate::fault::{Fault, fault};

/// A quantity of the runs at a point, for instance `{"probability": "jammed"}` or `{"mean": "rate_kg_s"}`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Measure {
    /// Share of runs whose response is 1; the response is 0 or 1.
    Probability(String),
    /// Mean of a response.
    Mean(String),
}

impl Measure {
    /// The name of the response.
    pub fn response(&self) -> &str {
        match self {
            Self::Probability(response) | Self::Mean(response) => response,
        }
    }

    /// Whether the measure can use a response: 0 or 1 for a probability, any finite number for a mean.
    pub fn accepts(&self, value: f64) -> bool {
        match self {
            Self::Probability(_) => value == 0.0 || value == 1.0,
            Self::Mean(_) => value.is_finite(),
        }
    }

    pub(crate) fn faults(&self, at: &str, faults: &mut Vec<Fault>) {
        if self.response().is_empty() {
            faults.push(fault(at, self, "the response has no name", "the name of a response"));
        }
    }
}

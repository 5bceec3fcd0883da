//! Priors of parameters: what is known of them before the tests.

use serde::{Deserialize, Serialize};

use crate::factor::{Factor, Scale};

/// The prior of a parameter, within the range of its factor.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterPrior {
    /// Name of the parameter.
    pub parameter: String,
    /// Its distribution.
    #[serde(flatten)]
    pub shape: PriorShape,
}

/// A distribution, cut off at the ends of the range.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PriorShape {
    /// Normal.
    Normal {
        /// Mean, in the unit of the field.
        mean: f64,
        /// Standard deviation, in the unit of the field.
        deviation: f64,
    },
    /// Log-normal: two thirds of it lie between median / factor and median · factor.
    LogNormal {
        /// Median, in the unit of the field.
        median: f64,
        /// The factor of one standard deviation of the logarithm; above 1.
        factor: f64,
    },
}

/// Log density of a parameter at a coordinate from 0 to 1, up to a constant; 0 without a prior: uniform along the scale.
pub(super) fn ln_density(factor: &Factor, prior: Option<&ParameterPrior>, coordinate: f64) -> f64 {
    let Some(prior) = prior else { return 0.0 };
    let value = factor.place(coordinate);
    // The derivative of the value by the coordinate.
    let ln_slope = match factor.scale {
        Scale::Linear => 0.0,
        Scale::Log => value.ln(),
    };
    match prior.shape {
        PriorShape::Normal { mean, deviation } => ln_slope - 0.5 * ((value - mean) / deviation).powi(2),
        PriorShape::LogNormal { median, factor } => {
            ln_slope - value.ln() - 0.5 * ((value / median).ln() / factor.ln()).powi(2)
        }
    }
}

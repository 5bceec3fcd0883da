//! Priors of parameters: what is known of them before the tests.

use serde::{Deserialize, Serialize};

use crate::factor::{Factor, Scale};

/// The prior of a parameter, cut off at the ends of its range: one of the two distributions.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ParameterPrior {
    /// Name of the parameter.
    pub parameter: String,
    /// Normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub normal: Option<NormalPrior>,
    /// Log-normal.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub log_normal: Option<LogNormalPrior>,
}

/// A normal distribution, in the unit of the field.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NormalPrior {
    /// Mean.
    pub mean: f64,
    /// Standard deviation.
    pub deviation: f64,
}

/// A log-normal distribution: two thirds of it lie between median / factor and median · factor.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LogNormalPrior {
    /// Median, in the unit of the field.
    pub median: f64,
    /// The factor of one standard deviation of the logarithm; above 1.
    pub factor: f64,
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
    let normal = prior
        .normal
        .map_or(0.0, |NormalPrior { mean, deviation }| ln_slope - 0.5 * ((value - mean) / deviation).powi(2));
    let log_normal = prior.log_normal.map_or(0.0, |LogNormalPrior { median, factor }| {
        if value <= 0.0 {
            return f64::NEG_INFINITY;
        }
        ln_slope - value.ln() - 0.5 * ((value / median).ln() / factor.ln()).powi(2)
    });
    normal + log_normal
}

//! Statistics of a few simulations: means and shares with 95 % intervals, runs in groups with parameters of their own, differences of means and other contrasts, straight lines and
//! rank correlations.
//!
//! | symbol | meaning |
//! |---|---|
//! | n, x̄, s | number of values, their mean, their standard deviation (n − 1) |
//! | t(ν) | two-sided 95 % quantile of Student's t distribution with ν degrees of freedom |
//! | interval | x̄ ± t(n − 1) s / √n |
//! | Wilson | share k/n of trials: (k/n + z²/2n ± z √((k/n)(1 − k/n)/n + z²/4n²)) / (1 + z²/n), z the two-sided 95 % quantile of the normal distribution |
//! | Welch | x̄ − ȳ ± t(ν) √(s_x²/n_x + s_y²/n_y), ν after Welch and Satterthwaite |
//! | ρ | Pearson's correlation of ranks; equal values share the mean of their ranks (Spearman) |
//! | p | share of Student's t distribution, ν = n − 2, beyond ρ √((n − 2) / (1 − ρ²)) on both sides |
//!
//! All functions are pure.

mod comparison;
mod contrast;
mod line;
mod nested;
mod sample;
mod share;

pub use comparison::{Difference, ratio, welch};
pub use contrast::{Contrast, Pairing, PointTable, Values};
pub use line::{Line, ROUNDING, line, rank_correlation, rank_correlation_p_value};
pub use nested::Nested;
pub use sample::{ReplicateValues, Sample};
pub use share::{Interval, share_interval};

//! The paper's figures and tables, in its order: a file for each experiment.

pub(super) mod hopper;
pub(super) mod lattice;
pub(super) mod model;
pub(super) mod timestep;

use super::plan::Figure;
use super::profile::Profile;

/// Every figure of a profile.
pub(super) fn all(profile: &Profile) -> Vec<Figure> {
    let mut figures = vec![model::table_1(), lattice::figures_2_and_3(), model::table_2()];
    figures.extend(hopper::figures(profile));
    figures.push(timestep::figure(profile));
    figures
}

//! The paper's figures and tables, in its order: a file for each experiment.

mod bend;
mod compress;
mod drop;
mod hopper;
mod lattice;
mod model;
mod slide;
mod timestep;

use serde_json::{Value, json};

use super::plan::Figure;
use super::profile::Profile;
use crate::ui::plot::{self, Curve, Look, Mark, Panel, Scale};

/// Normal and shear stiffness of Table 2, in N/m³.
const TABLE_2: (f64, f64) = (1e6, 6e5);

/// Every figure of a profile.
pub(super) fn all(profile: &Profile) -> Vec<Figure> {
    let before = [model::table_1(), lattice::figures_2_and_3(), model::table_2()];
    let single = [compress::figure, bend::figure, slide::figure].map(|figure| figure(profile));
    let bulk = hopper::figures(profile).into_iter().chain([timestep::figure(profile)]);
    before.into_iter().chain(single).chain(drop::figures(profile)).chain(bulk).collect()
}

/// Bonds of such stiffnesses, in N/m³.
fn stiffness(normal: f64, shear: f64) -> Value {
    json!({"bonds": {"normal_stiffness_n_m3": normal, "shear_stiffness_n_m3": shear}})
}

/// What runs with such bonds are called.
fn stiffness_name(normal: f64, shear: f64) -> String {
    format!("S_n {normal:e}, S_t {shear:e} N/m³")
}

/// A plot of one quantity over another.
fn plotted(
    x_label: &str,
    y_label: &str,
    x_scale: Scale,
    y_from: Option<f64>,
    curves: Vec<Curve>,
) -> Option<String> {
    let (x_label, y_label) = (x_label.to_owned(), y_label.to_owned());
    plot::svg("", &[Panel { x_label, y_label, x_scale, y_from, curves }]).ok()
}

/// A curve of what was reached.
fn curve(label: &str, look: Look, points: impl Iterator<Item = (f64, Option<f64>)>) -> Curve {
    let points = points.filter_map(|(x, y)| Some((x, y?))).collect();
    Curve { label: label.to_owned(), look, mark: Mark::Joined, points, bars: Vec::new() }
}

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
use super::stats::Sample;
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

/// A curve of means with their 95 % intervals, where there is one.
fn sampled(label: &str, look: Look, points: impl Iterator<Item = (f64, Option<Sample>)>) -> Curve {
    let points: Vec<(f64, Sample)> = points.filter_map(|(x, sample)| Some((x, sample?))).collect();
    Curve {
        label: label.to_owned(),
        look,
        mark: Mark::Joined,
        points: points.iter().map(|(x, sample)| (*x, sample.mean)).collect(),
        bars: points.iter().map(|(_, sample)| sample.half_width().unwrap_or(0.0)).collect(),
    }
}

/// A number to so many decimals, for sentences.
fn rounded(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$}").replace('-', "−")
}

/// A curve of what was reached.
fn curve(label: &str, look: Look, points: impl Iterator<Item = (f64, Option<f64>)>) -> Curve {
    let points = points.filter_map(|(x, y)| Some((x, y?))).collect();
    Curve { label: label.to_owned(), look, mark: Mark::Joined, points, bars: Vec::new() }
}

#[cfg(test)]
mod made_up {
    //! Records of runs that never were, to hold what figures tell against.

    use roost_solver::result::{EndReason, Performance, RunResult, SCHEMA, Series, SolverInfo};
    use roost_solver::scenario;
    use serde_json::{Value, json};

    use crate::reproduce::plan::{Figure, Results, Run, Told};
    use crate::reproduce::profile::Profile;
    use crate::reproduce::record::Record;

    /// What a figure tells of such records, none for a run that failed.
    pub(super) fn told(profile: &Profile, figure: Figure, of: impl Fn(&Run) -> Option<Record>) -> Told {
        let records: Vec<Option<Record>> = figure.runs.iter().map(of).collect();
        let runs = figure.runs.iter().zip(&records).map(|(run, record)| (run.name.as_str(), record.as_ref()));
        (figure.tell)(profile, &Results { runs: runs.collect() })
    }

    /// A record of a scenario with these responses.
    pub(super) fn responses(scenario: &Value, responses: Value) -> Record {
        let scenario = scenario::from_value(scenario).unwrap();
        let result = RunResult {
            schema: SCHEMA.to_owned(),
            end_reason: EndReason::Duration,
            instability: None,
            responses: responses.as_object().unwrap().clone(),
            series: Vec::new(),
            curves: Vec::new(),
            solver: SolverInfo {
                version: String::new(),
                revision: 0,
                backend: "none".to_owned(),
                device: "nowhere".to_owned(),
                threads: 1,
                timestep_s: 1e-4,
            },
            performance: Performance {
                subparticles: 1,
                particle_steps: 1,
                steps: 1,
                wall_s: 1.0,
                ns_per_particle_step: 1.0,
            },
            scenario_digest: scenario.digest(),
            scenario,
        };
        Record { result, machine: "none".to_owned(), shots: Vec::new(), pictures: Vec::new() }
    }

    /// A record of a hopper whose mass out goes through these points, in seconds and kilograms.
    pub(super) fn discharge(points: &[(f64, f64)], filled_kg: f64) -> Record {
        let mut record = responses(&json!({"experiment": "hopper"}), json!({"filled_kg": filled_kg}));
        let (t_s, values) = points.iter().copied().unzip();
        let (name, unit) = ("discharged_mass".to_owned(), "kg".to_owned());
        record.result.series.push(Series { name, unit, t_s, values });
        record
    }

    /// The same, having ended so.
    pub(super) fn ended(mut record: Record, reason: EndReason) -> Record {
        record.result.end_reason = reason;
        record
    }
}

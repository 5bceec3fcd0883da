//! The figures and tables of the paper, in its order: one file per experiment.

mod bend;
mod compress;
mod drop;
mod hopper;
mod lattice;
mod model;
mod slide;
mod timestep;

use roost_stats::Sample;
use roost_terminal::plot::{self, Curve, Markers, Panel, Scale, Style};
use serde_json::{Value, json};

use super::plan::Figure;
use super::profile::Profile;

/// Normal and shear stiffness of Table 2, in N/m³.
const TABLE_2: (f64, f64) = (1e6, 6e5);

/// The rule of the paper for the points of a lattice: those inside the shape. The default of Roost keeps the volume of the shape.
const PAPER_FILL: &str = "centres";

/// Every figure of a profile.
pub(super) fn all(profile: &Profile) -> Vec<Figure> {
    let model = [model::table_1(), lattice::figures_2_and_3(), model::table_2()];
    let single_fillets = [compress::figure, bend::figure, slide::figure].map(|figure| figure(profile));
    let bulk = hopper::figures(profile).into_iter().chain([timestep::figure(profile)]);
    model.into_iter().chain(single_fillets).chain(drop::figures(profile)).chain(bulk).collect()
}

/// Scenario fields for bonds of these stiffnesses, in N/m³.
fn stiffness(normal: f64, shear: f64) -> Value {
    json!({"bonds": {"normal_stiffness_n_m3": normal, "shear_stiffness_n_m3": shear}})
}

/// Name of the runs with these stiffnesses.
fn stiffness_name(normal: f64, shear: f64) -> String {
    format!("S_n {normal:e}, S_t {shear:e} N/m³")
}

/// An SVG plot of one quantity over another.
fn plot_svg(
    x_label: &str,
    y_label: &str,
    x_scale: Scale,
    y_start: Option<f64>,
    curves: Vec<Curve>,
) -> Option<String> {
    let (x_label, y_label) = (x_label.to_owned(), y_label.to_owned());
    plot::svg("", &[Panel { x_label, y_label, x_scale, y_start, curves }]).ok()
}

/// A curve of means with error bars for their 95 % intervals.
fn mean_curve(label: &str, style: Style, points: impl Iterator<Item = (f64, Option<Sample>)>) -> Curve {
    let points: Vec<(f64, Sample)> = points.filter_map(|(x, sample)| Some((x, sample?))).collect();
    Curve {
        label: label.to_owned(),
        style,
        markers: Markers::WithLine,
        points: points.iter().map(|(x, sample)| (*x, sample.mean)).collect(),
        error_bars: points.iter().map(|(_, sample)| sample.half_width().unwrap_or(0.0)).collect(),
    }
}

/// A number with this many decimals, for sentences.
fn rounded(value: f64, decimals: usize) -> String {
    format!("{value:.decimals$}").replace('-', "−")
}

/// A curve of the values there are.
fn curve(label: &str, style: Style, points: impl Iterator<Item = (f64, Option<f64>)>) -> Curve {
    let points = points.filter_map(|(x, y)| Some((x, y?))).collect();
    Curve { label: label.to_owned(), style, markers: Markers::WithLine, points, error_bars: Vec::new() }
}

#[cfg(test)]
mod fixtures {
    //! Invented records, for tests of the evaluation of figures.

    use roost_solver::result::{EndReason, Performance, RunResult, SCHEMA, Series, SolverInfo};
    use roost_solver::scenario;
    use serde_json::{Value, json};

    use crate::plan::{Evaluation, Figure, Results, Run};
    use crate::profile::Profile;
    use crate::record::Record;

    /// The evaluation of a figure whose runs have these records; none for a failed run.
    pub(super) fn evaluate(
        profile: &Profile,
        figure: Figure,
        record_of: impl Fn(&Run) -> Option<Record>,
    ) -> Evaluation {
        let records: Vec<Option<Record>> = figure.runs.iter().map(record_of).collect();
        let runs = figure.runs.iter().zip(&records).map(|(run, record)| (run.name.as_str(), record.as_ref()));
        (figure.evaluate)(profile, &Results { runs: runs.collect() })
    }

    /// A record of a scenario with these responses.
    pub(super) fn record(scenario: &Value, responses: Value) -> Record {
        let scenario = scenario::from_value(scenario).unwrap();
        let result = RunResult {
            schema: SCHEMA.to_owned(),
            end_reason: EndReason::Duration,
            instability: None,
            responses: responses.as_object().unwrap().clone(),
            series: Vec::new(),
            curves: Vec::new(),
            warnings: Vec::new(),
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

    /// A record of a hopper whose discharged mass goes through these points, in seconds and kilograms.
    pub(super) fn discharge_record(points: &[(f64, f64)], filled_kg: f64) -> Record {
        let mut record = record(&json!({"experiment": "hopper"}), json!({"filled_kg": filled_kg}));
        let (t_s, values) = points.iter().copied().unzip();
        let (name, unit) = ("discharged_mass".to_owned(), "kg".to_owned());
        record.result.series.push(Series { name, unit, t_s, values });
        record
    }

    /// The record with another end reason.
    pub(super) fn with_end_reason(mut record: Record, reason: EndReason) -> Record {
        record.result.end_reason = reason;
        record
    }
}

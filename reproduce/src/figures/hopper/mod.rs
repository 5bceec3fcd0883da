//! Table 3, Fig. 13 and 14: bulk discharge at two gate openings, dry and wet.

mod discharge;
mod pouring;
mod regimes;

use roost_solver::result::EndReason;
use roost_terminal::format::significant;
use roost_terminal::plot::{self, Curve, Panel, Style};
use serde_json::{Value, json};

use super::PAPER_FILL;
use crate::plan::{Evaluation, Figure, Illustration, Results, Run};
use crate::profile::{Bed, Profile, WHOLE_WIDTH_M};
use crate::record::Record;
use crate::row::Row;

/// The cells of Table 3: name of the runs, gate opening in metres, condition, and the paper's regime.
const CELLS: [(&str, f64, &str, &str); 4] = [
    ("4.5 cm, dry", 0.045, "dry", "inconsistent"),
    ("4.5 cm, wet", 0.045, "wet", "no flow"),
    ("6 cm, dry", 0.06, "dry", "constant"),
    ("6 cm, wet", 0.06, "wet", "inconsistent"),
];
const NARROW: &str = CELLS[0].0;
const WIDE: &str = CELLS[2].0;

/// All three figures.
pub(super) fn figures(profile: &Profile) -> [Figure; 3] {
    [regimes::figure(profile), pouring::figure(profile), discharge::figure(profile)]
}

/// The runs of all cells of Table 3.
fn cells(profile: &Profile) -> impl Iterator<Item = Run> {
    CELLS.into_iter().flat_map(|(name, opening, condition, _)| {
        let seeds = if condition == "dry" { profile.dry_seeds } else { profile.wet_seeds };
        Run::replicates(name, &scenario(&profile.bed, opening, condition), seeds)
    })
}

/// The scenario of a hopper or a slice of it.
pub(super) fn scenario(bed: &Bed, opening_m: f64, condition: &str) -> Value {
    let is_slice = bed.width_m < WHOLE_WIDTH_M;
    json!({
        "experiment": "hopper",
        "product": {"count": bed.count, "subparticle_radius_m": bed.radius_m, "fill": PAPER_FILL},
        "equipment": {
            "gate_opening_m": opening_m,
            "hopper_width_m": bed.width_m,
            "side_walls": if is_slice { "frictionless" } else { "rough" },
        },
        "contact": {"condition": condition},
        "numerics": {"timestep_s": "auto", "duration_s": bed.duration_s, "stop": {"when_jammed_s": 2.5}},
    })
}

/// Factor from masses of a bed to masses of the whole hopper.
fn scale_to_hopper(bed: &Bed) -> f64 {
    WHOLE_WIDTH_M / bed.width_m
}

/// A description of the bed and the scaling of its masses.
fn bed_text(bed: &Bed) -> String {
    let radius_mm = significant(bed.radius_m * 1e3);
    if bed.width_m < WHOLE_WIDTH_M {
        let width_cm = significant(bed.width_m * 100.0);
        format!("a slice of {width_cm} cm of the hopper, R = {radius_mm} mm; masses scaled to 59 cm")
    } else {
        format!("the whole hopper, R = {radius_mm} mm")
    }
}

/// Discharged mass at a belt time in kilograms, linear between samples. After an empty or jammed end it stays at its last value;
/// after another end it is unknown.
pub(super) fn discharged_kg(record: &Record, t_s: f64) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let after = series.t_s.partition_point(|t| *t < t_s);
    match after {
        0 => series.values.first().copied(),
        after if after == series.t_s.len() => {
            let is_over = matches!(record.result.end_reason, EndReason::Empty | EndReason::Jammed);
            // The last sample may be up to a time step before the end.
            let step = record.result.solver.timestep_s;
            let is_sampled = series.t_s.last().is_some_and(|end| *end >= t_s - step);
            series.values.last().copied().filter(|_| is_over || is_sampled)
        }
        after => {
            let (t, m) = (&series.t_s[after - 1..=after], &series.values[after - 1..=after]);
            Some(m[0] + (m[1] - m[0]) * (t_s - t[0]) / (t[1] - t[0]))
        }
    }
}

/// An evaluation with a plot, if there is one.
fn with_plot(rows: Vec<Row>, findings: Vec<String>, svg: Option<String>, caption: String) -> Evaluation {
    Evaluation {
        rows,
        findings,
        illustrations: svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect(),
    }
}

/// An SVG plot of discharge curves, with a colour per name, and further curves.
fn discharge_plot(results: &Results<'_>, factor: f64, names: &[&str], others: Vec<Curve>) -> Option<String> {
    let mut curves = Vec::new();
    for (colour, name) in names.iter().enumerate() {
        for (number, record) in results.sound_records(name).into_iter().enumerate() {
            let series = record.result.series("discharged_mass")?;
            let points = series.t_s.iter().zip(&series.values).map(|(t, mass)| (*t, factor * mass));
            let label = if number == 0 { (*name).to_owned() } else { String::new() };
            let style = Style { colour, dash: usize::from(name.ends_with("wet")) };
            curves.push(Curve { label, style, points: points.collect(), ..Curve::default() });
        }
    }
    curves.extend(others);
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "discharged mass (kg)".to_owned(),
        curves,
        ..Panel::default()
    };
    plot::svg("", &[panel]).ok()
}

#[cfg(test)]
mod tests {
    use super::super::fixtures;
    use super::*;

    #[test]
    fn discharged_mass_is_interpolated_and_constant_after_a_jam() {
        let record = fixtures::discharge_record(&[(0.0, 0.0), (1.0, 4.0), (2.0, 6.0)], 10.0);
        let masses = |record: &Record| [0.0, 0.5, 1.5, 2.0, 3.0].map(|t| discharged_kg(record, t));
        let known = [Some(0.0), Some(2.0), Some(5.0), Some(6.0)];
        assert_eq!(masses(&record)[..4], known);
        assert_eq!(masses(&record)[4], None, "unknown after the end of the run");
        for reason in [EndReason::Jammed, EndReason::Empty] {
            assert_eq!(masses(&fixtures::with_end_reason(record.clone(), reason))[4], Some(6.0));
        }
        assert_eq!(discharged_kg(&record, 2.0 + 0.9e-4), Some(6.0), "within a time step of the end");
        assert_eq!(discharged_kg(&record, 2.0 + 1.1e-4), None);
    }
}

//! Table 3, Fig. 13 and 14: the bulk discharge, at two openings, dry and wet.

mod discharge;
mod pouring;
mod regimes;

use roost_solver::result::EndReason;
use serde_json::{Value, json};

use crate::reproduce::plan::{Figure, Illustration, Results, Run, Told};
use crate::reproduce::profile::{Bed, Profile, WHOLE_WIDTH_M};
use crate::reproduce::record::Record;
use crate::reproduce::row::Row;
use crate::ui::format::significant;
use crate::ui::plot::{self, Curve, Look, Panel};

/// The cells of Table 3: name of the runs, opening in metres, condition, and the paper's word.
const CELLS: [(&str, f64, &str, &str); 4] = [
    ("4.5 cm, dry", 0.045, "dry", "inconsistent"),
    ("4.5 cm, wet", 0.045, "wet", "no flow"),
    ("6 cm, dry", 0.06, "dry", "constant"),
    ("6 cm, wet", 0.06, "wet", "inconsistent"),
];
const NARROW: &str = CELLS[0].0;
const WIDE: &str = CELLS[2].0;

/// All three.
pub(super) fn figures(profile: &Profile) -> [Figure; 3] {
    [regimes::figure(profile), pouring::figure(profile), discharge::figure(profile)]
}

/// The runs of all cells.
fn cells(profile: &Profile) -> impl Iterator<Item = Run> {
    CELLS.into_iter().flat_map(|(name, opening, condition, _)| {
        let seeds = if condition == "dry" { profile.dry_seeds } else { profile.wet_seeds };
        Run::seeds(name, &scenario(&profile.bed, opening, condition), seeds)
    })
}

/// The bulk experiment in a hopper or a slice of it.
pub(super) fn scenario(bed: &Bed, opening_m: f64, condition: &str) -> Value {
    let is_slice = bed.width_m < WHOLE_WIDTH_M;
    json!({
        "experiment": "hopper",
        "product": {"count": bed.count, "subparticle_radius_m": bed.radius_m},
        "equipment": {
            "gate_opening_m": opening_m,
            "hopper_width_m": bed.width_m,
            "side_walls": if is_slice { "frictionless" } else { "rough" },
        },
        "contact": {"condition": condition},
        "numerics": {"timestep_s": "auto", "duration_s": bed.duration_s, "stop": {"when_jammed_s": 2.5}},
    })
}

/// What masses of a bed are multiplied by to stand for the whole hopper.
fn to_whole(bed: &Bed) -> f64 {
    WHOLE_WIDTH_M / bed.width_m
}

/// Of what the masses are, in words.
fn of_what(bed: &Bed) -> String {
    let radius_mm = significant(bed.radius_m * 1e3);
    if bed.width_m < WHOLE_WIDTH_M {
        let width_cm = significant(bed.width_m * 100.0);
        format!("a slice {width_cm} cm wide of the hopper, R = {radius_mm} mm; masses scaled to 59 cm")
    } else {
        format!("the whole hopper, R = {radius_mm} mm")
    }
}

/// Mass out at a belt time, in kilograms, read as straight between samples. What is empty or jammed keeps its last value; of a run
/// that ended sooner for another reason, nothing is known.
pub(super) fn out_kg(record: &Record, t_s: f64) -> Option<f64> {
    let series = record.result.series("discharged_mass")?;
    let after = series.t_s.partition_point(|t| *t < t_s);
    match after {
        0 => series.values.first().copied(),
        after if after == series.t_s.len() => {
            let is_over = matches!(record.result.end_reason, EndReason::Empty | EndReason::Jammed);
            // The last sample is at the step nearest to the end.
            let step = record.result.solver.timestep_s;
            let is_there = series.t_s.last().is_some_and(|end| *end >= t_s - step);
            series.values.last().copied().filter(|_| is_over || is_there)
        }
        after => {
            let (t, m) = (&series.t_s[after - 1..=after], &series.values[after - 1..=after]);
            Some(m[0] + (m[1] - m[0]) * (t_s - t[0]) / (t[1] - t[0]))
        }
    }
}

/// What is told below discharge curves, if there are any.
fn under_curves(rows: Vec<Row>, findings: Vec<String>, svg: Option<String>, caption: String) -> Told {
    Told {
        rows,
        findings,
        illustrations: svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect(),
    }
}

/// Discharge curves, each name in its colour, and what else the plot shows.
fn curves(results: &Results<'_>, factor: f64, names: &[&str], others: Vec<Curve>) -> Option<String> {
    let mut curves = Vec::new();
    for (colour, name) in names.iter().enumerate() {
        for (number, record) in results.of(name).into_iter().enumerate() {
            let series = record.result.series("discharged_mass")?;
            let points = series.t_s.iter().zip(&series.values).map(|(t, mass)| (*t, factor * mass));
            let label = if number == 0 { (*name).to_owned() } else { String::new() };
            let look = Look { colour, dash: usize::from(name.ends_with("wet")) };
            curves.push(Curve { label, look, points: points.collect(), ..Curve::default() });
        }
    }
    curves.extend(others);
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "mass out (kg)".to_owned(),
        curves,
        ..Panel::default()
    };
    plot::svg("", &[panel]).ok()
}

#[cfg(test)]
mod tests {
    use super::super::made_up;
    use super::*;

    #[test]
    fn masses_are_read_between_samples_and_kept_after_a_jam() {
        let record = made_up::discharge(&[(0.0, 0.0), (1.0, 4.0), (2.0, 6.0)], 10.0);
        let read = |record: &Record| [0.0, 0.5, 1.5, 2.0, 3.0].map(|t| out_kg(record, t));
        let known = [Some(0.0), Some(2.0), Some(5.0), Some(6.0)];
        assert_eq!(read(&record)[..4], known);
        assert_eq!(read(&record)[4], None, "it was not run that far");
        for reason in [EndReason::Jammed, EndReason::Empty] {
            assert_eq!(read(&made_up::ended(record.clone(), reason))[4], Some(6.0));
        }
        assert_eq!(out_kg(&record, 2.0 + 0.9e-4), Some(6.0), "a step short of the end");
        assert_eq!(out_kg(&record, 2.0 + 1.1e-4), None);
    }
}

//! Fig. 11: intact bonds over the speed of impact.

use roost_stats::{ReplicateValues, Sample, welch};
use roost_terminal::format::significant;
use roost_terminal::plot::{Scale, Style};

use super::super::{TABLE_2, mean_curve, plot_svg, rounded, stiffness};
use super::{FAST_M_S, FLAT, MULTIPLES, ON_END, base, fillets_note, impact, intact, replicates};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::{Demand, Row};

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 11",
        title: "Fig. 11: bonds intact over the speed of impact",
        part: Part::Drop,
        paper: "Slower impacts consistently leave more bonds intact. Stiffer bonds break less, up to 100 % intact, but make \
                unrealistically rigid fillets. Points with more than 50 % intact are highlighted as stable.",
        runs: runs(profile),
        evaluate,
    }
}

fn speed_name(multiple: &str, orientation: (&str, f64, f64), speed_m_s: f64) -> String {
    format!("{multiple}, {}, {} m/s", orientation.0, significant(speed_m_s))
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = base(profile);
    let mut runs = Vec::new();
    for (multiple, factor) in MULTIPLES {
        let scaled = with(&base, stiffness(factor * TABLE_2.0, factor * TABLE_2.1));
        for orientation in [FLAT, ON_END] {
            runs.extend(profile.speeds_m_s.iter().flat_map(|speed| {
                let at = with(&scaled, impact(orientation, *speed));
                replicates(profile, &speed_name(multiple, orientation, *speed), &at)
            }));
        }
    }
    runs
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 11";
    let shares = |multiple: &str, orientation| {
        let at = |speed: &f64| (*speed, intact(results, &speed_name(multiple, orientation, *speed)));
        profile.speeds_m_s.iter().map(at).collect::<Vec<_>>()
    };
    let table_2 = MULTIPLES[1].0;
    let slow = shares(table_2, FLAT).into_iter().filter(|(speed, _)| *speed <= FAST_M_S);
    let slow: Option<Vec<Sample>> = slow.map(|(_, share)| share.complete_sample()).collect();
    let minimum = slow.and_then(|slow| slow.into_iter().min_by(|a, b| a.mean.total_cmp(&b.mean)));
    let mut rows = vec![
        Row::new(NAME, "minimum share of bonds intact, flat, up to 4 m/s, Table 2", "")
            .sample(minimum)
            .demand(Demand::AtLeast(0.99))
            .note("mean share at the impact speed at which this mean share is smallest"),
    ];
    for (speed, share) in shares(table_2, ON_END) {
        let quantity = format!("share of bonds intact on end at {} m/s, Table 2", significant(speed));
        let name = speed_name(table_2, ON_END, speed);
        rows.push(
            Row::new(NAME, quantity, "").replicates(&share).note(fillets_note(profile, results, &name)),
        );
    }
    for (multiple, papers) in [
        (MULTIPLES[2].0, "a larger share than with softer bonds"),
        (MULTIPLES[0].0, "a smaller share than with stiffer bonds"),
    ] {
        let name = speed_name(multiple, ON_END, FAST_M_S);
        rows.push(
            Row::new(NAME, format!("share of bonds intact on end at 4 m/s, {multiple}"), "")
                .paper(papers)
                .replicates(&intact(results, &name))
                .note(fillets_note(profile, results, &name)),
        );
    }
    let lines = || MULTIPLES.into_iter().flat_map(|(multiple, _)| [FLAT, ON_END].map(|o| (multiple, o)));
    let mut findings = Vec::new();
    for (multiple, orientation) in lines() {
        let line = shares(multiple, orientation);
        let rises = rises(&line);
        let n = line.iter().map(|(_, share)| share.values.len()).sum();
        rows.push(
            Row::new(
                NAME,
                format!(
                    "number of steps at which more bonds stay intact at the higher speed than at the lower speed, {multiple}, {}",
                    orientation.0
                ),
                "",
            )
            .paper("none")
            .value(Some(rises.len() as f64), n)
            .note(format!(
                "there are {} steps; an increase counts only if its whole 95 % interval (Welch) is above 0",
                line.len().saturating_sub(1)
            )),
        );
        findings.extend(rises.into_iter().map(|((from, before), (to, after))| {
            format!(
                "“Slower impacts consistently leave more intact” does not hold for {multiple}, {}: {} % at {} m/s, {} % at {} m/s. One \
                 in forty such comparisons is wrong by chance.",
                orientation.0,
                rounded(100.0 * before, 1),
                significant(from),
                rounded(100.0 * after, 1),
                significant(to)
            )
        }));
    }
    let points: Vec<Sample> = lines()
        .flat_map(|(multiple, o)| shares(multiple, o))
        .filter_map(|(_, share)| share.sample())
        .collect();
    let stable = points.iter().filter(|share| share.mean > 0.5).count();
    rows.push(
        Row::new(NAME, "number of points with more than half of the bonds intact", "")
            .paper("highlighted as stable")
            .value(Some(stable as f64), points.iter().map(|share| share.n).sum())
            .note(format!(
                "there are {} points; a point is a combination of stiffness, orientation and speed",
                points.len()
            )),
    );
    let curves = MULTIPLES.into_iter().enumerate().flat_map(|(colour, (multiple, _))| {
        [FLAT, ON_END].into_iter().enumerate().map(move |(dash, orientation)| {
            let label = format!("{multiple}, {}", if dash == 0 { "flat" } else { "on end" });
            (label, Style { colour, dash }, multiple, orientation)
        })
    });
    let curves = curves.map(|(label, style, multiple, orientation)| {
        let points = shares(multiple, orientation).into_iter().map(|(speed, share)| (speed, share.sample()));
        mean_curve(&label, style, points)
    });
    let svg = plot_svg(
        "speed of impact (m/s)",
        "share of bonds intact",
        Scale::Linear,
        Some(0.9),
        curves.collect(),
    );
    let illustrations =
        svg.map(|svg| Illustration::new(svg, "Share of bonds intact over the speed of impact."));
    Evaluation { rows, illustrations: illustrations.into_iter().collect(), findings }
}

/// A speed, and the mean share of intact bonds.
type SpeedShare = (f64, f64);

/// Steps between neighbouring speeds with a significant rise of the share of intact bonds.
fn rises(line: &[(f64, ReplicateValues)]) -> Vec<(SpeedShare, SpeedShare)> {
    let step = |pair: &[(f64, ReplicateValues)]| {
        let (before, after) = (pair[0].1.sample()?, pair[1].1.sample()?);
        welch(&after, &before)?.is_rise().then_some(((pair[0].0, before.mean), (pair[1].0, after.mean)))
    };
    line.windows(2).filter_map(step).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::super::super::fixtures;
    use super::*;
    use crate::profile::PROFILES;

    fn at(speed: f64, mean: f64) -> (f64, ReplicateValues) {
        (speed, ReplicateValues { values: vec![mean - 0.015625, mean, mean + 0.015625], planned: 3 })
    }

    #[test]
    fn rise_is_larger_than_the_scatter_of_seeds() {
        assert_eq!(rises(&[at(1.0, 0.99), at(2.0, 0.95), at(4.0, 0.96)]), []);
        assert_eq!(rises(&[at(1.0, 1.0), at(2.0, 0.75), at(4.0, 0.875)]), [((2.0, 0.75), (4.0, 0.875))]);
        let alone = (2.0, ReplicateValues { values: vec![0.5], planned: 1 });
        assert_eq!(rises(&[alone, at(4.0, 0.95)]), [], "a single run has no interval");
    }

    #[test]
    fn demand_judges_the_worst_speed_and_findings_report_rises() {
        let evaluation = |worst: f64| {
            fixtures::evaluate(PROFILES[0], figure(PROFILES[0]), |run| {
                let share = if run.scenario["drop"]["speed_m_s"] == 2.0 { worst } else { 1.0 };
                let share = share - 1e-4 * run.scenario["seed"].as_f64().unwrap();
                Some(fixtures::record(&run.scenario, json!({"bonds_intact_fraction": share})))
            })
        };
        let (good, bad) = (evaluation(0.995), evaluation(0.4));
        assert_eq!((good.rows[0].holds, bad.rows[0].holds), (Some(true), Some(false)));
        assert_eq!(
            bad.findings.len(),
            6,
            "from 2 to 4 m/s, at each stiffness and orientation: {:?}",
            bad.findings
        );
        let stable = |evaluation: &Evaluation| evaluation.rows.last().unwrap().measured.as_f64();
        assert_eq!((stable(&good), stable(&bad)), (Some(18.0), Some(12.0)));
    }
}

//! The proof of the time step: mean discharge curves of the paper's step and of the largest safe one do not differ.

use serde_json::json;

use super::hopper::{out_kg, scenario};
use super::{rounded, sampled};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::Row;
use crate::reproduce::stats::{Difference, Seeds, welch};
use crate::ui::format::significant;
use crate::ui::plot::{self, Look, Panel};

const NAME: &str = "Time step";
const PAPERS: &str = "5.75e-5 s";
const AUTO: &str = "auto";
/// The paper's time step, in seconds.
const PAPERS_STEP_S: f64 = 5.75e-5;
/// Differences under this many per cent of the filled mass do not matter.
const NEGLIGIBLE: f64 = 3.0;

/// The proof.
pub(super) fn figure(profile: &Profile) -> Figure {
    let base = scenario(&profile.proof, 0.06, "dry");
    let at_papers = with(&base, json!({"numerics": {"timestep_s": PAPERS_STEP_S}}));
    let auto = Run::seeds(AUTO, &base, profile.proof_seeds);
    let papers = Run::seeds(PAPERS, &at_papers, profile.proof_seeds);
    Figure {
        name: NAME,
        title: "The time step",
        part: Part::Hopper,
        paper: "The paper steps by 5.75e-5 s and does not say how it was chosen. The solver's `auto` picks a larger step, and \
                this report uses it: here is what that changes.",
        runs: auto.into_iter().chain(papers).collect(),
        tell: told,
    }
}

/// Mass out at a time as a share of the filled mass, for each seed.
fn shares(results: &Results<'_>, name: &str, t_s: f64) -> Seeds {
    results.seeds_of(name, |record| Some(out_kg(record, t_s)? / record.response("filled_kg")?))
}

/// Whether a difference, in per cent of the filled mass, does not matter or cannot be told from none.
fn agrees(difference: Difference) -> bool {
    difference.mean.abs() < NEGLIGIBLE || difference.holds(0.0)
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    let halves = (profile.proof.duration_s * 2.0) as u32;
    let times: Vec<f64> = (1..=halves).map(|half| f64::from(half) / 2.0).collect();
    let mut rows = Vec::new();
    for &t in &times {
        let (auto, papers) = (shares(results, AUTO, t).times(100.0), shares(results, PAPERS, t).times(100.0));
        let difference = auto.of_all().zip(papers.of_all()).and_then(|(auto, papers)| welch(&auto, &papers));
        let holds = difference.is_some_and(agrees);
        let quantity =
            format!("difference of the mean mass out at {} s, auto less 5.75e-5 s", significant(t));
        let row = Row::new(NAME, quantity, "% of the filled mass");
        let row = row.difference_of(difference, auto.values.len() + papers.values.len());
        let row = row.demand_in_words("less than 3 %, or than its 95 % interval (Welch)", holds);
        let is_wide = difference.is_some_and(|difference| difference.half_width > NEGLIGIBLE);
        rows.push(if is_wide { row.note("with so wide an interval it tells little") } else { row });
    }
    let step = |name| results.first(name).map(|record| record.result.solver.timestep_s);
    rows.push(Row::new(NAME, "time step that `auto` takes", "s").paper(PAPERS_STEP_S).one(step(AUTO)));
    let curve = |name: &str, colour| {
        let samples = times.iter().map(|t| (*t, shares(results, name, *t).times(100.0).sample()));
        sampled(name, Look { colour, dash: 0 }, samples)
    };
    let panel = Panel {
        x_label: "time from belt start (s)".to_owned(),
        y_label: "mean mass out (% of filled)".to_owned(),
        curves: vec![curve(AUTO, 0), curve(PAPERS, 1)],
        ..Panel::default()
    };
    let caption = format!(
        "Mean over {} seeds each, with 95 % intervals: {} fillets in a hopper {} cm wide, R = {} mm.",
        profile.proof_seeds,
        profile.proof.count,
        significant(profile.proof.width_m * 100.0),
        significant(profile.proof.radius_m * 1e3),
    );
    let svg = plot::svg("", &[panel]).ok();
    let illustrations = svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect();
    let spread = |name: &str| {
        let sample = shares(results, name, *times.last()?).times(100.0).sample()?;
        Some(format!("{} with {name}", rounded(sample.deviation?, 1)))
    };
    let findings = spread(AUTO).zip(spread(PAPERS)).map(|(auto, papers)| {
        format!(
            "Seeds alone make masses differ: their standard deviation at {} s, in % of the filled mass, is {auto}, {papers}. So \
             means are compared, and not runs.",
            significant(profile.proof.duration_s)
        )
    });
    Told { rows, illustrations, findings: findings.into_iter().collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::reproduce::figures::made_up;

    #[test]
    fn a_difference_may_be_small_or_drowned() {
        let of = |mean, half_width| agrees(Difference { mean, half_width });
        assert!(of(-2.9, 0.1) && of(5.0, 6.0), "negligible, or within its interval");
        assert!(!of(5.0, 4.0) && !of(-5.0, 4.0));
    }

    /// Rows of differences, where `auto` discharges so much of 10 kg a second and the paper's step 2 kg.
    fn rows(auto_kg_s: f64, is_lost: bool) -> Vec<Row> {
        let profile = crate::reproduce::profile::PROFILES[0];
        let told = made_up::told(profile, figure(profile), |run| {
            let rate = if run.name == AUTO { auto_kg_s } else { 2.0 };
            let rate = rate + 0.01 * run.scenario["seed"].as_f64().unwrap();
            let record = made_up::discharge(&[(0.0, 0.0), (4.0, 4.0 * rate)], 10.0);
            (!is_lost || run.name != AUTO || run.scenario["seed"] != 1).then_some(record)
        });
        told.rows.into_iter().filter(|row| row.quantity.contains("difference")).collect()
    }

    #[test]
    fn means_over_all_seeds_are_compared() {
        let same = rows(2.1, false);
        assert_eq!(same[0].holds, Some(true));
        assert!((same[0].measured.as_f64().unwrap() - 0.5).abs() < 1e-6, "0.05 kg of 10: {same:?}");
        assert_eq!(rows(3.0, false)[0].holds, Some(false), "5 %");
        assert_eq!(rows(2.1, true)[0].holds, Some(false), "a seed that is missing");
    }
}

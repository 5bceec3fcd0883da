//! The proof of the time step: mean discharge curves of the paper's step and of the largest safe one do not differ.

use super::hopper::{at_timestep, out_kg, scenario};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::Row;
use crate::reproduce::stats::{Sample, welch};
use crate::ui::format::significant;
use crate::ui::plot::{self, Curve, Look, Mark, Panel};

const NAME: &str = "Time step";
const PAPERS: &str = "5.75e-5 s";
const AUTO: &str = "auto";
/// The paper's time step, in seconds.
const PAPERS_STEP_S: f64 = 5.75e-5;
/// Differences under this share of the filled mass do not matter.
const NEGLIGIBLE: f64 = 0.03;

/// The proof.
pub(super) fn figure(profile: &Profile) -> Figure {
    let base = scenario(&profile.proof, 0.06, "dry");
    let auto = Run::seeds(AUTO, &base, profile.proof_seeds);
    let papers = Run::seeds(PAPERS, &at_timestep(&base, PAPERS_STEP_S), profile.proof_seeds);
    Figure {
        name: NAME,
        title: "The time step",
        part: Part::Hopper,
        paper: "The paper steps by 5.75e-5 s, 1 % of the Rayleigh time. The solver's `auto` picks a larger step, and this \
                report uses it: here is what that changes.",
        runs: auto.into_iter().chain(papers).collect(),
        tell: told,
    }
}

/// Mass out at a time as a share of the filled mass, for each seed.
fn shares(results: &Results<'_>, name: &str, t_s: f64) -> Option<Sample> {
    let share = |record: &&_| Some(out_kg(record, t_s)? / record.response("filled_kg")?);
    Sample::of(&results.of(name).iter().filter_map(share).collect::<Vec<_>>())
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    let halves = (profile.proof.duration_s * 2.0) as u32;
    let times: Vec<f64> = (1..=halves).map(|half| f64::from(half) / 2.0).collect();
    let mut rows = Vec::new();
    for &t in &times {
        let pair = shares(results, AUTO, t).zip(shares(results, PAPERS, t));
        let difference = pair.as_ref().and_then(|(auto, papers)| welch(auto, papers));
        let holds = difference.is_some_and(|d| d.mean.abs() < NEGLIGIBLE || d.mean.abs() < d.half_width);
        let quantity =
            format!("difference of the mean mass out at {} s, auto less 5.75e-5 s", significant(t));
        let mut row = Row::new(NAME, quantity, "% of the filled mass");
        row.measured = difference.map(|d| 100.0 * d.mean).into();
        row.half_width_95 = difference.map(|d| 100.0 * d.half_width);
        row.n = pair.map_or(0, |(auto, papers)| auto.n + papers.n);
        rows.push(row.demand_in_words("less than 3 %, or than its 95 % interval (Welch)", holds));
    }
    let step = |name| results.first(name).map(|record| record.result.solver.timestep_s);
    rows.push(Row::new(NAME, "time step that `auto` takes", "s").paper(PAPERS_STEP_S).one(step(AUTO)));
    let curve = |name: &str, colour| {
        let samples = times.iter().filter_map(|t| Some((*t, shares(results, name, *t)?)));
        let samples: Vec<(f64, Sample)> = samples.collect();
        Curve {
            label: name.to_owned(),
            look: Look { colour, dash: 0 },
            mark: Mark::Joined,
            points: samples.iter().map(|(t, sample)| (*t, 100.0 * sample.mean)).collect(),
            bars: samples.iter().map(|(_, sample)| 100.0 * sample.half_width().unwrap_or(0.0)).collect(),
        }
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
    let seeds = "Discharge is chaotic: two runs of the same step with other seeds differ as much. Only means can be compared.";
    Told { rows, illustrations, findings: vec![seeds.to_owned()] }
}

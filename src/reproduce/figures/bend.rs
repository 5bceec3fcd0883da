//! Fig. 7: how far a fillet bends under its own weight, over the stiffness of its bonds.

use serde_json::{Value, json};

use super::{TABLE_2, curve, plotted, stiffness, stiffness_name};
use crate::reproduce::picture::{Picture, Shot, View, When};
use crate::reproduce::plan::{Figure, Illustration, Part, Results, Run, Told, with};
use crate::reproduce::profile::Profile;
use crate::reproduce::row::{Demand, Row};
use crate::ui::format::significant;
use crate::ui::plot::{Curve, Look, Mark, Scale};

/// Size 2, as a shape of the product.
const SIZE_2: u32 = 2;
/// The fillets at Table 2 lie askew by up to this much, drawn by the seed, in degrees.
const SCATTER_DEG: f64 = 10.0;
/// Two angles may differ by this much and count as the same, in degrees.
const SAME_DEG: f64 = 2.0;
/// Radii of thinner bars, in metres.
const BARS_M: [f64; 2] = [0.01, 0.005];
/// How much larger coarse sub-particles are.
const COARSE: f64 = 1.5;
/// Moments of the pictures of a fillet that leaves a conveyor, in seconds.
const LEAVING_S: [f64; 3] = [0.2, 0.4, 0.6];

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 7",
        title: "Fig. 7: bend angle over stiffness",
        part: Part::Bend,
        paper: "The softer the bonds, normal or shear, the larger the bend angle. Real fillets bend by more than 120°, which \
                takes low stiffnesses. Fig. 4 shows a fillet that rolls off a conveyor's end.",
        runs: runs(profile),
        tell: told,
    }
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = json!({
        "experiment": "bend",
        "product": {"shape": SIZE_2, "subparticle_radius_m": profile.radius_m},
        "numerics": {"timestep_s": "auto"},
    });
    let pictured =
        |name: &str, scenario: &Value| Run::new(name, scenario.clone()).shot(Shot::side(When::Last));
    let askew = with(&base, json!({"bend": {"scatter_deg": SCATTER_DEG}}));
    let mut runs = Run::seeds("Table 2", &askew, profile.fillet_seeds);
    runs.push(pictured("straight", &base));
    for (size, shape) in [(1, 0), (3, 4)] {
        runs.push(Run::new(format!("size {size}"), with(&base, json!({"product": {"shape": shape}}))));
    }
    for radius_m in BARS_M {
        runs.push(Run::new(bar_name(radius_m), with(&base, json!({"bend": {"bar_radius_m": radius_m}}))));
    }
    runs.push(Run::new(
        "coarse",
        with(&base, json!({"product": {"subparticle_radius_m": COARSE * profile.radius_m}})),
    ));
    let grid = profile.stiffnesses_n_m3;
    for (normal, shear) in grid.iter().flat_map(|n| grid.iter().map(|s| (*n, *s))) {
        let run = Run::new(stiffness_name(normal, shear), with(&base, stiffness(normal, shear)));
        let is_stiffest = Some((&normal, &shear)) == grid.last().zip(grid.last());
        runs.push(if is_stiffest { run.shot(Shot::side(When::Last)) } else { run });
    }
    let ledge = with(&base, json!({"bend": {"support": "off_ledge"}}));
    runs.push(
        LEAVING_S
            .into_iter()
            .fold(Run::new("off a ledge", ledge), |run, t| run.shot(Shot::side(When::At(t)))),
    );
    runs
}

fn bar_name(radius_m: f64) -> String {
    format!("bar of {} mm", significant(radius_m * 1e3))
}

/// The bend angle of a run whose bonds have all held, in degrees.
fn held_deg(results: &Results<'_>, name: &str) -> Option<f64> {
    let intact = results.value(name, "bonds_intact_fraction")?;
    results.value(name, "bend_angle_deg").filter(|_| intact >= 1.0)
}

/// Along lines of rising stiffness: how many steps there are between neighbours, and how many of them go up.
fn rises(lines: &[Vec<Option<f64>>]) -> (usize, usize) {
    let steps = lines.iter().flat_map(|line| {
        let known: Vec<f64> = line.iter().flatten().copied().collect();
        known.windows(2).map(|pair| pair[1] > pair[0] + SAME_DEG).collect::<Vec<_>>()
    });
    steps.fold((0, 0), |(all, rises), is_rise| (all + 1, rises + usize::from(is_rise)))
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 7";
    let grid = profile.stiffnesses_n_m3;
    let angle = |normal: f64, shear: f64| held_deg(results, &stiffness_name(normal, shear));
    let of_normal: Vec<Vec<_>> = grid.iter().map(|s| grid.iter().map(|n| angle(*n, *s)).collect()).collect();
    let of_shear: Vec<Vec<_>> = grid.iter().map(|n| grid.iter().map(|s| angle(*n, *s)).collect()).collect();
    let falls = |quantity: &str, lines: &[Vec<Option<f64>>]| {
        let (steps, rises) = rises(lines);
        let row = Row::new(NAME, quantity, "").paper("none").from_all(Some(rises as f64), steps);
        row.demand(Demand::AtMost(0.0)).note(format!(
            "of {steps} steps between neighbours of the grid where all bonds hold; {} ° more is a rise",
            significant(SAME_DEG)
        ))
    };
    let mut rows = vec![
        Row::new(NAME, "bend angle of size 2 over a bar, Table 2", "°")
            .paper("> 120")
            .many(&results.values("Table 2", "bend_angle_deg"))
            .demand(Demand::Above(120.0))
            .note(format!("turning of the centre line between its ends, over a bar of 20 mm radius; askew by up to {SCATTER_DEG} °")),
        Row::new(NAME, "the same, laid straight across", "°").paper("> 120").one(results.value("straight", "bend_angle_deg")),
    ];
    for radius_m in BARS_M {
        let name = bar_name(radius_m);
        let row = Row::new(NAME, format!("the same over a {name}"), "°").paper("> 120");
        rows.push(row.one(results.value(&name, "bend_angle_deg")));
    }
    let coarse_mm = significant(COARSE * profile.radius_m * 1e3);
    rows.push(
        Row::new(NAME, format!("the same with R = {coarse_mm} mm"), "°")
            .paper("> 120")
            .one(results.value("coarse", "bend_angle_deg"))
            .note("fewer layers over the thickness bend further"),
    );
    for size in ["size 1", "size 3"] {
        rows.push(
            Row::new(NAME, format!("the same of {size}"), "°").one(results.value(size, "bend_angle_deg")),
        );
    }
    let held = of_normal.iter().flatten().flatten().count();
    rows.push(
        Row::new(NAME, "pairs of stiffnesses at which all bonds hold", "")
            .from_all(Some(held as f64), grid.len() * grid.len())
            .note(format!(
                "of a grid of {} from {:e} to {:e} N/m³",
                grid.len() * grid.len(),
                grid[0],
                grid[grid.len() - 1]
            )),
    );
    rows.extend([
        falls("steps to a larger angle as S_n grows", &of_normal),
        falls("steps to a larger angle as S_t grows", &of_shear),
        Row::new(NAME, "largest bend angle while it leaves a conveyor, Table 2", "°")
            .one(results.value("off a ledge", "largest_bend_angle_deg"))
            .note("Fig. 4c and d, which the paper compares by eye"),
    ]);
    let short = results.values("Table 2", "bend_angle_deg").iter().any(|angle| *angle <= 120.0);
    let finding = format!(
        "The angle depends on the bar that one hangs a fillet over, which the paper does not have, and on how many layers of \
         sub-particles a fillet is thick. With R = {} mm over a bar of 20 mm radius it stays short of 120°.",
        significant(profile.radius_m * 1e3)
    );
    let findings = if short { vec![finding] } else { Vec::new() };
    Told { rows, illustrations: illustrations(profile, results), findings }
}

fn illustrations(profile: &Profile, results: &Results<'_>) -> Vec<Illustration> {
    let grid = profile.stiffnesses_n_m3;
    let each = grid.iter().enumerate().map(|(colour, shear)| {
        let points = grid.iter().map(|normal| (*normal, held_deg(results, &stiffness_name(*normal, *shear))));
        curve(&format!("S_t {shear:e} N/m³"), Look { colour, dash: 0 }, points)
    });
    let point = std::iter::once((TABLE_2.0, held_deg(results, "straight")));
    let table_2 = Curve { mark: Mark::Alone, ..curve("Table 2", Look { colour: 6, dash: 0 }, point) };
    let curves = each.chain([table_2]).collect();
    let svg = plotted("normal stiffness S_n (N/m³)", "bend angle (°)", Scale::Log, None, curves);
    let caption = "Bend angle over stiffness; pairs that break bonds have no point.";
    let mut shown: Vec<Illustration> = svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect();
    let stiffest = grid.last().map(|most| stiffness_name(*most, *most)).unwrap_or_default();
    let draw = |picture: &Picture| picture.svg("a fillet that bends", 270.0);
    for (name, caption) in
        [("straight", "Over the bar at Table 2."), (&*stiffest, "Over the bar with the stiffest bonds.")]
    {
        let picture = results.first(name).and_then(|record| record.picture(View::Side, When::Last));
        shown.extend(picture.map(|picture| Illustration::new(draw(picture), caption)));
    }
    for t in LEAVING_S {
        let picture = results.first("off a ledge").and_then(|record| record.picture(View::Side, When::At(t)));
        let caption = format!("Off a conveyor's end, {} s.", significant(t));
        shown.extend(picture.map(|picture| Illustration::new(draw(picture), caption)));
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rises_are_counted_between_those_that_are_known() {
        let lines =
            [vec![Some(150.0), Some(151.0), Some(90.0)], vec![Some(80.0), None, Some(90.0)], vec![Some(5.0)]];
        assert_eq!(rises(&lines), (3, 1), "1° is no rise, 10° across a gap is one");
    }
}

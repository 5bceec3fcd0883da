//! Fig. 7: how far a fillet bends under its own weight, over the stiffness of its bonds.

use serde_json::{Value, json};

use super::model::extent_m;
use super::{TABLE_2, curve, plotted, rounded, stiffness, stiffness_name};
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
                takes low stiffnesses. S_n far over S_t is unstable whatever the time step, down to 1e-10 s; S_t far over S_n \
                only breaks more bonds (see Fig. 9). Fig. 4 shows a fillet that rolls off a conveyor's end.",
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

/// How a fillet hangs whose bonds have all held: bend angle and by how much it still swings, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hangs {
    angle: f64,
    swing: f64,
}

fn held(results: &Results<'_>, name: &str) -> Option<Hangs> {
    let value = |response| results.value(name, response);
    value("bonds_intact_fraction").filter(|intact| *intact >= 1.0)?;
    Some(Hangs { angle: value("bend_angle_deg")?, swing: value("bend_swing_deg")? })
}

/// Steps between neighbours along lines of rising stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Steps {
    all: usize,
    /// Those to a larger angle, the swings about both angles not reaching each other.
    rises: usize,
    /// The most that an angle rises by in a step, swings or no swings, in degrees; 0 where all fall.
    largest_deg: f64,
}

fn steps(lines: &[Vec<Option<Hangs>>]) -> Steps {
    let pairs = lines.iter().flat_map(|line| line.windows(2)).filter_map(|pair| pair[0].zip(pair[1]));
    pairs.fold(Steps::default(), |steps, (from, to)| Steps {
        all: steps.all + 1,
        rises: steps.rises + usize::from(to.angle - to.swing > from.angle + from.swing),
        largest_deg: steps.largest_deg.max(to.angle - from.angle),
    })
}

/// By how much it still swings, in words.
fn swings(results: &Results<'_>, name: &str) -> String {
    let swing = results.seeds(name, "bend_swing_deg").range();
    swing.map_or_else(String::new, |(_, most)| format!("swings by up to ± {}° still", rounded(most, 1)))
}

fn told(profile: &Profile, results: &Results<'_>) -> Told {
    const NAME: &str = "Fig. 7";
    let grid = profile.stiffnesses_n_m3;
    let angle = |normal: f64, shear: f64| held(results, &stiffness_name(normal, shear));
    let of_normal: Vec<Vec<_>> = grid.iter().map(|s| grid.iter().map(|n| angle(*n, *s)).collect()).collect();
    let of_shear: Vec<Vec<_>> = grid.iter().map(|n| grid.iter().map(|s| angle(*n, *s)).collect()).collect();
    let falls = |quantity: &str, lines: &[Vec<Option<Hangs>>]| {
        let steps = steps(lines);
        let row = Row::new(NAME, quantity, "")
            .paper("none")
            .overall((steps.all > 0).then_some(steps.rises as f64), steps.all);
        row.demand(Demand::AtMost(0.0)).note(format!(
            "of {} steps between next neighbours of the grid where all bonds hold, beyond what both still swing by; the largest \
             rise of a mean angle, swings apart, is {}°",
            steps.all,
            rounded(steps.largest_deg, 1)
        ))
    };
    let hangs =
        |row: Row, name: &str| row.seeds(&results.seeds(name, "bend_angle_deg")).note(swings(results, name));
    let [length, ..] = extent_m(1, profile.radius_m).unwrap_or_default();
    let mut rows = vec![
        hangs(Row::new(NAME, "bend angle of size 2 over a bar, Table 2", "°").paper("> 120"), "Table 2")
            .demand(Demand::Above(120.0))
            .note(format!(
                "turning of the centre line between its ends, over a bar of 20 mm radius; askew by up to {SCATTER_DEG}°. Filled at \
                 R = {} mm, size 2 is {} mm long, where Table 1 has 172",
                significant(profile.radius_m * 1e3),
                rounded(length * 1e3, 0)
            )),
        hangs(Row::new(NAME, "the same, laid straight across", "°").paper("> 120"), "straight"),
    ];
    for radius_m in BARS_M {
        let name = bar_name(radius_m);
        rows.push(hangs(Row::new(NAME, format!("the same over a {name}"), "°").paper("> 120"), &name));
    }
    let coarse_mm = significant(COARSE * profile.radius_m * 1e3);
    rows.push(hangs(
        Row::new(NAME, format!("the same with R = {coarse_mm} mm"), "°").paper("> 120"),
        "coarse",
    ));
    for size in ["size 1", "size 3"] {
        rows.push(hangs(Row::new(NAME, format!("the same of {size}"), "°"), size));
    }
    let whole = of_normal.iter().flatten().flatten().count();
    rows.push(
        Row::new(NAME, "pairs of stiffnesses at which all bonds hold", "")
            .overall(Some(whole as f64), grid.len() * grid.len())
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
    let findings = depends(profile, results).into_iter().collect();
    Told { rows, illustrations: illustrations(profile, results), findings }
}

/// What is to be said when fillets bend less than the paper's.
fn depends(profile: &Profile, results: &Results<'_>) -> Option<String> {
    let angle = |name: &str| results.seeds(name, "bend_angle_deg").mean();
    let mean = angle("Table 2").filter(|mean| *mean <= 120.0)?;
    let mut others: Vec<String> = BARS_M
        .iter()
        .filter_map(|radius| Some((angle(&bar_name(*radius))?, radius)))
        .map(|(angle, radius)| format!("{}° over one of {} mm", rounded(angle, 0), significant(radius * 1e3)))
        .collect();
    others.extend(angle("coarse").map(|angle| {
        format!(
            "{}° with sub-particles of {} mm, of which fewer layers make its thickness",
            rounded(angle, 0),
            significant(COARSE * profile.radius_m * 1e3)
        )
    }));
    Some(format!(
        "Over a bar of 20 mm radius a fillet of size 2 with R = {} mm bends by {}°, short of 120°. The paper does not say what its \
         fillets hang over, and that matters: {}.",
        significant(profile.radius_m * 1e3),
        rounded(mean, 0),
        others.join(", ")
    ))
}

fn illustrations(profile: &Profile, results: &Results<'_>) -> Vec<Illustration> {
    let grid = profile.stiffnesses_n_m3;
    let hanging = |label: &str, look, points: Vec<(f64, Option<Hangs>)>| {
        let swings = points.iter().filter_map(|(_, hangs)| Some(hangs.as_ref()?.swing));
        let bars = swings.collect();
        let angles = points.into_iter().map(|(x, hangs)| (x, hangs.map(|hangs| hangs.angle)));
        Curve { bars, ..curve(label, look, angles) }
    };
    let each = grid.iter().enumerate().map(|(colour, shear)| {
        let points = grid.iter().map(|normal| (*normal, held(results, &stiffness_name(*normal, *shear))));
        hanging(&format!("S_t {shear:e} N/m³"), Look { colour, dash: 0 }, points.collect())
    });
    let point = vec![(TABLE_2.0, held(results, "straight"))];
    let table_2 = Curve { mark: Mark::Alone, ..hanging("Table 2", Look { colour: 6, dash: 0 }, point) };
    let curves = each.chain([table_2]).collect();
    let svg = plotted("normal stiffness S_n (N/m³)", "bend angle (°)", Scale::Log, None, curves);
    let caption = "Bend angle over stiffness, with bars from end to end of what still swings; pairs that break bonds have no point.";
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
    fn steps_go_from_neighbour_to_neighbour_and_rise_beyond_swings_only() {
        let at = |angle, swing| Some(Hangs { angle, swing });
        let lines = [
            vec![at(150.0, 1.0), at(153.0, 1.0), at(90.0, 0.5)],
            vec![at(80.0, 0.1), None, at(90.0, 0.1)],
            vec![at(70.0, 4.0), at(77.0, 4.0)],
            vec![at(5.0, 0.1)],
        ];
        assert_eq!(steps(&lines), Steps { all: 3, rises: 1, largest_deg: 7.0 });
        assert_eq!(steps(&lines[3..]), Steps::default());
    }
}

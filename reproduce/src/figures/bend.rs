//! Fig. 7: bend angle of a fillet under its own weight, over the stiffness of its bonds.

use roost_terminal::format::significant;
use roost_terminal::plot::{Curve, Markers, Scale, Style};
use serde_json::{Value, json};

use super::model::extent_m;
use super::{PAPER_FILL, TABLE_2, curve, plot_svg, rounded, stiffness, stiffness_name};
use crate::picture::{Moment, Picture, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part, Results, Run, with};
use crate::profile::Profile;
use crate::row::{Demand, Row};

/// Shape number of size 2.
const SIZE_2: u32 = 2;
/// Maximum angle in degrees by which the seed turns a fillet with Table 2.
const SCATTER_DEG: f64 = 10.0;
/// Radii of thinner bars, in metres.
const BARS_M: [f64; 2] = [0.01, 0.005];
/// Radius of coarse sub-particles over the usual one.
const COARSE: f64 = 1.5;
/// Times of the pictures of a fillet that leaves a conveyor, in seconds.
const LEAVING_S: [f64; 3] = [0.2, 0.4, 0.6];

/// The figure.
pub(super) fn figure(profile: &Profile) -> Figure {
    Figure {
        name: "Fig. 7",
        title: "Fig. 7: bend angle over stiffness",
        part: Part::Bend,
        paper: "The softer the bonds, normal or shear, the larger the bend angle. Real fillets bend by more than 120°, which \
                takes low stiffnesses. S_n far above S_t is unstable at every time step down to 1e-10 s; S_t far above S_n \
                only breaks more bonds (see Fig. 9). Fig. 4 shows a fillet that rolls off the end of a conveyor.",
        runs: runs(profile),
        evaluate,
    }
}

fn runs(profile: &Profile) -> Vec<Run> {
    let base = json!({
        "experiment": "bend",
        "product": {"shape": SIZE_2, "subparticle_radius_m": profile.radius_m, "fill": PAPER_FILL},
        "numerics": {"timestep_s": "auto"},
    });
    let pictured =
        |name: &str, scenario: &Value| Run::new(name, scenario.clone()).shot(Shot::side(Moment::Last));
    let turned = with(&base, json!({"bend": {"scatter_deg": SCATTER_DEG}}));
    let mut runs = Run::replicates("Table 2", &turned, profile.fillet_seeds);
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
        runs.push(if is_stiffest { run.shot(Shot::side(Moment::Last)) } else { run });
    }
    let ledge = with(&base, json!({"bend": {"support": "off_ledge"}}));
    runs.push(
        LEAVING_S
            .into_iter()
            .fold(Run::new("off a ledge", ledge), |run, t| run.shot(Shot::side(Moment::At(t)))),
    );
    runs
}

fn bar_name(radius_m: f64) -> String {
    format!("bar of {} mm", significant(radius_m * 1e3))
}

/// A fillet with all bonds intact: its bend angle and the amplitude of its remaining swing, in degrees.
#[derive(Clone, Copy, Debug, PartialEq)]
struct BendAngle {
    angle: f64,
    swing: f64,
}

fn bend_angle(results: &Results<'_>, name: &str) -> Option<BendAngle> {
    let value = |response| results.first_response(name, response);
    value("bonds_intact_fraction").filter(|intact| *intact >= 1.0)?;
    Some(BendAngle { angle: value("bend_angle_deg")?, swing: value("bend_swing_deg")? })
}

/// Steps between neighbours of the grid in the direction of rising stiffness.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Steps {
    total: usize,
    /// Steps to a larger angle whose difference exceeds both swings.
    rises: usize,
    /// Maximum rise of the angle in a step, without regard to swings, in degrees.
    maximum_rise_deg: f64,
}

fn steps(lines: &[Vec<Option<BendAngle>>]) -> Steps {
    let pairs = lines.iter().flat_map(|line| line.windows(2)).filter_map(|pair| pair[0].zip(pair[1]));
    pairs.fold(Steps::default(), |steps, (from, to)| Steps {
        total: steps.total + 1,
        rises: steps.rises + usize::from(to.angle - to.swing > from.angle + from.swing),
        maximum_rise_deg: steps.maximum_rise_deg.max(to.angle - from.angle),
    })
}

/// A note on the remaining swing.
fn swing_note(results: &Results<'_>, name: &str) -> String {
    let swing = results.response(name, "bend_swing_deg").range();
    swing.map_or_else(String::new, |(_, maximum)| {
        format!("the remaining swing is at most ± {}°", rounded(maximum, 1))
    })
}

fn evaluate(profile: &Profile, results: &Results<'_>) -> Evaluation {
    const NAME: &str = "Fig. 7";
    let grid = profile.stiffnesses_n_m3;
    let angle = |normal: f64, shear: f64| bend_angle(results, &stiffness_name(normal, shear));
    let of_normal: Vec<Vec<_>> = grid.iter().map(|s| grid.iter().map(|n| angle(*n, *s)).collect()).collect();
    let of_shear: Vec<Vec<_>> = grid.iter().map(|n| grid.iter().map(|s| angle(*n, *s)).collect()).collect();
    let falls = |quantity: &str, lines: &[Vec<Option<BendAngle>>]| {
        let steps = steps(lines);
        let row = Row::new(NAME, quantity, "")
            .paper("none")
            .value((steps.total > 0).then_some(steps.rises as f64), steps.total);
        row.demand(Demand::AtMost(0.0)).note(format!(
            "the grid has {} such steps between pairs at which all bonds stay intact; a rise counts only if it exceeds the sum of the \
             remaining swings of the two pairs; the maximum rise in a step, counted or not, is {}°",
            steps.total,
            rounded(steps.maximum_rise_deg, 1)
        ))
    };
    let with_angle = |row: Row, name: &str| {
        row.replicates(&results.response(name, "bend_angle_deg")).note(swing_note(results, name))
    };
    let [length, ..] = extent_m(1, profile.radius_m).unwrap_or_default();
    let mut rows = vec![
        with_angle(Row::new(NAME, "bend angle of a fillet of size 2 over a bar, Table 2", "°").paper("> 120"), "Table 2")
            .demand(Demand::Above(120.0))
            .note(format!(
                "angle between the directions of the two ends of the centre line; the radius of the bar is 20 mm; the yaw is between \
                 −{SCATTER_DEG}° and {SCATTER_DEG}°; with R = {} mm, a fillet of size 2 is {} mm long, but in Table 1 of the paper, \
                 the length is 172 mm",
                significant(profile.radius_m * 1e3),
                rounded(length * 1e3, 0)
            )),
        with_angle(Row::new(NAME, "bend angle of size 2, not turned", "°").paper("> 120"), "straight"),
    ];
    for radius_m in BARS_M {
        let name = bar_name(radius_m);
        rows.push(with_angle(
            Row::new(NAME, format!("bend angle of size 2, not turned, over a {name}"), "°").paper("> 120"),
            &name,
        ));
    }
    let coarse_mm = significant(COARSE * profile.radius_m * 1e3);
    rows.push(with_angle(
        Row::new(NAME, format!("bend angle of size 2, not turned, with R = {coarse_mm} mm"), "°")
            .paper("> 120"),
        "coarse",
    ));
    for size in ["size 1", "size 3"] {
        rows.push(with_angle(Row::new(NAME, format!("bend angle of {size}, not turned"), "°"), size));
    }
    let intact = of_normal.iter().flatten().flatten().count();
    rows.push(
        Row::new(NAME, "number of pairs of stiffnesses at which all bonds stay intact", "")
            .value(Some(intact as f64), grid.len() * grid.len())
            .note(format!(
                "the grid has {} pairs; S_n and S_t are from {:e} to {:e} N/m³",
                grid.len() * grid.len(),
                grid[0],
                grid[grid.len() - 1]
            )),
    );
    rows.extend([
        falls("number of steps to a larger S_n at which the bend angle rises", &of_normal),
        falls("number of steps to a larger S_t at which the bend angle rises", &of_shear),
        Row::new(NAME, "maximum bend angle of a fillet that leaves a conveyor, Table 2", "°")
            .single(results.first_response("off a ledge", "largest_bend_angle_deg"))
            .note("the paper gives no angle for this case; it compares the pictures in Fig. 4c and Fig. 4d by eye"),
    ]);
    let findings = bar_finding(profile, results).into_iter().collect();
    Evaluation { rows, illustrations: illustrations(profile, results), findings }
}

/// A finding if fillets bend less than in the paper.
fn bar_finding(profile: &Profile, results: &Results<'_>) -> Option<String> {
    let angle = |name: &str| results.response(name, "bend_angle_deg").mean();
    let mean = angle("Table 2").filter(|mean| *mean <= 120.0)?;
    let mut others: Vec<String> = BARS_M
        .iter()
        .filter_map(|radius| Some((angle(&bar_name(*radius))?, radius)))
        .map(|(angle, radius)| {
            format!(
                "With the same R, the angle is {}° over a bar of {} mm radius.",
                rounded(angle, 0),
                significant(radius * 1e3)
            )
        })
        .collect();
    others.extend(angle("coarse").map(|angle| {
        format!(
            "Over the bar of 20 mm radius, the angle is {}° with R = {} mm. A fillet of larger spheres has fewer layers of spheres, \
             and fewer layers resist bending less.",
            rounded(angle, 0),
            significant(COARSE * profile.radius_m * 1e3)
        )
    }));
    Some(format!(
        "Over a bar of 20 mm radius, a fillet of size 2 with R = {} mm has a mean bend angle of {}°. In the paper, the bend angle is \
         more than 120°. The paper does not give the radius of its bar. The bend angle depends on this radius and on R. {}",
        significant(profile.radius_m * 1e3),
        rounded(mean, 0),
        others.join(" ")
    ))
}

fn illustrations(profile: &Profile, results: &Results<'_>) -> Vec<Illustration> {
    let grid = profile.stiffnesses_n_m3;
    let bend_curve = |label: &str, style, points: Vec<(f64, Option<BendAngle>)>| {
        let swings = points.iter().filter_map(|(_, bend)| Some(bend.as_ref()?.swing));
        let error_bars = swings.collect();
        let angles = points.into_iter().map(|(x, bend)| (x, bend.map(|bend| bend.angle)));
        Curve { error_bars, ..curve(label, style, angles) }
    };
    let lines = grid.iter().enumerate().map(|(colour, shear)| {
        let points =
            grid.iter().map(|normal| (*normal, bend_angle(results, &stiffness_name(*normal, *shear))));
        bend_curve(&format!("S_t {shear:e} N/m³"), Style { colour, dash: 0 }, points.collect())
    });
    let point = vec![(TABLE_2.0, bend_angle(results, "straight"))];
    let table_2 =
        Curve { markers: Markers::Only, ..bend_curve("Table 2", Style { colour: 6, dash: 0 }, point) };
    let curves = lines.chain([table_2]).collect();
    let svg = plot_svg("normal stiffness S_n (N/m³)", "bend angle (°)", Scale::Log, None, curves);
    let caption = "Bend angle over stiffness; the error bars are the remaining swing. Pairs that break bonds have no point.";
    let mut shown: Vec<Illustration> = svg.map(|svg| Illustration::new(svg, caption)).into_iter().collect();
    let stiffest = grid.last().map(|maximum| stiffness_name(*maximum, *maximum)).unwrap_or_default();
    let draw = |picture: &Picture| picture.svg("a bent fillet", 270.0);
    for (name, caption) in
        [("straight", "Over the bar, Table 2."), (&*stiffest, "Over the bar, stiffest bonds.")]
    {
        let picture = results.first_record(name).and_then(|record| record.picture(View::Side, Moment::Last));
        shown.extend(picture.map(|picture| Illustration::new(draw(picture), caption)));
    }
    for t in LEAVING_S {
        let picture =
            results.first_record("off a ledge").and_then(|record| record.picture(View::Side, Moment::At(t)));
        let caption = format!("Off the end of a conveyor, {} s.", significant(t));
        shown.extend(picture.map(|picture| Illustration::new(draw(picture), caption)));
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_between_neighbours_rise_only_beyond_both_swings() {
        let at = |angle, swing| Some(BendAngle { angle, swing });
        let lines = [
            vec![at(150.0, 1.0), at(153.0, 1.0), at(90.0, 0.5)],
            vec![at(80.0, 0.1), None, at(90.0, 0.1)],
            vec![at(70.0, 4.0), at(77.0, 4.0)],
            vec![at(5.0, 0.1)],
        ];
        assert_eq!(steps(&lines), Steps { total: 3, rises: 1, maximum_rise_deg: 7.0 });
        assert_eq!(steps(&lines[3..]), Steps::default());
    }
}

//! Table 1 and Fig. 1: the six shapes; Table 2: the parameters. Both read the defaults of a scenario and simulate nothing.

use roost_solver::engine::scene::BodyKind;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{self, Scenario};
use roost_solver::{Limits, check};
use roost_terminal::format::significant;
use serde_json::{Value, json};

use super::PAPER_FILL;
use crate::picture::{Moment, Picture, Shot, View};
use crate::plan::{Evaluation, Figure, Illustration, Part};
use crate::profile::Profile;
use crate::row::{Demand, Row};

/// The hopper experiment with all defaults, but the lattice of the paper.
pub(super) fn default_scenario() -> Scenario {
    let document = json!({"experiment": "hopper", "product": {"fill": PAPER_FILL}});
    scenario::from_value(&document).expect("everything else has a default")
}

/// Shapes and masses.
pub(super) fn table_1() -> Figure {
    Figure {
        name: "Table 1",
        title: "Table 1 and Fig. 1: six shapes",
        part: Part::Model,
        paper: "Three sizes of fillets and their mirror images, each filled with sub-particles of 4 mm radius. 191 of them, \
                38.21 kg, make over 41,000 sub-particles.",
        runs: Vec::new(),
        evaluate: |profile, _| evaluate_shapes(profile),
    }
}

/// Radius of the paper's sub-particles, in metres.
const PAPER_RADIUS_M: f64 = 0.004;

/// Sizes of Table 1, in millimetres.
const SIZES_MM: [[f64; 3]; 3] = [[144.0, 72.0, 40.0], [172.0, 72.0, 32.0], [176.0, 72.0, 40.0]];

/// The body kinds of a scenario without meshes; none if it cannot run.
fn kinds(scenario: &Scenario) -> Option<Vec<BodyKind>> {
    Some(check(scenario, &Meshes::default(), &Limits::NONE).ok()?.setup().kinds.clone())
}

/// Length, width and thickness of a fillet between the surfaces of its sub-particles, in metres; sizes count from 0.
pub(super) fn extent_m(size: usize, radius_m: f64) -> Option<[f64; 3]> {
    let document =
        json!({"experiment": "hopper", "product": {"subparticle_radius_m": radius_m, "fill": PAPER_FILL}});
    let scenario = scenario::from_value(&document).ok()?;
    // Each size is followed by its mirror image.
    let kinds = kinds(&scenario)?;
    let points = &kinds.get(2 * size)?.meta.points;
    let low = points.iter().copied().reduce(|a, b| a.min(b))?;
    let high = points.iter().copied().reduce(|a, b| a.max(b))?;
    Some((high - low + 2.0 * radius_m).to_array())
}

fn evaluate_shapes(profile: &Profile) -> Evaluation {
    const NAME: &str = "Table 1";
    let scenario = default_scenario();
    let kinds = kinds(&scenario).unwrap_or_default();
    let mut rows = Vec::new();
    let mut radii_m = vec![PAPER_RADIUS_M, profile.radius_m, profile.bed.radius_m];
    radii_m.dedup();
    for (number, paper) in SIZES_MM.into_iter().enumerate() {
        let ours = scenario.product.sizes_m.get(number).copied().unwrap_or_default();
        for (axis, axis_name) in ["length", "width", "thickness"].into_iter().enumerate() {
            let quantity = |suffix: &str| format!("{axis_name} of size {}{suffix}", number + 1);
            rows.push(
                Row::new(NAME, quantity(", bounding box of the shape"), "mm")
                    .paper(paper[axis])
                    .value(Some(ours[axis] * 1e3), 0)
                    .demand(Demand::Exactly(paper[axis]))
                    .note("default of /product/sizes_m"),
            );
            for &radius_m in &radii_m {
                let extent = extent_m(number, radius_m).map(|extent| extent[axis] * 1e3);
                let radius_mm = significant(radius_m * 1e3);
                rows.push(
                    Row::new(NAME, quantity(&format!(", filled at R = {radius_mm} mm")), "mm")
                        .paper(paper[axis])
                        .value(extent, 0)
                        .note("between the surfaces of its sub-particles"),
                );
            }
        }
    }
    let fillets = || (0..191).map(|i| &kinds[i % kinds.len()]);
    let mass: f64 = fillets().map(|kind| kind.subparticle_mass_kg * kind.meta.points.len() as f64).sum();
    let count: usize = fillets().map(|kind| kind.meta.points.len()).sum();
    rows.push(
        Row::new(NAME, "mass of 191 fillets", "kg")
            .paper(38.21)
            .value(Some(mass), 0)
            .demand(Demand::Near(38.21, 0.3821))
            .note("the teardrop fills 48.66 % of its box, a value chosen to meet this mass"),
    );
    rows.push(
        Row::new(NAME, "sub-particles of 191 fillets", "")
            .paper(41_000.0)
            .value(Some(count as f64), 0)
            .note("the paper says over 41,000; see below"),
    );
    let findings = vec![
        "The paper's meshes are not public. The shape here is a teardrop in the box of Table 1."
            .to_owned(),
        format!(
            "The number of sub-particles does not reproduce: it is {count} here, {} times the paper's. The paper's numbers contradict \
             each other: 41,000 spheres of 4 mm for 191 fillets are 215 each, which on a lattice of 8 mm fill only half of the \
             volume of 0.2 kg of meat.",
            significant((count as f64 / 4100.0).round() / 10.0)
        ),
        "The default boxes are those of Table 1, but the filled fillets differ: sub-particles lie at the lattice points inside the \
         shape. A fillet therefore ends one radius beyond its outermost centres, and tips without a lattice point are missing."
            .to_owned(),
    ];
    Evaluation { rows, illustrations: vec![six_shapes(&scenario)], findings }
}

/// All shapes from above, each size beside its mirror image.
fn six_shapes(scenario: &Scenario) -> Illustration {
    let mut discs = Vec::new();
    for (number, kind) in kinds(scenario).unwrap_or_default().iter().enumerate() {
        let (column, line) = (number % 2, number / 2);
        // Points are sorted by z, so the nearest to the viewer come last.
        discs.extend(kind.meta.points.iter().map(|point| {
            let (x, y) = (point.x + 0.2 * column as f64, point.y - 0.09 * line as f64);
            (x as f32, y as f32, number as u32)
        }));
    }
    let picture = Picture {
        shot: Shot { view: View::Top, when: Moment::First },
        simulated_s: 0.0,
        belt_time_s: None,
        radius_m: scenario.product.radius_m() as f32,
        discs,
        outlines: Vec::new(),
    };
    let svg = picture.without_hidden_discs().svg("six shapes of fillets from above", 640.0);
    Illustration::new(
        svg,
        "The six shapes from above: sizes 1 to 3 from the top, each with its mirror image on the right.",
    )
}

/// A row of Table 2: name, JSON pointer in a scenario, value, unit, and factor from the scenario to that unit.
type Parameter = (&'static str, &'static str, f64, &'static str, f64);

const PARAMETERS: [Parameter; 13] = [
    ("Poisson's ratio", "/material/poisson_ratio", 0.37, "", 1.0),
    ("density of a fillet", "/product/density_kg_m3", 940.0, "kg/m³", 1.0),
    ("Young's modulus", "/material/youngs_modulus_pa", 48.6, "kPa", 1e-3),
    ("restitution between fillets", "/contact/fillet_fillet/restitution", 1e-4, "", 1.0),
    ("friction between fillets", "/contact/fillet_fillet/static_friction", 0.1, "", 1.0),
    ("restitution on equipment", "/contact/fillet_equipment/restitution", 1e-4, "", 1.0),
    ("friction on equipment", "/contact/fillet_equipment/static_friction", 0.5, "", 1.0),
    ("normal stiffness of bonds per area", "/bonds/normal_stiffness_n_m3", 1e6, "N/m³", 1.0),
    ("shear stiffness of bonds per area", "/bonds/shear_stiffness_n_m3", 6e5, "N/m³", 1.0),
    ("contact radius", "/bonds/contact_radius_ratio", 6.928, "mm", 4.0),
    ("surface energy between fillets", "/contact/fillet_fillet/surface_energy_j_m2", 0.055, "J/m²", 1.0),
    ("surface energy on equipment", "/contact/fillet_equipment/surface_energy_j_m2", 0.055, "J/m²", 1.0),
    ("time step", "/numerics/timestep_s", 5.75e-5, "s", 1.0),
];

/// The parameters.
pub(super) fn table_2() -> Figure {
    Figure {
        name: "Table 2",
        title: "Table 2: parameters",
        part: Part::Model,
        paper: "Parameters from literature, experiments and calibration. All simulations of the paper use them unless they are \
                varied.",
        runs: Vec::new(),
        evaluate: |_, _| evaluate_parameters(&json!(default_scenario())),
    }
}

fn evaluate_parameters(scenario: &Value) -> Evaluation {
    const NAME: &str = "Table 2";
    let mut rows: Vec<Row> = PARAMETERS
        .iter()
        .map(|&(what, pointer, paper, unit, factor)| {
            let ours = scenario.pointer(pointer).and_then(Value::as_f64).map(|value| value * factor);
            let row = Row::new(NAME, what, unit).paper(paper).value(ours, 0);
            row.demand(Demand::Exactly(paper)).note(format!("default of {pointer}"))
        })
        .collect();
    let is_null = |pointer| scenario.pointer(pointer).is_some_and(Value::is_null);
    let unbreakable = ["/bonds/normal_strength_pa", "/bonds/shear_strength_pa"].into_iter().all(is_null);
    rows.push(
        Row::new(NAME, "strength of bonds", "Pa")
            .paper(1e300)
            .text(if unbreakable { "unbreakable by stress" } else { "limited" }, 0)
            .demand_text("unbreakable by stress", unbreakable),
    );
    rows.push(
        Row::new(NAME, "density of a sub-particle", "kg/m³")
            .paper(2200.0)
            .value(scenario.pointer("/product/subparticle_density_kg_m3").and_then(Value::as_f64), 0)
            .note("not used by default; see below"),
    );
    let findings = vec![
        "The two densities contradict each other: 215 sub-particles of 2200 kg/m³ weigh 0.127 kg, but 191 fillets of 38.21 kg \
         weigh 0.2 kg each. Fillets here have the mass of their volume at 940 kg/m³."
            .to_owned(),
        "The table does not say whether bonded neighbours also have contact. Here they do, as in the commercial program, unless \
         a row says otherwise."
            .to_owned(),
    ];
    Evaluation { rows, findings, ..Evaluation::default() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn extents_are_those_of_the_filled_lattice() {
        let [length, width, thickness] = extent_m(1, 0.004).unwrap();
        let whole = |metres: f64| (metres / 0.008 - (metres / 0.008).round()).abs() < 1e-6;
        assert!(whole(length) && whole(width) && whole(thickness), "{length} × {width} × {thickness}");
        assert!((0.140..0.172).contains(&length), "the tip of the teardrop holds no centre: {length}");
        let evaluation = evaluate_shapes(crate::profile::PROFILES[0]);
        let row = evaluation
            .rows
            .iter()
            .find(|row| row.quantity == "length of size 2, filled at R = 4 mm")
            .unwrap();
        assert_eq!(row.measured.as_f64(), Some(length * 1e3));
    }

    #[test]
    fn parameter_that_differs_from_table_2_does_not_hold() {
        let mut scenario = json!(default_scenario());
        assert!(evaluate_parameters(&scenario).rows.iter().all(|row| row.holds != Some(false)));
        scenario["material"]["poisson_ratio"] = json!(0.38);
        scenario["bonds"]["shear_strength_pa"] = json!(1e5);
        let evaluation = evaluate_parameters(&scenario);
        let failed: Vec<_> = evaluation.rows.iter().filter(|row| row.holds == Some(false)).collect();
        assert_eq!(failed.len(), 2, "{failed:?}");
    }
}

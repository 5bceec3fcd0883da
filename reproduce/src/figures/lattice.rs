//! Fig. 2 and 3: bonds of lattices with one and with two types of sub-particles.

use std::fmt::Write;
use std::sync::Arc;

use roost_solver::mesh::Meshes;
use roost_solver::shape::lattice::MetaParticle;
use roost_solver::shape::meta_particles;

use super::model::default_scenario;
use crate::plan::{Evaluation, Figure, Illustration, Part};
use crate::row::{Demand, Row};

/// Contact radius over R in the picture of a truss, between √2 and √3.
const WIDE: f64 = 1.5;
/// Contact radius over R of Table 2.
const PAPERS: f64 = 1.732;
/// Colours of the types.
const TYPES: [&str; 2] = ["#0072B2", "#E69F00"];
/// Colour of a diagonal bond.
const DIAGONAL: &str = "#D55E00";

/// Both figures.
pub(super) fn figures_2_and_3() -> Figure {
    Figure {
        name: "Fig. 2, 3",
        title: "Fig. 2 and 3: bonds of one and of two types",
        part: Part::Model,
        paper: "With one type of sub-particles, unwanted diagonal bonds form a stiff truss if the contact radius exceeds R√2. With \
                two types and bonds only between different types, it may be up to R√3.",
        runs: Vec::new(),
        evaluate: |_, _| evaluate(),
    }
}

/// The first shape with this number of types and this contact radius over R.
fn filled(types: u32, contact_radius_ratio: f64) -> Arc<MetaParticle> {
    let product = default_scenario().product;
    meta_particles(&product, &Meshes::default(), types, contact_radius_ratio)
        .expect("teardrops are filled")
        .swap_remove(0)
}

/// Maximum number of bonds of a sub-particle.
fn maximum_bonds(meta: &MetaParticle) -> usize {
    let mut counts = vec![0; meta.points.len()];
    for bond in &meta.bonds {
        counts[bond.i as usize] += 1;
        counts[bond.j as usize] += 1;
    }
    counts.into_iter().max().unwrap_or(0)
}

fn has_diagonals(meta: &MetaParticle) -> bool {
    meta.bonds.iter().any(|bond| bond.class > 1)
}

/// The contact radius over R at which diagonal bonds first form, by bisection.
fn first_diagonal(types: u32) -> Option<f64> {
    let (mut without, mut with) = (1.001, PAPERS);
    if !has_diagonals(&filled(types, with)) {
        return None;
    }
    while with - without > 1e-5 {
        let middle = (with + without) / 2.0;
        if has_diagonals(&filled(types, middle)) { with = middle } else { without = middle }
    }
    Some(with)
}

fn evaluate() -> Evaluation {
    const NAME: &str = "Fig. 2, 3";
    let (one, two) = (filled(1, WIDE), filled(2, PAPERS));
    let rows = vec![
        Row::new(NAME, "contact radius over R above which one type has diagonal bonds", "")
            .paper(2f64.sqrt())
            .value(first_diagonal(1), 0)
            .demand(Demand::Near(2f64.sqrt(), 1e-4)),
        Row::new(NAME, "diagonal bonds of two types at 1.732 R", "")
            .paper("none up to R√3")
            .value(Some(two.bonds.iter().filter(|bond| bond.class > 1).count() as f64), 0)
            .demand(Demand::AtMost(0.0))
            .note("at exactly √3 body diagonals would have bonds, hence 1.732"),
        Row::new(NAME, "maximum number of bonds of a sub-particle, two types at 1.732 R", "")
            .value(Some(maximum_bonds(&two) as f64), 0)
            .demand(Demand::Exactly(6.0))
            .note("the six nearest neighbours"),
        Row::new(NAME, "maximum number of bonds of a sub-particle, one type at 1.5 R", "")
            .value(Some(maximum_bonds(&one) as f64), 0)
            .demand(Demand::Exactly(18.0))
            .note("six nearest neighbours and twelve face diagonals"),
    ];
    let illustrations = vec![
        Illustration::new(
            patch(&one, 1),
            "One type at 1.5 R: diagonal bonds (red) form a truss. A layer of size 1, tail end.",
        ),
        Illustration::new(
            patch(&two, 2),
            "Two types at 1.732 R: only different types have bonds. The same layer.",
        ),
    ];
    Evaluation { rows, illustrations, findings: Vec::new() }
}

/// SVG of a part of the middle layer with its bonds.
fn patch(meta: &MetaParticle, types: u32) -> String {
    const SPACING: f64 = 0.008;
    const PIXELS: f64 = 32.0;
    let point = |i: u32| meta.points[i as usize];
    let level = meta.points.iter().map(|point| point.z).min_by(|a, b| a.abs().total_cmp(&b.abs()));
    let is_shown = |i: u32| {
        let off = point(i).z - level.unwrap_or(0.0);
        off.abs() < 1e-6 && point(i).x.abs() < 4.6 * SPACING && point(i).y.abs() < 2.6 * SPACING
    };
    let layer: Vec<u32> = (0..meta.points.len() as u32).filter(|i| is_shown(*i)).collect();
    let place = |i: u32| ((point(i).x / SPACING + 5.0) * PIXELS, (3.0 - point(i).y / SPACING) * PIXELS);
    let mut svg = String::from(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" role=\"img\" aria-label=\"bonds of a layer\" width=\"320\" height=\"192\" \
         viewBox=\"0 0 320 192\">\n",
    );
    let mut add = |text: std::fmt::Arguments<'_>| svg.write_fmt(text).expect("memory");
    for bond in meta.bonds.iter().filter(|bond| is_shown(bond.i) && is_shown(bond.j)) {
        let ((x1, y1), (x2, y2)) = (place(bond.i), place(bond.j));
        let colour = if bond.class > 1 { DIAGONAL } else { "#777" };
        add(format_args!(
            "<path d=\"M{x1:.1} {y1:.1}L{x2:.1} {y2:.1}\" stroke=\"{colour}\" stroke-width=\"2.5\"/>\n"
        ));
    }
    for &i in &layer {
        let (x, y) = place(i);
        // Types alternate along each edge of the lattice.
        let off = (point(i) - point(layer[0])) / SPACING;
        let colour = TYPES[(off.x.round() + off.y.round()).rem_euclid(f64::from(types)) as usize];
        add(format_args!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"8\" fill=\"{colour}\"/>\n"));
    }
    svg.push_str("</svg>\n");
    svg
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_type_has_diagonal_bonds_and_two_types_have_none() {
        let (one, two) = (patch(&filled(1, WIDE), 1), patch(&filled(2, PAPERS), 2));
        assert!(one.contains(DIAGONAL) && !two.contains(DIAGONAL));
        assert!(two.contains(TYPES[1]) && !one.contains(TYPES[1]), "two colours for two types");
        assert!(evaluate().rows.iter().all(|row| row.holds == Some(true)), "{:#?}", evaluate().rows);
    }
}

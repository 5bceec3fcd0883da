//! From Table 2 to the laws of force and the scene, against numbers worked out by hand.

mod common;

use common::{assert_close, document, kinds, scene_of};
use roost_solver::engine::scene::Laws;
use roost_solver::experiments::laws;
use roost_solver::scenario::{self, Scenario};
use serde_json::{Value, json};

fn with(fields: &[(&str, Value)]) -> Scenario {
    scenario::from_value(&document(fields)).expect("a sound scenario")
}

fn laws_of(fields: &[(&str, Value)]) -> Laws {
    laws::laws(&with(fields))
}

#[test]
fn contact_and_bond_laws_have_the_values_of_table_2() {
    let laws = laws_of(&[]);
    // E / 2(1 − ν²), E / (1 − ν²), and the same for G* with 4 and 2 times (1 + ν)(2 − ν).
    assert_close(f64::from(laws.tissue.e_star), 28_154.9, 1e-4);
    assert_close(f64::from(laws.equipment.e_star), 56_309.8, 1e-4);
    assert_close(f64::from(laws.tissue.g_star), 5_440.8, 1e-4);
    assert_close(f64::from(laws.equipment.g_star), 10_881.6, 1e-4);
    assert_close(f64::from(laws.tissue.r_star), 0.002, 1e-6);
    assert_close(f64::from(laws.belt.r_star), 0.004, 1e-6);
    assert_eq!((laws.tissue.mu, laws.equipment.mu, laws.belt.mu), (0.1, 0.5, 0.5));
    assert!(laws.tissue.jkr.is_some() && laws.equipment.jkr.is_some() && laws.belt.jkr.is_some());
    // S π R²; twice the contact radius of 6.928 mm.
    assert_close(f64::from(laws.bond.k_n), 50.265, 1e-4);
    assert_close(f64::from(laws.bond.k_t), 30.159, 1e-4);
    assert_close(f64::from(laws.bond.break_length), 0.013_856, 1e-6);
    assert_eq!((laws.bond.normal_strength, laws.bond.shear_strength), (f32::INFINITY, f32::INFINITY));
    assert!(laws.contact_between_bonded);
}

#[test]
fn stiffness_per_area_holds_at_the_reference_radius() {
    // k = S (R_ref / R) π R²: 50.265 N/m grows with R, not with R².
    for (radius, reference, k_n) in [
        (0.008, json!(0.004), 2.0 * 50.265),
        (0.002, json!(0.004), 50.265 / 2.0),
        (0.008, json!(0.006), 3.0 * 50.265),
        (0.008, json!(null), 4.0 * 50.265),
    ] {
        let laws = laws_of(&[
            ("/product/subparticle_radius_m", json!(radius)),
            ("/bonds/reference_radius_m", reference),
        ]);
        assert_close(f64::from(laws.bond.k_n), k_n, 1e-4);
        assert_close(f64::from(laws.bond.k_t), 0.6 * k_n, 1e-4);
    }
}

#[test]
fn every_bond_and_contact_field_sets_its_law() {
    let laws = laws_of(&[
        ("/bonds/disk_scale", json!(0.5)),
        ("/bonds/normal_strength_pa", json!(1000.0)),
        ("/bonds/shear_strength_pa", json!(500.0)),
        ("/bonds/contact_between_bonded", json!(false)),
        ("/contact/fillet_belt/static_friction", json!(0.3)),
        ("/contact/fillet_equipment/static_friction", json!(0.4)),
        ("/contact/fillet_belt/surface_energy_j_m2", json!(0.0)),
        ("/contact/fillet_equipment/restitution", json!(1.0)),
    ]);
    assert_close(f64::from(laws.bond.k_n), 50.265 / 4.0, 1e-4);
    assert_close(f64::from(laws.bond.normal_strength), 1000.0 * 1.256_64e-5, 1e-4);
    assert_close(f64::from(laws.bond.shear_strength), 500.0 * 1.256_64e-5, 1e-4);
    assert!(!laws.contact_between_bonded);
    assert_eq!((laws.tissue.mu, laws.equipment.mu, laws.belt.mu), (0.1, 0.4, 0.3));
    assert!(laws.belt.jkr.is_none() && laws.equipment.jkr.is_some());
    assert!(laws.equipment.damping == 0.0 && laws.belt.damping > 1.0);

    let scene = scene_of(&with(&[
        ("/product/count", json!(2)),
        ("/numerics/gravity_m_s2", json!(1.62)),
        ("/numerics/speed_limit_m_s", json!(7.0)),
    ]));
    assert_eq!((scene.gravity.z, scene.speed_limit_m_s, scene.timestep_s), (-1.62, 7.0, 5.75e-5));
}

#[test]
fn shapes_alternate_with_mirror_images_and_have_the_mass_of_their_density() {
    let all = kinds(&with(&[]));
    assert_eq!(all.len(), 6);
    let mut differ = 0;
    for pair in all.chunks(2) {
        let points = |k: usize| {
            let mirror = if k == 1 { -1.0 } else { 1.0 };
            let grid = |x: f64| (x * 1e6).round() as i64;
            let mut points: Vec<_> =
                pair[k].meta.points.iter().map(|p| [grid(p.x), grid(p.y * mirror), grid(p.z)]).collect();
            points.sort_unstable();
            points
        };
        assert_eq!(points(0), points(1), "the second is the mirror image of the first");
        differ += usize::from(pair[0].meta.points != pair[1].meta.points);
        let mass = pair[0].subparticle_mass_kg * pair[0].meta.points.len() as f64;
        assert_close(mass, 940.0 * pair[0].meta.volume_m3, 1e-12);
    }
    assert_eq!(differ, 3, "and none is its own");
    let dense = kinds(&with(&[("/product/subparticle_density_kg_m3", json!(2200.0))]));
    // 2200 · 4/3 π (4 mm)³
    assert_close(dense[0].subparticle_mass_kg, 5.898e-4, 1e-3);
    let bonds = |types: u32| kinds(&with(&[("/bonds/types", json!(types))]))[0].meta.bonds.len();
    assert!(bonds(1) > 2 * bonds(2), "one type bonds along the diagonals too");
}

#[test]
fn every_filled_fillet_is_connected() {
    // However coarse the lattice: cells that only touch by an edge are not fillets of their own.
    for tenths in 40..200 {
        for fill in ["centres", "whole_spheres", "volume"] {
            let radius = ("/product/subparticle_radius_m", json!(f64::from(tenths) * 1e-4));
            assert_hang_together(&[radius, ("/product/fill", json!(fill))]);
        }
    }
    // Thin ones, whose left bulge holds a cell in one layer and the right bulge one in the next.
    for thousandths in 380..500 {
        let radius = ("/product/subparticle_radius_m", json!(0.05 * f64::from(thousandths) * 1e-3));
        let sizes = json!([[0.36, 0.05, 0.2], [0.4, 0.05, 0.2], [0.44, 0.05, 0.2]]);
        assert_hang_together(&[radius, ("/product/sizes_m", sizes)]);
    }
}

fn assert_hang_together(fields: &[(&str, Value)]) {
    for kind in kinds(&with(fields)) {
        let mut reached = vec![false; kind.meta.points.len()];
        reached.iter_mut().take(1).for_each(|first| *first = true);
        loop {
            let before = reached.iter().filter(|&&r| r).count();
            for bond in &kind.meta.bonds {
                let either = reached[bond.i as usize] || reached[bond.j as usize];
                (reached[bond.i as usize], reached[bond.j as usize]) = (either, either);
            }
            if reached.iter().filter(|&&r| r).count() == before {
                break;
            }
        }
        assert!(reached.iter().all(|&r| r), "{fields:?}");
    }
}

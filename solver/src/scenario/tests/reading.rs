//! Defaults, presets, inheritance, digest.

use serde_json::json;

use super::{full, minimal, with};
use crate::scenario::{Auto, Condition, Fill, SCHEMA, ScenarioError, Timestep, from_value, parse};

/// The document of the paper's bulk case as the design spells it.
const SPELLED_OUT: &str = r#"
{"schema": "roost.scenario/3", "experiment": "hopper",
 "product":   {"count": 191, "subparticle_radius_m": 0.004, "fill": "volume", "density_kg_m3": 940},
 "material":  {"youngs_modulus_pa": 48600, "poisson_ratio": 0.37},
 "bonds":     {"formulation": "corotated", "normal_stiffness_n_m3": 1e6, "shear_stiffness_n_m3": 6e5,
               "contact_radius_ratio": 1.732, "contact_between_bonded": true},
 "contact":   {"condition": "dry",
               "fillet_fillet": {"static_friction": 0.1, "restitution": 1e-4, "surface_energy_j_m2": 0.055},
               "fillet_equipment": {"static_friction": 0.5}, "fillet_belt": {"static_friction": 0.5}},
 "equipment": {"gate_opening_m": 0.06, "hopper_width_m": 0.59, "hopper_length_m": 0.30, "hopper_height_m": 0.5,
               "wall_slope_deg": 0, "side_walls": "rough", "belt_speed_m_s": 0.25},
 "numerics":  {"timestep_s": 5.75e-5, "duration_s": 6, "output_interval_s": 0.02, "stop": {"when_empty": true}},
 "seed": 1}"#;

#[test]
fn the_minimal_scenario_is_the_papers_bulk_case() {
    assert_eq!(parse(SPELLED_OUT).unwrap(), minimal());
}

#[test]
fn schema_1_keeps_the_meaning_of_its_bonds() {
    let read = |document| from_value(&document).unwrap();
    let old = read(json!({"schema": "roost.scenario/1", "experiment": "hopper"}));
    assert_eq!(old.bonds.reference_radius_m, None);
    assert_eq!(old.schema, SCHEMA);
    let same = json!({"schema": SCHEMA, "experiment": "hopper", "bonds": {"reference_radius_m": null},
        "product": {"fill": "centres"}});
    assert_eq!(old, read(same));
    // Everything else is alike, and the upgraded document reads back as itself.
    let mut bonds = minimal();
    assert_eq!(bonds.bonds.reference_radius_m, Some(0.004));
    bonds.bonds.reference_radius_m = None;
    bonds.product.fill = Fill::Centres;
    assert_eq!(old, bonds);
    assert_eq!(from_value(&json!(old)).unwrap(), old);
    // Values that a document states stay; a faulty section is at fault as ever.
    let mut stated = json!({"schema": "roost.scenario/1", "experiment": "hopper", "bonds": {"types": 1}});
    assert_eq!(read(stated.clone()).bonds.types, 1);
    stated["bonds"]["reference_radius_m"] = json!(0.006);
    assert_eq!(read(stated.clone()).bonds.reference_radius_m, Some(0.006));
    stated["bonds"] = json!(null);
    assert_eq!(from_value(&stated).unwrap_err()[0].pointer, "/bonds");
}

#[test]
fn schema_2_keeps_the_points_of_its_lattice() {
    let read = |document| from_value(&document).unwrap();
    let product = |product| json!({"schema": "roost.scenario/2", "experiment": "hopper", "product": product});
    let old = read(json!({"schema": "roost.scenario/2", "experiment": "hopper"}));
    assert_eq!(old.product.fill, Fill::Centres);
    assert_eq!(old.schema, SCHEMA);
    // Everything else is alike, and the upgraded document reads back as itself.
    let mut centres = minimal();
    assert_eq!(centres.product.fill, Fill::Volume);
    centres.product.fill = Fill::Centres;
    assert_eq!(old, centres);
    assert_eq!(from_value(&json!(old)).unwrap(), old);
    // Values that a document states stay; a faulty section is at fault as ever.
    assert_eq!(read(product(json!({"fill": "volume"}))).product.fill, Fill::Volume);
    assert_eq!(read(product(json!({"fill": "whole_spheres"}))).product.fill, Fill::WholeSpheres);
    assert_eq!(from_value(&product(json!(3))).unwrap_err()[0].pointer, "/product");
    // Single spheres and the block of a compression have no shape: a complete document of that time stated its default.
    for stated in [json!({"spheres": true}), json!({"spheres": true, "fill": "centres"})] {
        assert_eq!(read(product(stated)).product.fill, Fill::Volume);
    }
    for stated in [json!({}), json!({"fill": "centres"})] {
        let block = json!({"schema": "roost.scenario/2", "experiment": "compress", "product": stated});
        assert_eq!(read(block).product.fill, Fill::Volume);
    }
}

#[test]
fn minimal_scenario_has_the_documented_defaults() {
    let scenario = minimal();
    assert_eq!(scenario.product.sizes_m[1], [0.172, 0.072, 0.032]);
    assert_eq!(scenario.product.density_kg_m3, Some(940.0));
    assert_eq!(scenario.product.subparticle_density_kg_m3, None);
    assert_eq!((scenario.bonds.types, scenario.bonds.disk_scale), (2, 1.0));
    assert_eq!(scenario.bonds.normal_strength_pa, None);
    assert_eq!(scenario.numerics.timestep_s, Timestep::Fixed(5.75e-5));
    assert_eq!(scenario.numerics.stop.when_jammed_s, None);
    assert_eq!(scenario.numerics.gravity_m_s2, 9.81);
    assert!(scenario.equipment().unwrap().shutter_while_filling && scenario.numerics.stop.when_empty);
}

#[test]
fn serialised_scenario_reads_back_unchanged() {
    assert_eq!(from_value(&full()).unwrap(), minimal());
}

#[test]
fn digest_ignores_field_order_and_explicit_defaults() {
    let digest = minimal().digest();
    let turned = r#"{"seed": 1, "product": {"fill": "volume", "count": 191}, "experiment": "hopper"}"#;
    assert_eq!(parse(turned).unwrap().digest(), digest);
    assert_eq!(parse(SPELLED_OUT).unwrap().digest(), digest);
    assert_eq!(from_value(&with("/product/count", json!(191.0))).unwrap().digest(), digest);
    assert_eq!(from_value(&with("/numerics/duration_s", json!(6))).unwrap().digest(), digest);
    assert_ne!(from_value(&with("/seed", json!(2))).unwrap().digest(), digest);
}

/// Guards every default and the canonical form. A new digest separates later results from earlier ones, and needs a
/// new [`crate::SOLVER_REVISION`] or schema.
#[test]
fn the_digest_of_the_minimal_scenario_is_pinned() {
    assert_eq!(minimal().digest(), "e8790c70c72289c9b1442c648697635d69c27db3d2a11facbff96454f89fe8fe");
}

#[test]
fn wet_only_sets_other_defaults() {
    let wet = from_value(&json!({"experiment": "hopper", "contact": {"condition": "wet"}})).unwrap();
    assert_eq!(wet.contact.condition, Condition::Wet);
    assert_eq!(wet.contact.fillet_belt.static_friction, 0.2);
    assert_eq!(wet.contact.fillet_fillet.surface_energy_j_m2, 0.0728);
    assert_eq!(wet.contact.fillet_belt.surface_energy_j_m2, 0.0728);
    assert_eq!(wet.contact.fillet_equipment.static_friction, 0.5);
    assert_eq!(wet.contact.fillet_fillet.static_friction, 0.1);

    let own = json!({"experiment": "hopper", "contact": {"condition": "wet",
        "fillet_fillet": {"surface_energy_j_m2": 0.01}, "fillet_belt": {"static_friction": 0.4}}});
    let own = from_value(&own).unwrap();
    assert_eq!(own.contact.fillet_belt.static_friction, 0.4);
    assert_eq!(own.contact.fillet_equipment.surface_energy_j_m2, 0.01);
    assert_eq!(own.contact.condition, Condition::Wet);
}

#[test]
fn belt_and_equipment_contacts_default_to_the_fillet_contact() {
    let scenario = from_value(&json!({"experiment": "hopper", "contact": {
        "fillet_fillet": {"static_friction": 0.7, "restitution": 0.3, "surface_energy_j_m2": 0.2},
        "fillet_equipment": {"static_friction": 0.9, "restitution": 0.4}}}))
    .unwrap();
    assert_eq!(scenario.contact.fillet_equipment.restitution, 0.4);
    assert_eq!(scenario.contact.fillet_belt.restitution, 0.3);
    assert_eq!(scenario.contact.fillet_equipment.surface_energy_j_m2, 0.2);
    assert_eq!(scenario.contact.fillet_belt.surface_energy_j_m2, 0.2);
    assert_eq!(scenario.contact.fillet_belt.static_friction, 0.5);
}

#[test]
fn the_two_densities_exclude_each_other() {
    let scenario =
        from_value(&json!({"experiment": "hopper", "product": {"subparticle_density_kg_m3": 2200}})).unwrap();
    assert_eq!(scenario.product.subparticle_density_kg_m3, Some(2200.0));
    assert_eq!(scenario.product.density_kg_m3, None);
    assert_eq!(from_value(&serde_json::to_value(&scenario).unwrap()).unwrap(), scenario);
}

#[test]
fn a_timestep_may_be_automatic() {
    let scenario = from_value(&with("/numerics/timestep_s", json!("auto"))).unwrap();
    assert_eq!(scenario.numerics.timestep_s, Timestep::Auto(Auto::Auto));
    assert_eq!(
        serde_json::to_value(&scenario).unwrap().pointer("/numerics/timestep_s"),
        Some(&json!("auto"))
    );
}

#[test]
fn invalid_json_is_one_syntax_error_with_line_and_column() {
    for (text, place, part) in [
        ("{\"seed\": NaN}", (1, 10), "expected value"),
        ("{\n \"seed\": 1e999}", (2, 14), "number out of range"),
        ("{\"seed\": 1,\n \"seed\": 2}", (2, 7), "\"seed\" stands twice"),
        ("", (1, 0), "EOF"),
        ("{} {}", (1, 4), "trailing characters"),
    ] {
        match parse(text) {
            Err(ScenarioError::Syntax { line, column, message }) => {
                assert_eq!((line, column), place, "{text}: {message}");
                assert!(message.contains(part) && !message.contains(" line "), "{text}: {message}");
            }
            other => panic!("{text}: {other:?}"),
        }
    }
}

#[test]
fn excessive_nesting_is_a_syntax_error() {
    let text = format!("{}{}", "[".repeat(100_000), "]".repeat(100_000));
    assert!(matches!(parse(&text), Err(ScenarioError::Syntax { .. })));
}

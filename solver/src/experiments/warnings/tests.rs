//! Rules of warnings against hand-made responses and hand-calculated figures.

use std::collections::BTreeSet;

use serde_json::{Map, Value, json};

use super::*;
use crate::mesh::Meshes;
use crate::scenario::from_value;
use crate::{Limits, check};

fn checked(document: &Value) -> crate::Checked {
    let scenario = from_value(document).unwrap_or_else(|faults| panic!("{faults:?}"));
    check(&scenario, &Meshes::default(), &Limits::NONE).expect("a scenario that can run")
}

fn hopper(product: Value, material: Value) -> Value {
    json!({"experiment": "hopper", "product": product, "material": material})
}

fn codes(warnings: &[Warning]) -> Vec<&str> {
    warnings.iter().map(|warning| warning.code.as_str()).collect()
}

#[test]
fn codes_are_unique_words_and_actions_are_sentences() {
    let codes: BTreeSet<_> = ALL_WARNINGS.iter().map(|kind| kind.code).collect();
    assert_eq!(codes.len(), ALL_WARNINGS.len());
    for kind in ALL_WARNINGS {
        assert!(kind.code.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_'), "{}", kind.code);
        assert!(kind.when.ends_with('.') && kind.action.ends_with('.'), "{}", kind.code);
        assert!(warnings_markdown().contains(&format!("| `{}` | {}", kind.code, kind.when)));
    }
}

#[test]
fn the_papers_hopper_has_no_warnings_before_the_run() {
    let checked = checked(&json!({"experiment": "hopper"}));
    assert_eq!(checked.warnings(), []);
    assert_eq!(checked.estimate().warnings, [""; 0]);
}

#[test]
fn every_limit_of_a_response_has_its_warning() {
    let checked = checked(&json!({"experiment": "hopper", "product": {"count": 6}}));
    // Six fillets, one of each shape, weigh 940 kg/m³ times their volume.
    let mass_kg = checked.estimate().mass_kg;
    let of = |name: &str, value: Value| {
        let responses = Map::from_iter([(name.to_owned(), value)]);
        of_responses(checked.setup(), &responses)
    };
    let limits = [
        ("escaped_kg", json!(0.0), json!(mass_kg / 50.0), "escaped_mass", "(2.00 %)"),
        ("passed_through", json!(0), json!(3), "passed_through", "3 times"),
        ("bonds_intact_fraction", json!(0.951), json!(0.949), "broken_bonds", "5.1 %"),
        ("max_overlap_ratio", json!(0.999), json!(1.25), "deep_overlap", "1.25 R"),
        ("interpenetrated_fraction", json!(0.019), json!(0.0512), "interpenetration", "5.1 %"),
        ("bulk_density_kg_m3", json!(939.0), json!(1034.0), "dense_bed", "1.10 times the 940 kg/m³"),
    ];
    for (name, sound, bad, code, figure) in limits {
        assert_eq!(of(name, sound), [], "{name}");
        assert_eq!(of(name, Value::Null), [], "{name}");
        let warnings = of(name, bad);
        assert_eq!(codes(&warnings), [code]);
        assert!(warnings[0].message.contains(figure), "{}", warnings[0].message);
    }
}

#[test]
fn a_sub_particle_density_gives_the_density_of_the_fillet() {
    // Spheres take π/6 of their cells: 2200 kg/m³ in them are 1152 kg/m³ in the lattice.
    let checked = checked(&hopper(json!({"count": 6, "subparticle_density_kg_m3": 2200}), json!({})));
    let of = |bulk: f64| {
        let responses = Map::from_iter([("bulk_density_kg_m3".to_owned(), json!(bulk))]);
        of_responses(checked.setup(), &responses).len()
    };
    assert_eq!((of(1100.0), of(1200.0)), (0, 1));
}

#[test]
fn fill_of_whole_spheres_has_a_warning_with_its_volume_share() {
    let checked = checked(&hopper(json!({"count": 6, "fill": "whole_spheres"}), json!({})));
    assert_eq!(codes(checked.warnings()), ["whole_spheres", "thin_fillet"]);
    let message = &checked.warnings()[0].message;
    let kinds = &checked.setup().kinds;
    let points: usize = kinds.iter().map(|kind| kind.meta.points.len()).sum();
    let volume_m3: f64 = kinds.iter().map(|kind| kind.meta.volume_m3).sum();
    let percent = 100.0 * 0.008f64.powi(3) * points as f64 / volume_m3;
    assert!((20.0..80.0).contains(&percent), "{percent}");
    assert!(
        message.contains(&format!("takes {percent:.0} % ")) && message.contains("940 kg/m³"),
        "{message}"
    );
    assert_eq!(checked.estimate().warnings[0], *message);
}

#[test]
fn fill_of_single_spheres_is_refused() {
    for fill in ["whole_spheres", "centres"] {
        let document = hopper(json!({"spheres": true, "fill": fill}), json!({}));
        let faults = from_value(&document).expect_err("refused");
        assert_eq!(faults.iter().map(|fault| fault.pointer.as_str()).collect::<Vec<_>>(), ["/product/fill"]);
    }
}

#[test]
fn tissue_too_soft_for_the_weight_of_the_bed_has_a_warning() {
    // 38.21 kg on 0.59 × 0.30 m are 2.12 kPa. δ = R/2 takes E* = 3p / 0.5^1.5 = 17.97 kPa, E = 15.5 kPa.
    let of = |e: f64| checked(&hopper(json!({}), json!({"youngs_modulus_pa": e}))).warnings().to_vec();
    assert_eq!(codes(&of(16_000.0)), [""; 0]);
    let warnings = of(15_000.0);
    assert_eq!(codes(&warnings), ["soft_tissue"]);
    assert!(warnings[0].message.contains("0.51 R"), "{}", warnings[0].message);
    // A single fillet weighs a tenth of that: five layers of 8 mm, 940 · 9.81 · 0.04 = 369 Pa.
    let single = |e: f64| checked(&json!({"experiment": "drop", "material": {"youngs_modulus_pa": e}}));
    assert_eq!(codes(single(4000.0).warnings()), [""; 0]);
    assert_eq!(codes(single(2000.0).warnings()), ["soft_tissue"]);
}

#[test]
fn belt_too_slow_for_jam_detection_has_a_warning() {
    let of = |speed: f64, numerics: Value| {
        let document = json!({
            "experiment": "hopper",
            "product": {"count": 6, "subparticle_radius_m": 0.008},
            "equipment": {"belt_speed_m_s": speed},
            "numerics": numerics,
        });
        checked(&document)
    };
    let is_slow = |checked: &crate::Checked| codes(checked.warnings()).contains(&"slow_belt");
    // Three diameters are 48 mm, which take 4.8 s at 1 cm/s.
    let slow = of(0.01, json!({}));
    assert!(is_slow(&slow));
    let message = &slow.warnings().last().unwrap().message;
    assert!(message.contains("moves 1.000e-2 m at 0.01 m/s") && message.contains("4.80 s"), "{message}");
    assert_eq!(slow.estimate().warnings.last(), Some(message));
    assert!(is_slow(&of(0.01, json!({"jam_after_s": 4.7}))));
    assert!(!is_slow(&of(0.01, json!({"jam_after_s": 4.9}))));
    assert!(!is_slow(&of(0.05, json!({}))));
    let stop = json!({"jam_after_s": 5.0, "stop": {"when_jammed_s": 0.5}});
    assert!(is_slow(&of(0.05, stop)), "the shorter time counts");
    // A belt at rest has its own warning.
    assert!(!is_slow(&of(0.0, json!({}))));
}

/// A hopper of plates, 0.3 m long, 0.15 m wide and 0.5 m high, with other fields of all its parts but the belt.
fn plates(part: &Value) -> Value {
    let plate = |name: &str, corner: [f64; 3], u: [f64; 3], v: [f64; 3]| {
        let mut plate = json!({"name": name, "plate_m": [corner, u, v]});
        plate.as_object_mut().unwrap().extend(part.as_object().unwrap().clone());
        plate
    };
    let (along, across) = ([0.3, 0.0, 0.0], [0.0, 0.15, 0.0]);
    let mut shutter = plate("shutter", [0.0, -0.075, 0.0], across, [0.0, 0.0, 0.06]);
    shutter["presence"] = json!("until_start");
    let belt = json!({"name": "belt", "plate_m": [[-0.4, -0.3, 0], [1.4, 0, 0], [0, 0.6, 0]], "kind": "belt", "motion": "belt",
                      "velocity_m_s": [0.25, 0, 0]});
    let surfaces = json!([
        plate("back", [-0.3, -0.075, 0.0], across, [0.0, 0.0, 0.5]),
        plate("left", [-0.3, -0.075, 0.0], along, [0.0, 0.0, 0.5]),
        plate("right", [-0.3, 0.075, 0.0], along, [0.0, 0.0, 0.5]),
        plate("gate", [0.0, -0.075, 0.06], across, [0.0, 0.0, 0.44]),
        shutter,
        belt,
    ]);
    // The only sphere lies at x = -0.135 and y = -0.039 m, away from all walls in wrong places.
    json!({
        "experiment": "hopper",
        "seed": 11,
        "product": {"count": 1, "spheres": true, "subparticle_radius_m": 0.008},
        "equipment": {"parametric": false, "hopper_length_m": 0.3, "hopper_width_m": 0.15, "hopper_height_m": 0.5, "surfaces": surfaces},
    })
}

/// Message of the warning about the walls around the floor.
fn open_region(document: &Value) -> Option<String> {
    let warnings = checked(document).warnings().to_vec();
    warnings.into_iter().find(|warning| warning.code == "open_filling_region").map(|warning| warning.message)
}

/// The sentences of the warning for numbers of lines on each side, and the distance of a wall in the region from its border.
fn faults_of_sides(sides: &[(&str, usize, usize, &str)]) -> String {
    let mut sentences = String::new();
    for (side, open, inside, depth) in sides {
        if *open > 0 {
            sentences += &format!(" Towards {side}, {open} of 18 lines meet no wall nearby.");
        }
        if *inside > 0 {
            sentences += &format!(
                " Towards {side}, {inside} of 18 lines meet a wall inside the region, up to {depth} m from its border."
            );
        }
    }
    sentences
}

#[test]
fn a_hopper_of_plates_beside_its_filling_region_has_a_warning_with_the_figures() {
    let at = |x: f64, y: f64| json!({"position_m": [x, y, 0.0]});
    for part in [json!({}), at(0.007, 0.0), at(0.0, 0.007), at(0.0, -0.007), at(-0.02, 0.0)] {
        assert_eq!(open_region(&plates(&part)), None, "{part}");
    }
    // About the middle of the region, nearly: walls at x = -0.235 and -0.085 m, and at y = -0.16 and 0.14 m.
    let turned = json!({"position_m": [-0.16, 0.14, 0.0], "orientation_deg": [90.0, 0.0, 0.0]});
    let cases: [(Value, &[_]); 6] = [
        (at(0.0, 0.1), &[("-x", 12, 0, ""), ("-y", 18, 0, ""), ("+y", 0, 18, "0.050")]),
        (at(0.0, -0.009), &[("+y", 0, 18, "0.009")]),
        (at(-0.1, 0.0), &[("-y", 6, 0, ""), ("+y", 6, 0, "")]),
        (at(0.1, 0.0), &[("-x", 0, 18, "0.100"), ("-y", 6, 0, ""), ("+y", 6, 0, "")]),
        (turned, &[("-x", 0, 18, "0.065"), ("-y", 12, 0, ""), ("+y", 9, 0, "")]),
        (json!({"position_m": [0.0, 0.0, 0.05]}), &[("-x", 6, 0, ""), ("-y", 6, 0, ""), ("+y", 6, 0, "")]),
    ];
    for (part, sides) in cases {
        let message = open_region(&plates(&part)).unwrap_or_else(|| panic!("{part}"));
        let place = "from x = -0.300 to 0 m and y = -0.075 to 0.075 m";
        let drawn = "at heights of 0.042 to 0.208 m.";
        let figures = format!("{drawn}{} With the command", faults_of_sides(sides));
        assert!(message.contains(place) && message.contains(&figures), "{part}: {message}\n{figures}");
    }
}

#[test]
fn only_walls_at_the_border_close_the_filling_region() {
    let mut hopper = plates(&json!({}));
    let sound = hopper.clone();
    let towards = |hopper: &Value, sides: &[_]| {
        let message = open_region(hopper).expect("a warning");
        assert!(message.contains(&format!("m.{} With", faults_of_sides(sides))), "{message}");
    };
    // The material of a belt makes no belt.
    hopper["equipment"]["surfaces"][1]["kind"] = json!("belt");
    assert_eq!(open_region(&hopper), None);
    hopper["equipment"]["surfaces"][1]["motion"] = json!("belt");
    hopper["equipment"]["surfaces"][1]["velocity_m_s"] = json!([0.25, 0.0, 0.0]);
    towards(&hopper, &[("-y", 18, 0, "")]);
    // A wall that counts until the belt starts.
    hopper["equipment"]["surfaces"][1] = sound["equipment"]["surfaces"][1].clone();
    hopper["equipment"]["surfaces"][1]["presence"] = json!("until_start");
    assert_eq!(open_region(&hopper), None);
    // A chute in front of the lowest lines leaves the wall free above.
    let chute = json!({"name": "chute", "plate_m": [[-0.3, 0.03, 0.0], [0.3, 0, 0], [0, 0.045, 0.1]]});
    let mut chuted = sound.clone();
    chuted["equipment"]["surfaces"].as_array_mut().unwrap().push(chute);
    assert_eq!(open_region(&chuted), None);
    // A housing encloses a hopper that lies beside the region.
    let mut housed = plates(&json!({"position_m": [0.0, 0.2, 0.0]}));
    for (corner, edge) in [
        ([-0.7, -0.4, 0.0], [0.0, 0.8, 0.0]),
        ([-0.7, -0.4, 0.0], [1.7, 0.0, 0.0]),
        ([-0.7, 0.4, 0.0], [1.7, 0.0, 0.0]),
    ] {
        let side =
            json!({"name": format!("housing {corner:?} {edge:?}"), "plate_m": [corner, edge, [0, 0, 0.5]]});
        housed["equipment"]["surfaces"].as_array_mut().unwrap().push(side);
    }
    towards(&housed, &[("-x", 6, 0, ""), ("-y", 6, 0, "")]);
    // A periodic hopper has no side walls, and its other surfaces go past the seams.
    let mut periodic = sound;
    periodic["equipment"]["side_walls"] = json!("periodic");
    let surfaces = periodic["equipment"]["surfaces"].as_array_mut().unwrap();
    surfaces.drain(1..3);
    for surface in surfaces.iter_mut().filter(|surface| surface["name"] != "belt") {
        surface["plate_m"][0][1] = json!(-0.2);
        surface["plate_m"][1] = json!([0.0, 0.4, 0.0]);
    }
    assert_eq!(open_region(&periodic), None);
    periodic["equipment"]["surfaces"][0]["position_m"] = json!([0.1, 0.0, 0.0]);
    towards(&periodic, &[("-x", 0, 18, "0.100")]);
}

#[test]
fn warnings_count_fed_fillets_only_after_they_enter() {
    let of = |feed_kg_s: f64| {
        let document = json!({
            "experiment": "hopper",
            "product": {"count": 6},
            "material": {"youngs_modulus_pa": 2000.0},
            "equipment": {"feed_kg_s": feed_kg_s},
        });
        checked(&document)
    };
    let (fed, filled) = (of(20.0), of(0.0));
    assert!(fed.estimate().mass_kg > 20.0 * filled.estimate().mass_kg);
    assert_eq!(fed.warnings(), filled.warnings());
    // Half of the filling has escaped, or a quarter of what had entered by then.
    let mass_kg = filled.estimate().mass_kg;
    for (fed_kg, figure) in [(0.0, "(50.00 %)"), (mass_kg, "(25.00 %)")] {
        let numbers = [("escaped_kg", json!(mass_kg / 2.0)), ("fed_kg", json!(fed_kg))];
        let responses = Map::from_iter(numbers.map(|(name, value)| (name.to_owned(), value)));
        let warnings = of_responses(fed.setup(), &responses);
        assert!(warnings[0].message.contains(figure), "{}", warnings[0].message);
    }
}

#[test]
fn every_monitor_warns_of_a_test_that_never_began() {
    use crate::result::EndReason::{Duration, FillNotAtRest};
    for experiment in crate::scenario::fields::EXPERIMENTS {
        let mut document = json!({"experiment": experiment});
        if *experiment == "scene" {
            let plate = json!({"name": "floor", "plate_m": [[-1, -1, 0], [2, 0, 0], [0, 2, 0]]});
            document["scene"] = json!({"bodies": [{"position_m": [0, 0, 1]}], "surfaces": [plate]});
        }
        let monitor = checked(&document).setup().monitor();
        let reason = if *experiment == "hopper" { FillNotAtRest } else { Duration };
        let warnings = monitor.warnings(reason);
        assert_eq!(codes(&warnings), ["test_never_began"], "{experiment}");
        assert!(!warnings[0].message.contains("fell off"), "{}", warnings[0].message);
    }
}

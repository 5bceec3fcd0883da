//! Tests of designs against published tables and SciPy.

use std::collections::BTreeSet;

use super::*;
use crate::sweep::designs::testing::{self, digits, edges, random, sobol};

fn latin_hypercube(points: u32, factor: usize, seed: u64) -> Vec<f64> {
    testing::latin_hypercube(points, factor, seed).collect()
}

fn numbers(values: &Value) -> Vec<f64> {
    values.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()).collect()
}

/// Centred L2 discrepancy (Hickernell 1998).
fn discrepancy(points: &[Vec<f64>]) -> f64 {
    let (n, d) = (points.len() as f64, points[0].len() as i32);
    let from = |x: &f64| (x - 0.5).abs();
    let one: f64 = points
        .iter()
        .map(|point| point.iter().map(|x| 1.0 + 0.5 * from(x) - 0.5 * from(x).powi(2)).product::<f64>())
        .sum();
    let two: f64 = points
        .iter()
        .flat_map(|a| points.iter().map(move |b| (a, b)))
        .map(|(a, b)| {
            let of = |(x, y): (&f64, &f64)| 1.0 + 0.5 * from(x) + 0.5 * from(y) - 0.5 * (x - y).abs();
            a.iter().zip(b).map(of).product::<f64>()
        })
        .sum();
    (13.0 / 12.0_f64).powi(d) - 2.0 / n * one + two / (n * n)
}

fn drawn(kind: &str, seed: u64) -> Vec<Vec<f64>> {
    let columns: Vec<_> = (0..3).map(|factor| latin_hypercube(64, factor, seed)).collect();
    (0..64)
        .map(|point| match kind {
            "sobol" => (0..3).map(|factor| sobol(point, factor, seed)).collect(),
            "random" => random(point, seed).take(3).collect(),
            _ => columns.iter().map(|column| column[point as usize]).collect(),
        })
        .collect()
}

#[test]
fn discrepancies_match_scipy() {
    let expected = &scipy()["discrepancy"];
    let points: Vec<Vec<f64>> = expected["points"].as_array().unwrap().iter().map(numbers).collect();
    let value = expected["value"].as_f64().unwrap();
    assert!((discrepancy(&points) - value).abs() < 1e-12, "both discrepancies have the same definition");
    for kind in ["sobol", "latin_hypercube", "random"] {
        let [low, middle, high] = numbers(&expected["quantiles"][kind])[..] else {
            panic!("three quantiles")
        };
        let mut found: Vec<f64> = (0..40).map(|seed| discrepancy(&drawn(kind, seed))).collect();
        found.sort_by(f64::total_cmp);
        assert!(low * 0.95 < found[0] && found[39] < high * 1.05, "{kind}: {found:?} in {low} to {high}");
        assert!((found[20] / middle - 1.0).abs() < 0.15, "{kind}: {} near {middle}", found[20]);
    }
}

#[test]
fn sobol_directions_match_scipy() {
    for (index, point) in scipy()["sobol"].as_array().unwrap().iter().enumerate() {
        for (factor, expected) in numbers(point).into_iter().enumerate() {
            // SciPy orders the points by a Gray code.
            let index = (index ^ (index >> 1)) as u32;
            let bits = sobol_burley::parts::sobol_rev(index.reverse_bits(), factor as u32).reverse_bits();
            assert_eq!(f64::from(bits) / 2_f64.powi(32), expected, "point {index}, factor {factor}");
        }
    }
}

#[test]
fn a_power_of_two_of_sobol_points_fills_every_elementary_box() {
    for seed in [0, 1, 1 << 40] {
        for power in 1..=8 {
            let n = 1_u32 << power;
            // In one factor every n-th part, in the first two every box of area 1/n, whatever its shape.
            for shape in 0..=power {
                let boxes: BTreeSet<(u32, u32)> = (0..n)
                    .map(|point| {
                        let cell =
                            |factor, bits: u32| (sobol(point, factor, seed) * f64::from(1 << bits)) as u32;
                        (cell(0, shape), cell(1, power - shape))
                    })
                    .collect();
                assert_eq!(boxes.len(), n as usize, "seed {seed}, {n} points, shape {shape}");
            }
        }
    }
    assert_ne!(sobol(3, 0, 1), sobol(3, 0, 2), "seeds change the scrambling");
    assert_ne!(sobol(3, 0, 1), sobol(3, 0, 1 | 1 << 40), "all bits of the seed count");
}

#[test]
fn each_part_of_a_latin_hypercube_holds_one_point() {
    for factor in 0..5 {
        let column = latin_hypercube(100, factor, 7);
        let parts: BTreeSet<u32> = column.iter().map(|x| (x * 100.0) as u32).collect();
        assert_eq!(parts.len(), 100);
        assert_eq!(column, latin_hypercube(100, factor, 7), "reproducible");
        assert_ne!(column, latin_hypercube(100, factor, 8));
        assert_ne!(column, latin_hypercube(100, factor + 1, 7), "each factor has its own order");
    }
}

/// The points of a published table: a row per block, ± for every combination of low and high.
fn published(table: &str) -> Vec<Vec<i8>> {
    let mut points = Vec::new();
    for line in table.lines().map(str::trim).filter(|line| !line.is_empty()) {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let places: Vec<usize> = (0..cells.len()).filter(|place| cells[*place] == "±").collect();
        for signs in 0..1_u32 << places.len() {
            let mut point = vec![0; cells.len()];
            for (bit, place) in places.iter().rev().enumerate() {
                point[*place] = if signs & (1 << bit) == 0 { -1 } else { 1 };
            }
            points.push(point);
        }
    }
    points
}

#[test]
fn box_behnken_designs_match_published_tables() {
    // Three factors from the NIST handbook (5.3.3.6.2), in our order.
    let three = [
        [-1, -1, 0],
        [-1, 1, 0],
        [1, -1, 0],
        [1, 1, 0],
        [-1, 0, -1],
        [-1, 0, 1],
        [1, 0, -1],
        [1, 0, 1],
        [0, -1, -1],
        [0, -1, 1],
        [0, 1, -1],
        [0, 1, 1],
    ];
    assert_eq!(edges(3), three.map(Vec::from));
    // Box and Behnken 1960, tables for four to seven factors.
    let tables = [
        "± ± 0 0 \n 0 0 ± ± \n ± 0 0 ± \n 0 ± ± 0 \n ± 0 ± 0 \n 0 ± 0 ±",
        "± ± 0 0 0 \n 0 0 ± ± 0 \n 0 ± 0 0 ± \n ± 0 ± 0 0 \n 0 0 0 ± ±
         0 ± ± 0 0 \n ± 0 0 ± 0 \n 0 0 ± 0 ± \n ± 0 0 0 ± \n 0 ± 0 ± 0",
        "± ± 0 ± 0 0 \n 0 ± ± 0 ± 0 \n 0 0 ± ± 0 ± \n ± 0 0 ± ± 0 \n 0 ± 0 0 ± ± \n ± 0 ± 0 0 ±",
        "0 0 0 ± ± ± 0 \n ± 0 0 0 0 ± ± \n 0 ± 0 0 ± 0 ± \n ± ± 0 ± 0 0 0 \n 0 0 ± ± 0 0 ± \n ± 0 ± 0 ± 0 0
         0 ± ± 0 0 ± 0",
    ];
    for (factors, (table, size)) in (4..).zip(tables.into_iter().zip([24, 40, 48, 56])) {
        let points = edges(factors);
        assert_eq!(points, published(table), "{factors} factors");
        assert_eq!(points.len(), size);
        // Factors are balanced and uncorrelated.
        for a in 0..factors {
            assert_eq!(points.iter().map(|point| i32::from(point[a])).sum::<i32>(), 0);
            for b in 0..a {
                assert_eq!(points.iter().map(|point| i32::from(point[a] * point[b])).sum::<i32>(), 0);
            }
        }
    }
}

#[test]
fn a_box_behnken_sweep_takes_low_middle_and_high() {
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}, {"pointer": BELT, "low": 0.1, "high": 0.4, "scale": "log"},
                         {"pointer": COUNT, "levels": [4, 6, 7]}]);
    let points = matrix(&of_design(json!({"kind": "box_behnken"}), factors.clone()));
    assert_eq!(points.len(), 13);
    assert_eq!(points[0], [json!(0.05), json!(0.1), json!(6)]);
    assert_eq!(points[11], [json!(0.06), json!(0.4), json!(7)]);
    assert_eq!(points[12], [json!(0.06), json!(0.2), json!(6)], "one centre, at the end");
    let two = of_design(json!({"kind": "box_behnken"}), json!([factors[0], factors[1]]));
    assert_eq!(faults(&two)[0].pointer, "/factors");
}

#[test]
fn a_grid_counts_with_the_last_factor_fastest() {
    let digits: Vec<_> = (0..6).map(|index| digits(&[2, 3], index)).collect();
    assert_eq!(digits, [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]);
    let alone = matrix(&spec(json!([])));
    assert_eq!(json!(alone), json!([[]]), "a grid without factors has one point");
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.06}, {"pointer": COUNT, "low": 3, "high": 9, "count": 3},
                         {"pointer": BELT, "low": 0.1, "high": 0.4, "scale": "log", "count": 3}]);
    let points = matrix(&spec(factors));
    assert_eq!(points.len(), 2 * 3 * 3);
    assert_eq!(points[1], [json!(0.05), json!(3), json!(0.2)], "equal steps on the scale of each range");
    assert_eq!(points[17], [json!(0.06), json!(9), json!(0.4)]);
    let uncountable = json!([{"pointer": GATE, "low": 0.05, "high": 0.06, "count": 1000},
                             {"pointer": BELT, "low": 0.1, "high": 0.4, "count": 1000}]);
    assert!(faults(&spec(uncountable))[0].detail.contains("1000000 jobs"));
}

#[test]
fn one_at_a_time_starts_from_the_base_without_repeating_it() {
    let factors = json!([{"pointer": "/contact/condition", "levels": ["dry", "wet"]},
                         {"pointer": COUNT, "levels": [4, 6, 8]},
                         {"pointer": "/contact/fillet_belt/static_friction", "levels": [0.1]}]);
    let points = matrix(&of_design(json!({"kind": "one_at_a_time"}), factors));
    let friction = points[0][2].clone();
    assert_eq!(points.len(), 5);
    assert_eq!(points[0], [json!("dry"), json!(6), friction.clone()]);
    assert_eq!(points[1][..2], [json!("wet"), json!(6)]);
    assert_ne!(points[1][2], friction, "a default of wet");
    assert_eq!(points[2], [json!("dry"), json!(4), friction.clone()]);
    assert_eq!(points[3], [json!("dry"), json!(8), friction]);
    assert_eq!(points[4], [json!("dry"), json!(6), json!(0.1)]);
}

#[test]
fn drawn_values_follow_range_scale_and_type() {
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}, {"pointer": COUNT, "low": 3, "high": 6},
                         {"pointer": BELT, "low": 0.01, "high": 1.0, "scale": "log"},
                         {"pointer": "/contact/condition", "levels": ["dry", "wet"]}]);
    for kind in ["random", "latin_hypercube", "sobol"] {
        let design = json!({"kind": kind, "points": 64, "seed": 3});
        let points = matrix(&of_design(design.clone(), factors.clone()));
        assert_eq!(points.len(), 64);
        assert_eq!(points, matrix(&of_design(design, factors.clone())), "reproducible");
        assert_ne!(
            points,
            matrix(&of_design(json!({"kind": kind, "points": 64, "seed": 4}), factors.clone()))
        );
        let column = |factor: usize| points.iter().map(move |point| point[factor].clone());
        assert!(column(0).all(|gate| (0.05..=0.07).contains(&gate.as_f64().unwrap())));
        for count in 3..=6 {
            let share = column(1).filter(|value| value == &json!(count)).count();
            let expected = if kind == "random" { 6..=26 } else { 16..=16 };
            assert!(expected.contains(&share), "{kind}: {share} of {count}");
        }
        let slow = column(2).filter(|belt| belt.as_f64().unwrap() < 0.1).count();
        assert!((22..=42).contains(&slow), "{kind}: half of the logarithms, not a tenth: {slow}");
        let wet = column(3).filter(|condition| condition == "wet").count();
        assert!((20..=44).contains(&wet), "{kind}: {wet}");
    }
}

#[test]
fn a_longer_sequence_starts_with_the_shorter_one() {
    let factors =
        json!([{"pointer": GATE, "low": 0.05, "high": 0.07}, {"pointer": BELT, "low": 0.1, "high": 0.4}]);
    for kind in ["random", "sobol"] {
        let of = |points: u32| matrix(&of_design(json!({"kind": kind, "points": points}), factors.clone()));
        assert_eq!(of(20)[..7], of(7));
    }
}

#[test]
fn linked_fields_take_the_same_value() {
    let linked = ["/bonds/normal_stiffness_n_m3", "/bonds/shear_stiffness_n_m3"];
    let sweep = spec(json!([{"pointers": linked, "levels": [5e5, 7e5]}]));
    let expansion = expand(&sweep, &Meshes::default(), LIMITS).unwrap();
    assert_eq!(expansion.factors, [linked[0]]);
    for (point, expected) in expansion.points.iter().zip([5e5, 7e5]) {
        let complete = json!(point.scenario);
        assert!(linked.iter().all(|field| complete.pointer(field) == Some(&json!(expected))), "{complete:#}");
        assert_eq!(point.levels[linked[0]], json!(expected));
    }
}

#[test]
fn lists_and_tables_hold_the_points() {
    let factors = json!([{"pointer": GATE}, {"pointer": "/contact/condition"}]);
    let rows = json!([[0.05, "dry"], [0.06, "wet"]]);
    let listed = matrix(&of_design(json!({"kind": "list", "rows": rows}), factors.clone()));
    assert_eq!(json!(listed), rows);
    let table = format!("/contact/condition,{GATE}\ndry, 5e-2\nwet,.06\n");
    let read = matrix(&of_design(json!({"kind": "csv", "table": table}), factors));
    assert_eq!(json!(read), rows, "columns in any order");
    let headed = matrix(&of_design(json!({"kind": "csv", "table": table}), json!([])));
    assert_eq!(headed[1], [json!("wet"), json!(0.06)], "without factors, every column is a factor");
}

#[test]
fn drawn_points_match_their_pinned_digests() {
    let factors = json!([{"pointer": GATE, "low": 0.05, "high": 0.07}, {"pointer": COUNT, "low": 3, "high": 6},
                         {"pointer": BELT, "low": 0.01, "high": 1.0, "scale": "log"},
                         {"pointer": "/contact/condition", "levels": ["dry", "wet"]}]);
    let digest = |kind: &str| {
        let points = matrix(&of_design(json!({"kind": kind, "points": 64, "seed": 3}), factors.clone()));
        blake3::hash(json!(points).to_string().as_bytes()).to_hex()[..16].to_owned()
    };
    let digests = ["random", "latin_hypercube", "sobol"].map(digest);
    assert_eq!(digests, ["e66f0874ff654772", "6bcbcaaeb47b8a13", "016a6fa311770d42"]);
}

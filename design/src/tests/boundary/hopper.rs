//! Studies of a real truth: the jam probability of a hopper slice, simulated at every point of a grid.
//!
//! `docs/data/hopper_map.py` makes the table.

use std::sync::LazyLock;

use super::truths::Truth;
use super::{answer, holds, misclassified, question};
use crate::goals::Place;
use crate::tests::truth::{Random, play};

/// Points of the grid in each direction.
const SIDE: usize = 8;

/// Jam probability level of the boundary.
const LEVEL: f64 = 0.2;

/// The table: the share of jammed runs by gate opening, then by friction of the belt, and the number of all runs.
static MAP: LazyLock<(Vec<f64>, usize)> = LazyLock::new(|| {
    let table = include_str!("../../../../docs/data/hopper-map.csv");
    let mut shares = Vec::new();
    let mut count = 0;
    for row in table.lines().skip(1) {
        let cells: Vec<f64> = row.split(',').map(|cell| cell.parse().unwrap()).collect();
        shares.push(cells[2] / cells[3]);
        count += cells[3] as usize;
    }
    assert_eq!(shares.len(), SIDE * SIDE, "a row for each point of the grid");
    (shares, count)
});

/// The jam probability at coordinates from 0 to 1, interpolated between the four points around it.
fn jam_probability(x: &[f64]) -> f64 {
    let place = |coordinate: f64| {
        let position = coordinate * (SIDE - 1) as f64;
        let cell = (position as usize).min(SIDE - 2);
        (cell, position - cell as f64)
    };
    let ((gate, along_gate), (friction, along_friction)) = (place(x[0]), place(x[1]));
    let share = |gate: usize, friction: usize| MAP.0[gate * SIDE + friction];
    let between = |gate: usize| {
        (1.0 - along_friction) * share(gate, friction) + along_friction * share(gate, friction + 1)
    };
    (1.0 - along_gate) * between(gate) + along_gate * between(gate + 1)
}

fn truth() -> Truth {
    let log_odds = |x: &[f64]| {
        let probability = jam_probability(x);
        (probability / (1.0 - probability)).ln()
    };
    Truth { name: "hopper", factors: 2, function: log_odds, level: LEVEL, noise: None }
}

#[test]
fn the_boundary_of_a_simulated_hopper_is_found_with_a_quarter_of_its_runs() {
    let truth = truth();
    let max_runs = MAP.1 / 4;
    let (mut held, mut wrong) = (0, 0.0);
    let (mut all, mut jam_free) = (0, 0);
    const REPETITIONS: u64 = 4;
    for repetition in 0..REPETITIONS {
        let mut random = Random(repetition);
        let (runs, decision) =
            play(&question(&truth, max_runs, 0.02), ("y", 20, repetition), |x| truth.draw(x, &mut random));
        let answer = answer(&decision);
        let share = misclassified(&truth, &answer.map);
        println!("{} of {} runs, {:.2} % wrong side", runs.len(), MAP.1, 100.0 * share);
        all += runs.len();
        jam_free += runs.iter().filter(|run| jam_probability(&run.point.coordinates()) == 0.0).count();
        assert!(runs.len() <= max_runs && answer.place == Place::Inside);
        held += usize::from(holds(&truth, answer));
        wrong += share / REPETITIONS as f64;
    }
    assert!(4 * jam_free <= all, "{jam_free} of {all} runs are where nothing ever jams");
    assert!(held >= 3, "{held} of {REPETITIONS} bands hold the boundary");
    assert!(wrong <= 0.025, "{wrong} of the map is on the wrong side");
}

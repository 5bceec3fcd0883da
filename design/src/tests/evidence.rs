//! Tests of evidence: canonical order, and points that survive the way to values and back.

use crate::tests::truth::{Random, run};
use crate::{Evidence, Factor, Measure, Outcome, Point, Proposal, Run, Scale};

#[test]
fn order_of_results_does_not_matter() {
    let mut random = Random(1);
    let mut runs = Vec::new();
    for index in 0..40 {
        let point = Point::new(&[f64::from(index % 7) / 7.0, f64::from(index % 3) / 3.0]);
        runs.push(run(&Proposal { point, replicate: index / 5 }, "y", random.normal()));
    }
    let expected = Evidence::new(runs.clone());
    assert!(expected.points().is_sorted_by(|one, other| one.point < other.point));
    for _ in 0..20 {
        for index in (1..runs.len()).rev() {
            runs.swap(index, (random.uniform() * (index + 1) as f64) as usize);
        }
        assert_eq!(Evidence::new(runs.clone()), expected);
    }
}

#[test]
fn a_result_replaces_a_failure_and_a_run_in_flight() {
    let proposal = Proposal { point: Point::new(&[0.5]), replicate: 0 };
    let with = |outcome| Run { point: proposal.point.clone(), replicate: 0, outcome };
    let done = run(&proposal, "y", 2.0);
    for order in [[0, 1, 2], [2, 1, 0], [1, 2, 0]] {
        let states = [with(Outcome::Pending), with(Outcome::Failed), done.clone()];
        let evidence = Evidence::new(order.map(|index: usize| states[index].clone()));
        assert_eq!((evidence.runs(), evidence.failed(), evidence.pending()), (1, 0, 0));
        assert_eq!(evidence.points()[0].values(&Measure::Mean("y".into())), [2.0]);
    }
}

#[test]
fn a_proposed_point_survives_the_way_to_values_and_back() {
    let mut random = Random(2);
    for scale in [Scale::Linear, Scale::Log] {
        let factors = [Factor { name: "x".into(), low: 0.003, high: 7.0, scale }];
        for _ in 0..1000 {
            let point = Point::new(&[random.uniform()]).rounded(&factors);
            assert_eq!(Point::of_values(&factors, &point.values(&factors)), Some(point));
        }
        for value in [0.003, 0.0052, 0.333, 1.0, 6.123] {
            let point = Point::of_values(&factors, &[value]).unwrap();
            assert_eq!(point.values(&factors), [value], "typed values are found again");
        }
    }
    assert_eq!(
        Point::of_values(&[Factor { name: "x".into(), low: 0.0, high: 1.0, scale: Scale::Linear }], &[1.1]),
        None
    );
}

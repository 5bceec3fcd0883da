//! Drives a study to its end: a simulator in place of the workers, results in shuffled order.

use std::collections::{BTreeMap, BTreeSet};

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_design::{Decision, Evidence, Outcome, Proposal, Question, Run, decide};
use serde_json::Value;

/// The generator of a run, by its point, its replicate and a seed.
pub(crate) fn generator(seed: u64, point: &[f64], replicate: u32) -> ChaCha8Rng {
    let words = point.iter().map(|coordinate| coordinate.to_bits()).chain([u64::from(replicate)]);
    let mix = |hash: u64, word: u64| (hash.rotate_left(23) ^ word).wrapping_mul(0x9e37_79b9_7f4a_7c15);
    ChaCha8Rng::seed_from_u64(words.fold(seed, mix))
}

/// A number from 0 to 1.
pub(crate) fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// A normal number with mean 0 and standard deviation 1.
pub(crate) fn normal(generator: &mut ChaCha8Rng) -> f64 {
    let radius = (-2.0 * (1.0 - uniform(generator)).ln()).sqrt();
    radius * (2.0 * std::f64::consts::PI * uniform(generator)).cos()
}

/// The outcome of a run with responses.
pub(crate) fn responses(values: &[(&str, f64)]) -> Outcome {
    let named = values.iter().map(|(name, value)| ((*name).to_owned(), *value));
    Outcome::Responses(named.collect::<BTreeMap<_, _>>())
}

/// The values of factors with ranges.
pub(crate) fn numbers(values: &[Value]) -> Vec<f64> {
    values.iter().map(|value| value.as_f64().expect("a number")).collect()
}

/// The question of a document; it must be without faults.
pub(crate) fn question(document: &Value) -> Question {
    Question::read(document).unwrap_or_else(|faults| panic!("{faults:?}"))
}

/// Runs a study with `workers` until it is finished; each result that arrives makes place for one run more.
pub(crate) fn study(
    question: &Question,
    seed: u64,
    workers: usize,
    simulate: impl Fn(&[f64], u32) -> Outcome,
) -> (Vec<Run>, Decision) {
    let mut order = generator(seed, &[], 0);
    let (mut runs, mut pending): (Vec<Run>, Vec<Proposal>) = (Vec::new(), Vec::new());
    let mut proposed = BTreeSet::new();
    loop {
        let flying = pending.iter().map(|Proposal { point, replicate }| Run {
            point: point.clone(),
            replicate: *replicate,
            outcome: Outcome::Pending,
        });
        let evidence = Evidence::new(runs.iter().cloned().chain(flying));
        let decision = decide(question, &evidence, workers - pending.len(), seed);
        if decision.finished.is_some() {
            return (runs, decision);
        }
        for proposal in &decision.proposals {
            assert!(proposed.insert(proposal.clone()), "{proposal:?} is proposed twice");
        }
        pending.extend(decision.proposals);
        assert!(!pending.is_empty(), "the study neither goes on nor ends");
        // Half of the runs in flight end, in any order.
        for _ in 0..pending.len().div_ceil(2) {
            let next = (uniform(&mut order) * pending.len() as f64) as usize;
            let Proposal { point, replicate } = pending.swap_remove(next);
            let outcome = simulate(&point.coordinates(), replicate);
            runs.push(Run { point, replicate, outcome });
        }
    }
}

/// The same runs in another order, with the first ones repeated, decide the same.
pub(crate) fn assert_order_is_irrelevant(question: &Question, runs: &[Run], wanted: usize, seed: u64) {
    let decision = decide(question, &Evidence::new(runs.iter().cloned()), wanted, seed);
    let again = runs.iter().rev().chain(&runs[..runs.len() / 2]).cloned();
    assert_eq!(decision, decide(question, &Evidence::new(again), wanted, seed));
}

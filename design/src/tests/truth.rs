//! Synthetic truths: random numbers, and runs whose responses are drawn from a known distribution.

use std::collections::BTreeMap;

use crate::{Decision, Evidence, Outcome, Proposal, Question, Run, decide};

/// A generator of random numbers (splitmix64).
pub(crate) struct Random(pub(crate) u64);

impl Random {
    /// A number from 0 to 1 (excluded).
    pub(crate) fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((word ^ (word >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A normal number of mean 0 and variance 1 (Box and Muller 1958).
    pub(crate) fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// A run with one response.
pub(crate) fn run(proposal: &Proposal, response: &str, value: f64) -> Run {
    let responses = BTreeMap::from([(response.to_owned(), value)]);
    Run {
        point: proposal.point.clone(),
        replicate: proposal.replicate,
        outcome: Outcome::Responses(responses),
    }
}

/// Runs a study to its end: every proposal of a batch gets a result of `simulate(coordinates)` before the next decision.
pub(crate) fn play(
    question: &Question,
    (response, batch, seed): (&str, usize, u64),
    mut simulate: impl FnMut(&[f64]) -> f64,
) -> (Vec<Run>, Decision) {
    let mut runs: Vec<Run> = Vec::new();
    loop {
        let decision = decide(question, &Evidence::new(runs.iter().cloned()), batch, seed);
        if decision.finished.is_some() {
            return (runs, decision);
        }
        assert!(!decision.proposals.is_empty(), "an unfinished study proposes runs");
        for proposal in &decision.proposals {
            runs.push(run(proposal, response, simulate(&proposal.point.coordinates())));
        }
    }
}

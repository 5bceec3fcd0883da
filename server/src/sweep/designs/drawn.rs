//! Parts that drawn designs share: parameters, generator, rows. Numbers are a pure function of seed, point and factor.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_api::design::Design as DesignSpec;

use super::planned::PlannedFactor;
use super::{Parameters, Row};

/// The seed of a design that names none.
const DEFAULT_SEED: u64 = 1;

/// Fields of the specification.
pub(super) const FIELDS: &[&str] = &["points", "seed"];

pub(super) fn read(spec: &DesignSpec) -> Option<Parameters> {
    let seed = spec.seed.unwrap_or(DEFAULT_SEED);
    Some(Parameters { points: spec.points?, seed, rows: Vec::new() })
}

/// A generator of one seed; each stream of it is another sequence.
pub(super) fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(stream);
    generator
}

/// A number from 0 to 1 (excluded).
pub(super) fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// The row of numbers from 0 to 1 (excluded), one per factor.
pub(super) fn row(factors: &[PlannedFactor], mut number: impl FnMut(usize) -> f64) -> Row {
    factors.iter().enumerate().map(|(index, factor)| Some(factor.values.at(number(index)))).collect()
}

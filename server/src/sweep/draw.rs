//! Numbers from 0 to 1 (excluded) for drawn designs, a pure function of seed, point and factor.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};

/// The longest Sobol sequence that there is.
pub(super) const MAX_SOBOL_POINTS: u32 = 1 << 16;
/// The most factors that it has numbers for.
pub(super) const MAX_SOBOL_FACTORS: usize = sobol_burley::NUM_DIMENSIONS as usize;

/// A generator of one seed; each stream of it is another sequence.
fn generator(seed: u64, stream: u64) -> ChaCha8Rng {
    let mut generator = ChaCha8Rng::seed_from_u64(seed);
    generator.set_stream(stream);
    generator
}

fn uniform(generator: &mut ChaCha8Rng) -> f64 {
    (generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
}

/// Independent numbers for the factors of one point.
pub(super) fn random(point: u32, seed: u64) -> impl Iterator<Item = f64> {
    let mut generator = generator(seed, u64::from(point));
    std::iter::repeat_with(move || uniform(&mut generator))
}

/// One factor's numbers for all points: one in each of as many equal parts as there are points, in random order (McKay,
/// Beckman and Conover 1979).
pub(super) fn latin_hypercube(points: usize, factor: usize, seed: u64) -> Vec<f64> {
    let mut generator = generator(seed, factor as u64);
    let mut parts: Vec<usize> = (0..points).collect();
    for last in (1..points).rev() {
        parts.swap(last, (uniform(&mut generator) * (last + 1) as f64) as usize);
    }
    parts.into_iter().map(|part| (part as f64 + uniform(&mut generator)) / points as f64).collect()
}

/// One number of the Sobol sequence (directions of Joe and Kuo) in Owen's scrambling by hashes (Burley 2020), which also
/// shuffles the points, but only within what keeps every power of two of them even.
pub(super) fn sobol(point: u32, factor: usize, seed: u64) -> f64 {
    // The crate takes 32 bits; both halves of ours count.
    f64::from(sobol_burley::sample(point, factor as u32, (seed ^ (seed >> 32)) as u32))
}

//! Logarithms of the normal distribution and of expected improvement, exact far into the tails.
//!
//! | symbol | meaning |
//! |---|---|
//! | φ, Φ | density and distribution function of the standard normal distribution |
//! | h(z) | φ(z) + z Φ(z), so that the expectation of max(g − X, 0) for X normal with mean 0 and deviation s is s h(g/s) |
//! | R(t) | Mills' ratio (1 − Φ(t))/φ(t) = 1/(t + K), K = 1/(t + 2/(t + 3/(t + …))) |
//!
//! For z = −t below −3 both are a density times a factor without cancellation: Φ(z) = φ(z) R(t) and h(z) = φ(z) K/(t + K).
//! Improvements of 10⁻³⁰⁰ and less thus still have an order. Ament et al. 2023 ("Unexpected improvements to expected
//! improvement") show what the search gains by that; they write h with erfcx.

use libm::erfc;

/// Below this the continued fraction is used.
const TAIL: f64 = -3.0;
/// Terms of the continued fraction: enough for the last bit at [`TAIL`].
const TERMS: u32 = 80;

/// ln φ(z).
fn ln_density(z: f64) -> f64 {
    -0.5 * z * z - 0.5 * std::f64::consts::TAU.ln()
}

/// Φ(z).
pub(super) fn cdf(z: f64) -> f64 {
    0.5 * erfc(-z * std::f64::consts::FRAC_1_SQRT_2)
}

/// K of Mills' ratio for t of 3 and more.
fn fraction(t: f64) -> f64 {
    1.0 / (t + (2..=TERMS).rev().fold(0.0, |inner, term| f64::from(term) / (t + inner)))
}

/// ln Φ(z).
pub(super) fn ln_cdf(z: f64) -> f64 {
    if z > TAIL { cdf(z).ln() } else { ln_density(z) - (fraction(-z) - z).ln() }
}

/// ln h(z).
pub(super) fn ln_h(z: f64) -> f64 {
    if z > TAIL {
        (ln_density(z).exp() + z * cdf(z)).ln()
    } else {
        let rest = fraction(-z);
        ln_density(z) + (rest / (rest - z)).ln()
    }
}

/// ln of the expected improvement by a normal value with standard deviation `deviation`, whose mean is better than the
/// best by `gap`.
pub(super) fn ln_improvement(gap: f64, deviation: f64) -> f64 {
    if deviation <= 0.0 { gap.max(0.0).ln() } else { deviation.ln() + ln_h(gap / deviation) }
}

/// ln(exp a − exp b) for a ≥ b.
pub(super) fn ln_difference(a: f64, b: f64) -> f64 {
    if b == f64::NEG_INFINITY { a } else { a + (-(b - a).exp_m1()).max(0.0).ln() }
}

/// A sum of numbers that are known by their logarithms.
#[derive(Clone, Copy, Debug)]
pub(super) struct LnSum {
    largest: f64,
    rest: f64,
}

impl LnSum {
    pub(super) const EMPTY: Self = Self { largest: f64::NEG_INFINITY, rest: 0.0 };

    pub(super) fn add(&mut self, ln: f64) {
        if ln == f64::NEG_INFINITY {
        } else if ln <= self.largest {
            self.rest += (ln - self.largest).exp();
        } else {
            self.rest = self.rest * (self.largest - ln).exp() + 1.0;
            self.largest = ln;
        }
    }

    /// ln of the sum.
    pub(super) fn ln(&self) -> f64 {
        self.largest + self.rest.ln()
    }
}

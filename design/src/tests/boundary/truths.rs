//! Synthetic truths over the unit cube.

use crate::tests::truth::Random;

/// A probability or mean as a function of the factors, and its noise.
#[derive(Clone, Copy)]
pub(super) struct Truth {
    pub(super) name: &'static str,
    pub(super) factors: usize,
    /// Log odds of the probability, or the mean.
    pub(super) function: fn(&[f64]) -> f64,
    /// Level of the probability or mean at the boundary.
    pub(super) level: f64,
    /// Standard deviation of a mean's noise; none for a probability.
    pub(super) noise: Option<fn(&[f64]) -> f64>,
}

impl Truth {
    /// The probability or mean.
    pub(super) fn mean(&self, x: &[f64]) -> f64 {
        let value = (self.function)(x);
        if self.noise.is_some() { value } else { 1.0 / (1.0 + (-value).exp()) }
    }

    /// The response of one run.
    pub(super) fn draw(&self, x: &[f64], random: &mut Random) -> f64 {
        match self.noise {
            Some(noise) => self.mean(x) + noise(x) * random.normal(),
            None => f64::from(u8::from(random.uniform() < self.mean(x))),
        }
    }
}

pub(super) const TRUTHS: &[Truth] = &[
    Truth {
        name: "1 factor, probability 0.5",
        factors: 1,
        function: |x| 15.0 * (0.62 - x[0]),
        level: 0.5,
        noise: None,
    },
    Truth {
        name: "1 factor, probability 0.05",
        factors: 1,
        function: |x| 15.0 * (0.4 - x[0]),
        level: 0.05,
        noise: None,
    },
    Truth {
        name: "1 factor, mean, two crossings",
        factors: 1,
        function: |x| (4.0 * x[0]).sin(),
        level: 0.6,
        noise: Some(|_| 0.3),
    },
    Truth {
        name: "2 factors, tilted, probability 0.5",
        factors: 2,
        function: |x| 14.0 * (0.55 - 0.8 * x[0] - 0.35 * (x[1] - 0.5)),
        level: 0.5,
        noise: None,
    },
    Truth {
        name: "2 factors, curved, probability 0.2",
        factors: 2,
        function: |x| 16.0 * (0.25 + 0.5 * x[1] * x[1] - x[0]),
        level: 0.2,
        noise: None,
    },
    Truth {
        name: "2 factors, closed, mean, even noise",
        factors: 2,
        function: |x| 1.0 - 6.0 * ((x[0] - 0.55).powi(2) + 1.5 * (x[1] - 0.45).powi(2)),
        level: 0.5,
        noise: Some(|_| 0.3),
    },
    Truth {
        name: "2 factors, wavy, mean, uneven noise",
        factors: 2,
        function: |x| 3.0 * (x[1] - 0.5 - 0.2 * (6.0 * x[0]).sin()),
        level: 0.0,
        noise: Some(|x| 0.1 + 0.9 * x[0]),
    },
    Truth {
        name: "3 factors, tilted, probability 0.5",
        factors: 3,
        function: |x| 14.0 * (0.6 - 0.7 * x[0] - 0.4 * x[1] - 0.1 * x[2]),
        level: 0.5,
        noise: None,
    },
    Truth {
        name: "3 factors, curved, mean, uneven noise",
        factors: 3,
        function: |x| 4.0 * (x[0] - 0.3 - 0.4 * x[1] * x[1] - 0.15 * (4.0 * x[2]).sin()),
        level: 0.0,
        noise: Some(|x| 0.2 + 0.6 * x[1]),
    },
    Truth {
        name: "4 factors, closed, mean, even noise",
        factors: 4,
        function: |x| 1.0 - x.iter().map(|x| 3.0 * (x - 0.5) * (x - 0.5)).sum::<f64>(),
        level: 0.5,
        noise: Some(|_| 0.2),
    },
];

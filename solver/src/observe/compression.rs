//! Stress, strain and modulus from the forces on two plates (paper sections 2.3.2 and 3.1, Fig. 6).
//!
//! Strain counts from the first contact force. Adhesion first pulls the plates together; the test begins at
//! the last upward zero crossing of the stress before its peak. Strains are relative to the lengths at that
//! moment.

use serde::{Deserialize, Serialize};

/// A compression test, sample by sample.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub struct Compression {
    samples: Vec<CompressionSample>,
    /// Sample of the peak stress, and the last unloaded sample before it.
    peak: Option<(usize, usize)>,
    /// Last sample without a positive stress.
    last_unloaded: usize,
}

/// One sample of a compression test.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct CompressionSample {
    /// Compressive force over area, in pascal; negative where the plates pull.
    pub stress_pa: f64,
    /// Distance of the plates, in metres.
    pub height_m: f64,
    /// Distance of the extensometer's ends, in metres.
    pub gauge_m: f64,
}

impl CompressionSample {
    fn lerp(&self, to: &Self, share: f64) -> Self {
        let mix = |a: f64, b: f64| a + share * (b - a);
        Self {
            stress_pa: mix(self.stress_pa, to.stress_pa),
            height_m: mix(self.height_m, to.height_m),
            gauge_m: mix(self.gauge_m, to.gauge_m),
        }
    }
}

/// A point of the curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StressStrain {
    /// Stress, in pascal.
    pub stress_pa: f64,
    /// Strain by the distance of the plates.
    pub strain: f64,
    /// Strain by the extensometer.
    pub gauge_strain: f64,
}

impl Compression {
    /// Whether its parts fit each other, as they do unless somebody else has written them.
    pub fn is_consistent(&self) -> bool {
        let count = self.samples.len();
        let peak = self.peak.is_none_or(|(peak, unloaded)| peak < count && unloaded < count);
        peak && self.last_unloaded <= count.saturating_sub(1)
    }

    /// Records a sample.
    pub fn record(&mut self, sample: CompressionSample) {
        let k = self.samples.len();
        self.samples.push(sample);
        if sample.stress_pa <= 0.0 {
            self.last_unloaded = k;
        } else if self.peak.is_none_or(|(most, _)| sample.stress_pa > self.samples[most].stress_pa) {
            self.peak = Some((k, self.last_unloaded));
        }
    }

    /// Zero crossing of the stress: the sample before, and the crossing itself by linear interpolation.
    fn first_contact(&self) -> Option<(usize, CompressionSample)> {
        let (_, last_unloaded) = self.peak?;
        let (before, after) = (self.samples[last_unloaded], self.samples.get(last_unloaded + 1)?);
        let share = -before.stress_pa / (after.stress_pa - before.stress_pa);
        Some((last_unloaded, before.lerp(after, share.clamp(0.0, 1.0))))
    }

    /// Strain by the distance of the plates at the last sample; `None` before the first contact force.
    pub fn strain(&self) -> Option<f64> {
        let (_, start) = self.first_contact()?;
        Some(1.0 - self.samples.last()?.height_m / start.height_m)
    }

    /// The curve, from the first contact force on.
    pub fn curve(&self) -> Vec<StressStrain> {
        let Some((last_unloaded, start)) = self.first_contact() else { return Vec::new() };
        let strain = |now: f64, before: f64| if before > 0.0 { 1.0 - now / before } else { 0.0 };
        let point = |sample: &CompressionSample| StressStrain {
            stress_pa: sample.stress_pa,
            strain: strain(sample.height_m, start.height_m),
            gauge_strain: strain(sample.gauge_m, start.gauge_m),
        };
        std::iter::once(&start).chain(&self.samples[last_unloaded + 1..]).map(point).collect()
    }
}

/// Slope of the least-squares line through `(strain, stress)` between two strains, in pascal. `None` with
/// fewer than three points, or with all points at one strain.
pub fn modulus_pa(points: impl Iterator<Item = (f64, f64)>, from: f64, to: f64) -> Option<f64> {
    let inside: Vec<(f64, f64)> = points.filter(|(strain, _)| (from..=to).contains(strain)).collect();
    let n = inside.len() as f64;
    let (x, y) = inside.iter().fold((0.0, 0.0), |(x, y), (strain, stress)| (x + strain / n, y + stress / n));
    let sum = |of: &dyn Fn(f64, f64) -> f64| inside.iter().map(|(a, b)| of(a - x, b - y)).sum::<f64>();
    let spread = sum(&|a, _| a * a);
    (inside.len() >= 3 && spread > 0.0).then(|| sum(&|a, b| a * b) / spread)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A linear spring of 5 kPa between plates that adhere with 20 Pa, under a contact compliance of half its own.
    fn spring(height_m: f64) -> CompressionSample {
        let stress_pa = 5000.0 * (1.0 - height_m / 0.04) / 1.5 - 20.0;
        CompressionSample { stress_pa, height_m, gauge_m: 0.03 * (1.0 - stress_pa / 5000.0) }
    }

    fn pressed(from_m: f64, step_m: f64, count: usize) -> Compression {
        let mut compression = Compression::default();
        (0..count).for_each(|k| compression.record(spring(from_m - step_m * k as f64)));
        compression
    }

    #[test]
    fn strain_counts_from_the_first_contact_force() {
        let compression = pressed(0.041, 7e-5, 60);
        // Zero stress at 0.04 (1 − 1.5 · 20/5000).
        let start = 0.04 * (1.0 - 0.006);
        let curve = compression.curve();
        assert!(curve[0].stress_pa.abs() < 1e-9 && curve[0].strain == 0.0 && curve[0].gauge_strain == 0.0);
        let last = curve.last().unwrap();
        assert!((last.strain - (1.0 - (0.041 - 59.0 * 7e-5) / start)).abs() < 1e-12, "{last:?}");
        assert_eq!(compression.strain(), Some(last.strain));
        assert!((last.gauge_strain - last.stress_pa / 5000.0).abs() < 1e-12);
    }

    #[test]
    fn modulus_of_a_linear_spring_is_exact() {
        let curve = pressed(0.041, 7e-5, 60).curve();
        let by = |strain: fn(&StressStrain) -> f64| {
            modulus_pa(curve.iter().map(|p| (strain(p), p.stress_pa)), 0.0, 0.03).unwrap()
        };
        assert!((by(|p| p.gauge_strain) - 5000.0).abs() < 1e-6);
        // By the plates, relative to the height at first contact.
        assert!((by(|p| p.strain) - 5000.0 / 1.5 * 0.994).abs() < 1e-6);
    }

    #[test]
    fn modulus_uses_only_points_within_the_strain_window() {
        let bent =
            (0..100).map(|k| f64::from(k) * 1e-3).map(|e| (e, if e <= 0.05 { 100.0 * e } else { 5.0 }));
        let bent: Vec<(f64, f64)> = bent.collect();
        assert!((modulus_pa(bent.iter().copied(), 0.0, 0.05).unwrap() - 100.0).abs() < 1e-9);
        assert!(modulus_pa(bent.iter().copied(), 0.0, 0.09).unwrap() < 100.0);
        assert!(modulus_pa(bent.iter().copied(), 0.06, 0.09).unwrap().abs() < 1e-9);
        assert_eq!(modulus_pa(bent.iter().copied(), 0.0, 0.001), None, "two points are no fit");
        assert_eq!(modulus_pa([(0.01, 1.0); 5].into_iter(), 0.0, 1.0), None);
    }

    #[test]
    fn failure_after_the_maximum_stress_leaves_the_curve_unchanged() {
        let mut compression = pressed(0.041, 7e-5, 60);
        let before = compression.curve();
        compression.record(CompressionSample { stress_pa: -3.0, ..spring(0.036) });
        compression.record(CompressionSample { stress_pa: 4.0, ..spring(0.036) });
        assert_eq!(compression.curve()[..before.len()], before[..]);
    }

    #[test]
    fn block_that_was_never_compressed_has_no_curve() {
        let mut compression = Compression::default();
        assert!(compression.curve().is_empty() && compression.strain().is_none());
        compression.record(spring(0.05));
        assert!(compression.curve().is_empty() && compression.strain().is_none());
    }
}

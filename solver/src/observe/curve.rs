//! A discharge curve: mass past the gate over belt time, linear between samples.

/// Window of the mass rate and of the search for stoppages, in seconds. It resolves the opening spill of 0.3
/// s and averages over single sub-particles.
pub const RATE_WINDOW_S: f64 = 0.25;

/// Step between running means, in seconds, independent of the output interval.
const STEP_S: f64 = 0.01;

/// Running mean of the mass rate at every sample, in kg/s, over [`RATE_WINDOW_S`] centred on the sample. The
/// window is cut off at both ends of the curve.
pub fn mass_rate(t_s: &[f64], mass_kg: &[f64]) -> Vec<f64> {
    rates(t_s, mass_kg, 0).collect()
}

/// The mass rates from sample `from` on that later samples no longer change: the window lies within the curve.
pub fn known_mass_rates<'a>(
    t_s: &'a [f64],
    mass_kg: &'a [f64],
    from: usize,
) -> impl Iterator<Item = f64> + 'a {
    let end = t_s.last().copied().unwrap_or(0.0);
    let known = t_s[from..].iter().take_while(move |t| *t + RATE_WINDOW_S / 2.0 <= end).count();
    rates(t_s, mass_kg, from).take(known)
}

/// The mass rates from sample `from` on.
fn rates<'a>(t_s: &'a [f64], mass_kg: &'a [f64], from: usize) -> impl Iterator<Item = f64> + 'a {
    let curve = Curve::new(t_s, mass_kg);
    let half = RATE_WINDOW_S / 2.0;
    t_s[from..].iter().map(move |t| curve.mean_rate(curve.start().max(t - half), curve.end().min(t + half)))
}

/// A non-decreasing curve over increasing times.
#[derive(Clone, Copy)]
pub(super) struct Curve<'a> {
    t_s: &'a [f64],
    mass_kg: &'a [f64],
}

impl<'a> Curve<'a> {
    /// # Panics
    /// When the numbers of masses and times differ.
    pub(super) fn new(t_s: &'a [f64], mass_kg: &'a [f64]) -> Self {
        assert_eq!(t_s.len(), mass_kg.len(), "as many masses as times");
        Self { t_s, mass_kg }
    }

    /// Time of the first sample; 0 without any.
    pub(super) fn start(&self) -> f64 {
        self.t_s.first().copied().unwrap_or(0.0)
    }

    /// Time of the last sample; 0 without any.
    pub(super) fn end(&self) -> f64 {
        self.t_s.last().copied().unwrap_or(0.0)
    }

    /// Mass at the last sample; 0 without any.
    pub(super) fn final_mass(&self) -> f64 {
        self.mass_kg.last().copied().unwrap_or(0.0)
    }

    /// Mass at a time, constant before the first and after the last sample.
    pub(super) fn at(&self, t: f64) -> f64 {
        match self.t_s.partition_point(|sample| *sample < t) {
            0 => self.mass_kg.first().copied().unwrap_or(0.0),
            after if after == self.t_s.len() => self.final_mass(),
            after => interpolate(t, &self.t_s[after - 1..=after], &self.mass_kg[after - 1..=after]),
        }
    }

    /// Time at which the mass first reached `mass`, if it did.
    pub(super) fn time_of(&self, mass: f64) -> Option<f64> {
        match self.mass_kg.partition_point(|sample| *sample < mass) {
            after if after == self.t_s.len() => None,
            0 => Some(self.start()),
            after => Some(interpolate(mass, &self.mass_kg[after - 1..=after], &self.t_s[after - 1..=after])),
        }
    }

    /// Mean rate between two times; 0 for an empty interval.
    pub(super) fn mean_rate(&self, from: f64, to: f64) -> f64 {
        if to > from { (self.at(to) - self.at(from)) / (to - from) } else { 0.0 }
    }

    /// Mean rates over a window that slides from `from` to `to` in steps of [`STEP_S`]: start of each window,
    /// and its rate. Empty when the window does not fit.
    pub(super) fn running_mean(&self, from: f64, to: f64, window: f64) -> Vec<(f64, f64)> {
        steps(from, to - window).map(|t| (t, self.mean_rate(t, t + window))).collect()
    }

    /// R² of the least-squares line between two times; `None` for a flat curve or an empty interval.
    pub(super) fn linearity(&self, from: f64, to: f64) -> Option<f64> {
        let points = steps(from, to).map(|t| (t, self.at(t))).collect::<Vec<_>>();
        let count = points.len() as f64;
        let mean_t = points.iter().map(|point| point.0).sum::<f64>() / count;
        let mean_m = points.iter().map(|point| point.1).sum::<f64>() / count;
        let (mut tt, mut tm, mut mm) = (0.0, 0.0, 0.0);
        for (t, m) in points {
            tt += (t - mean_t) * (t - mean_t);
            tm += (t - mean_t) * (m - mean_m);
            mm += (m - mean_m) * (m - mean_m);
        }
        (tt > 0.0 && mm > 0.0).then(|| tm * tm / (tt * mm))
    }
}

/// `y` at `x` on the line through two points.
fn interpolate(x: f64, xs: &[f64], ys: &[f64]) -> f64 {
    ys[0] + (ys[1] - ys[0]) * ((x - xs[0]) / (xs[1] - xs[0]))
}

/// Times from `from` to `to`, [`STEP_S`] apart, `to` itself always the last.
fn steps(from: f64, to: f64) -> impl Iterator<Item = f64> {
    // A rounding error must not exclude a window that just fits.
    let length = to - from + 1e-9;
    let count = if length < 0.0 { 0 } else { (length / STEP_S).ceil() as usize + 1 };
    (0..count).map(move |index| (from + index as f64 * STEP_S).min(to))
}

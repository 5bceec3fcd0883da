//! A discharge curve: mass that has passed the gate over belt time, read as straight between its samples.

/// The window of the rate as a series, and of the search for stoppages, in seconds: short enough to show
/// the opening spill of 0.3 s, long enough that single sub-particles do not.
pub const RATE_WINDOW_S: f64 = 0.25;

/// The step at which running means are looked at, in seconds, whatever the output interval.
const STEP_S: f64 = 0.01;

/// The running mean of the mass rate at every sample, in kg/s: over [`RATE_WINDOW_S`] centred on the sample,
/// cut off where the curve begins and ends.
pub fn mass_rate(t_s: &[f64], mass_kg: &[f64]) -> Vec<f64> {
    let curve = Curve::new(t_s, mass_kg);
    let half = RATE_WINDOW_S / 2.0;
    t_s.iter().map(|t| curve.mean_rate(curve.start().max(t - half), curve.end().min(t + half))).collect()
}

/// A curve that never falls, over times that rise.
#[derive(Clone, Copy)]
pub(super) struct Curve<'a> {
    t_s: &'a [f64],
    mass_kg: &'a [f64],
}

impl<'a> Curve<'a> {
    /// # Panics
    /// When there are not as many masses as times.
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

    /// Mass at a time; before the first and after the last sample, theirs.
    pub(super) fn at(&self, t: f64) -> f64 {
        match self.t_s.partition_point(|sample| *sample < t) {
            0 => self.mass_kg.first().copied().unwrap_or(0.0),
            after if after == self.t_s.len() => self.final_mass(),
            after => interpolate(t, &self.t_s[after - 1..=after], &self.mass_kg[after - 1..=after]),
        }
    }

    /// When the mass first came to `mass`, if it did.
    pub(super) fn time_of(&self, mass: f64) -> Option<f64> {
        match self.mass_kg.partition_point(|sample| *sample < mass) {
            after if after == self.t_s.len() => None,
            0 => Some(self.start()),
            after => Some(interpolate(mass, &self.mass_kg[after - 1..=after], &self.t_s[after - 1..=after])),
        }
    }

    /// Mean rate between two times; 0 when there is no time between them.
    pub(super) fn mean_rate(&self, from: f64, to: f64) -> f64 {
        if to > from { (self.at(to) - self.at(from)) / (to - from) } else { 0.0 }
    }

    /// The mean rates over a window that slides from `from` to `to` in steps of [`STEP_S`], lying wholly
    /// between them: the time at which each window begins, and its rate. Empty when the window does not fit.
    pub(super) fn running_mean(&self, from: f64, to: f64, window: f64) -> Vec<(f64, f64)> {
        steps(from, to - window).map(|t| (t, self.mean_rate(t, t + window))).collect()
    }

    /// R² of the straight line that fits the curve best between two times; none where the curve is flat or
    /// there is no time.
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
    // A rounding error of the window's arithmetic shall not cost the one window that just fits.
    let length = to - from + 1e-9;
    let count = if length < 0.0 { 0 } else { (length / STEP_S).ceil() as usize + 1 };
    (0..count).map(move |index| (from + index as f64 * STEP_S).min(to))
}

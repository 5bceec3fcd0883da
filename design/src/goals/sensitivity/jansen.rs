//! Sobol' indices by Jansen's estimators.
//!
//! | symbol | meaning |
//! |---|---|
//! | yₐ, y_b, yᵢ | response at a, b and a⁽ⁱ⁾ of a row; ⟨ ⟩ the mean over rows |
//! | σ² | variance of single runs at one point, ⟨(yₐ − yₐ′)²⟩/2 from a second replicate at a |
//! | V | variance over the ranges: ⟨(yₐ² + y_b²)/2⟩ − ⟨(yₐ + y_b)/2⟩² − σ² |
//! | Sᵢ | first-order index: 1 − (⟨(y_b − yᵢ)²⟩/2 − σ²)/V |
//! | Tᵢ | total index: (⟨(yₐ − yᵢ)²⟩/2 − σ²)/V |
//!
//! Source: Jansen 1999, Computer Physics Communications 117, 35; Saltelli et al. 2010. Both squared differences contain the
//! noise of two runs, 2σ² in the mean over the ranges, and V contains it once. Without the correction a factor without any
//! effect has T = σ²/(V + σ²).

/// The responses of a row that has both yₐ and y_b.
#[derive(Clone, Debug)]
pub(super) struct Row {
    a: f64,
    b: f64,
    mixed: Vec<Option<f64>>,
    /// The second replicate at a.
    again: Option<f64>,
}

impl Row {
    /// From the values of a row's runs: at a, b, each a⁽ⁱ⁾, then perhaps at a again. None without yₐ or y_b.
    pub(super) fn of(values: &[Option<f64>], factors: usize) -> Option<Self> {
        let again = values.get(factors + 2).copied().flatten();
        Some(Self { a: values[0]?, b: values[1]?, mixed: values[2..factors + 2].to_vec(), again })
    }

    /// The same without the second replicate.
    #[cfg(test)]
    pub(super) fn without_noise(self) -> Self {
        Self { again: None, ..self }
    }
}

/// The terms whose means over rows give the indices.
#[derive(Debug)]
pub(super) struct Terms {
    /// (yₐ + y_b)/2 per row, after subtraction of the mean of all.
    pub(super) level: Vec<f64>,
    /// (yₐ² + y_b²)/2 per row.
    pub(super) square: Vec<f64>,
    /// (yₐ − yₐ′)²/2 per row.
    pub(super) noise: Vec<Option<f64>>,
    /// (y_b − yᵢ)²/2 per row for every factor, then (yₐ − yᵢ)²/2.
    pub(super) halves: Vec<Vec<Option<f64>>>,
}

impl Terms {
    pub(super) fn of(rows: &[Row]) -> Self {
        let factors = rows.first().map_or(0, |row| row.mixed.len());
        // Centred, because V is a difference of squares.
        let centre = rows.iter().map(|row| 0.5 * (row.a + row.b)).sum::<f64>() / rows.len().max(1) as f64;
        let half = |one: f64, other: Option<f64>| other.map(|other| 0.5 * (one - other).powi(2));
        let first =
            (0..factors).map(|factor| rows.iter().map(|row| half(row.b, row.mixed[factor])).collect());
        let total =
            (0..factors).map(|factor| rows.iter().map(|row| half(row.a, row.mixed[factor])).collect());
        Self {
            level: rows.iter().map(|row| 0.5 * (row.a + row.b) - centre).collect(),
            square: rows
                .iter()
                .map(|row| 0.5 * ((row.a - centre).powi(2) + (row.b - centre).powi(2)))
                .collect(),
            noise: rows.iter().map(|row| half(row.a, row.again)).collect(),
            halves: first.chain(total).collect(),
        }
    }

    /// Number of rows.
    pub(super) fn rows(&self) -> usize {
        self.level.len()
    }

    /// Number of pairs of an index: first-order indices of all factors, then total ones.
    pub(super) fn pairs(&self, index: usize) -> usize {
        self.halves[index].iter().flatten().count()
    }

    /// σ²; none without second replicates. `weights` as for [`Terms::indices`].
    pub(super) fn noise_variance(&self, weights: Option<&[f64]>) -> Option<f64> {
        mean_of_known(&self.noise, weights)
    }

    /// V.
    pub(super) fn variance(&self, weights: Option<&[f64]>) -> f64 {
        let noise = self.noise_variance(weights).unwrap_or(0.0);
        mean(&self.square, weights) - mean(&self.level, weights).powi(2) - noise
    }

    /// First-order indices of all factors, then total ones; none when V is not positive or an index has no pair.
    /// Each row counts as often as `weights` say, or once.
    pub(super) fn indices(&self, weights: Option<&[f64]>) -> Option<Vec<f64>> {
        let variance = self.variance(weights);
        let noise = self.noise_variance(weights).unwrap_or(0.0);
        // Rounding errors of equal responses are no variance.
        let is_varied = self.rows() > 1 && variance > 1e-12 * mean(&self.square, weights);
        let of_index = |(index, halves): (usize, &Vec<Option<f64>>)| {
            let share = (mean_of_known(halves, weights)? - noise) / variance;
            Some(if index < self.halves.len() / 2 { 1.0 - share } else { share })
        };
        is_varied.then(|| self.halves.iter().enumerate().map(of_index).collect())?
    }
}

/// The weighted mean.
fn mean(terms: &[f64], weights: Option<&[f64]>) -> f64 {
    match weights {
        None => terms.iter().sum::<f64>() / terms.len() as f64,
        Some(weights) => {
            let sum: f64 = terms.iter().zip(weights).map(|(term, weight)| term * weight).sum();
            sum / weights.iter().sum::<f64>()
        }
    }
}

/// The weighted mean of terms that are known; none if no such term has weight.
fn mean_of_known(terms: &[Option<f64>], weights: Option<&[f64]>) -> Option<f64> {
    let (mut sum, mut count) = (0.0, 0.0);
    for (row, term) in terms.iter().enumerate() {
        let (Some(term), weight) = (term, weights.map_or(1.0, |weights| weights[row])) else { continue };
        sum += weight * term;
        count += weight;
    }
    (count > 0.0).then(|| sum / count)
}

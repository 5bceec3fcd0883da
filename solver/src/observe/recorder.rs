//! The samples of a run, in memory: series to which samples are only ever appended.
//!
//! Simulated time runs from the beginning of the run. Belt time runs from t = 0, whose simulated time is known once the
//! process has started. No recorded sample changes afterwards, so an observer needs only the samples since its last look.

use serde::{Deserialize, Serialize};

use crate::result::Series;

/// The clock of a series in the result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Clock {
    /// Sampled from the beginning of the run on. Belt time is simulated time less the simulated time of t = 0.
    Simulated,
    /// Sampled from t = 0 on, with the belt time of the sample.
    Belt,
}

/// A series of a [`Recorder`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SeriesId(usize);

/// One series.
#[derive(Clone, Debug)]
pub struct RecordedSeries {
    name: String,
    unit: String,
    clock: Clock,
    simulated_s: Vec<f64>,
    /// Belt times, for [`Clock::Belt`] alone.
    belt_s: Vec<f64>,
    values: Vec<f64>,
}

impl RecordedSeries {
    /// Name, such as `discharged_mass`.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Unit, such as `kg`.
    pub fn unit(&self) -> &str {
        &self.unit
    }

    /// Simulated times of the samples, in seconds, ascending.
    pub fn simulated_s(&self) -> &[f64] {
        &self.simulated_s
    }

    /// The samples, as many as times.
    pub fn values(&self) -> &[f64] {
        &self.values
    }
}

/// The samples of a recorder, as checkpoints hold them.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SavedSamples {
    t0_s: Option<f64>,
    simulated_s: f64,
    belt_s: f64,
    /// Simulated times, belt times and values of each series.
    recordings: Vec<[Vec<f64>; 3]>,
}

/// All series of a run.
#[derive(Clone, Debug, Default)]
pub struct Recorder {
    t0_s: Option<f64>,
    simulated_s: f64,
    belt_s: f64,
    recordings: Vec<RecordedSeries>,
}

impl Recorder {
    /// The samples, without names and units.
    pub fn save(&self) -> SavedSamples {
        let samples = |recording: &RecordedSeries| {
            let RecordedSeries { simulated_s, belt_s, values, .. } = recording;
            [simulated_s.clone(), belt_s.clone(), values.clone()]
        };
        SavedSamples {
            t0_s: self.t0_s,
            simulated_s: self.simulated_s,
            belt_s: self.belt_s,
            recordings: self.recordings.iter().map(samples).collect(),
        }
    }

    /// Takes over the samples of a recorder with the same series. Returns whether they are such.
    #[must_use]
    pub fn restore(&mut self, saved: SavedSamples) -> bool {
        let fits = |(recording, [simulated_s, belt_s, values]): (&RecordedSeries, &[Vec<f64>; 3])| {
            let belt_count = if recording.clock == Clock::Belt { values.len() } else { 0 };
            simulated_s.len() == values.len() && belt_s.len() == belt_count
        };
        if saved.recordings.len() != self.recordings.len()
            || !self.recordings.iter().zip(&saved.recordings).all(fits)
        {
            return false;
        }
        (self.t0_s, self.simulated_s, self.belt_s) = (saved.t0_s, saved.simulated_s, saved.belt_s);
        for (recording, samples) in self.recordings.iter_mut().zip(saved.recordings) {
            [recording.simulated_s, recording.belt_s, recording.values] = samples;
        }
        true
    }

    /// Adds a series without samples. Results list series in this order.
    pub fn add(&mut self, name: impl Into<String>, unit: &str, clock: Clock) -> SeriesId {
        self.recordings.push(RecordedSeries {
            name: name.into(),
            unit: unit.to_owned(),
            clock,
            simulated_s: Vec::new(),
            belt_s: Vec::new(),
            values: Vec::new(),
        });
        SeriesId(self.recordings.len() - 1)
    }

    /// Sets the moment of the samples that follow. The first belt time fixes [`Self::t0_s`].
    pub fn begin_sample(&mut self, simulated_s: f64, belt_time_s: Option<f64>) {
        self.simulated_s = simulated_s;
        if let Some(belt_s) = belt_time_s {
            self.belt_s = belt_s;
            self.t0_s.get_or_insert(simulated_s - belt_s);
        }
    }

    /// Appends a sample at the current moment. The moment of the start comes twice; [`Clock::Simulated`] takes its
    /// first sample.
    pub fn record(&mut self, id: SeriesId, value: f64) {
        let recording = &mut self.recordings[id.0];
        match recording.clock {
            Clock::Simulated if recording.simulated_s.last() == Some(&self.simulated_s) => return,
            Clock::Simulated => {}
            Clock::Belt => recording.belt_s.push(self.belt_s),
        }
        recording.simulated_s.push(self.simulated_s);
        recording.values.push(value);
    }

    /// Appends values derived from another series, at the times of its samples that come next.
    pub fn record_derived(&mut self, id: SeriesId, source: SeriesId, values: impl IntoIterator<Item = f64>) {
        for value in values {
            let next = self.recordings[id.0].values.len();
            let from = &self.recordings[source.0];
            let (simulated_s, belt_s) = (from.simulated_s[next], from.belt_s.get(next).copied());
            let recording = &mut self.recordings[id.0];
            recording.simulated_s.push(simulated_s);
            recording.belt_s.extend(belt_s);
            recording.values.push(value);
        }
    }

    /// Simulated time of t = 0, in seconds, once known.
    pub fn t0_s(&self) -> Option<f64> {
        self.t0_s
    }

    /// All series, in their order.
    pub fn recordings(&self) -> &[RecordedSeries] {
        &self.recordings
    }

    /// The samples of a series.
    pub fn values(&self, id: SeriesId) -> &[f64] {
        &self.recordings[id.0].values
    }

    /// The last sample of a series.
    pub fn last(&self, id: SeriesId) -> Option<f64> {
        self.values(id).last().copied()
    }

    /// Belt times of a series with [`Clock::Belt`], in seconds.
    pub fn belt_s(&self, id: SeriesId) -> &[f64] {
        &self.recordings[id.0].belt_s
    }

    /// All series over belt time. While t = 0 is unknown, times end at 0.
    pub fn series(&self) -> Vec<Series> {
        let t0_s = self.t0_s.unwrap_or(self.simulated_s);
        let series = |recording: &RecordedSeries| Series {
            name: recording.name.clone(),
            unit: recording.unit.clone(),
            t_s: match recording.clock {
                Clock::Simulated => recording.simulated_s.iter().map(|t| t - t0_s).collect(),
                Clock::Belt => recording.belt_s.clone(),
            },
            values: recording.values.clone(),
        };
        self.recordings.iter().map(series).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_appended_and_get_belt_time_once_the_process_starts() {
        let mut recorder = Recorder::default();
        let energy = recorder.add("energy", "J", Clock::Simulated);
        let mass = recorder.add("mass", "kg", Clock::Belt);
        for (simulated_s, value) in [(0.0, 3.0), (0.5, 2.0)] {
            recorder.begin_sample(simulated_s, None);
            recorder.record(energy, value);
        }
        assert_eq!((recorder.t0_s(), recorder.series()[0].t_s.as_slice()), (None, &[-0.5, 0.0][..]));
        recorder.begin_sample(0.5, Some(0.0));
        recorder.record(energy, 9.0);
        recorder.record(mass, 0.0);
        recorder.begin_sample(0.75, Some(0.25));
        recorder.record(energy, 1.0);
        recorder.record(mass, 4.0);
        assert_eq!(recorder.t0_s(), Some(0.5));
        assert_eq!(recorder.values(energy), [3.0, 2.0, 1.0], "the moment of the start counts once");
        assert_eq!(recorder.recordings()[1].simulated_s(), [0.5, 0.75]);
        let series = recorder.series();
        assert_eq!((&series[0].t_s[..], &series[1].t_s[..]), (&[-0.5, 0.0, 0.25][..], &[0.0, 0.25][..]));
    }

    #[test]
    fn derived_samples_have_the_times_of_their_source() {
        let mut recorder = Recorder::default();
        let mass = recorder.add("mass", "kg", Clock::Belt);
        let rate = recorder.add("rate", "kg/s", Clock::Belt);
        for k in 0..3 {
            recorder.begin_sample(1.0 + f64::from(k), Some(f64::from(k)));
            recorder.record(mass, f64::from(k));
        }
        recorder.record_derived(rate, mass, [7.0]);
        recorder.record_derived(rate, mass, [8.0]);
        assert_eq!((recorder.belt_s(rate), recorder.values(rate)), (&[0.0, 1.0][..], &[7.0, 8.0][..]));
    }
}

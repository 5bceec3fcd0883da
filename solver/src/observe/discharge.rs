//! The responses of a hopper: discharged mass, rate and steadiness.
//!
//! *Out* means past the gate plane, as a share of the filled mass. Rates and regime use the curve *until 80 %
//! is out* (or the run ends): the last fifth trickles out in any hopper.

use serde::Serialize;
use serde_json::{Map, Value};

use super::curve::Curve;
use super::jam::{Jam, Passages};
use super::regime::{self, Flow, Regime, SPILL_S, WINDOW_S};
use crate::result::EndReason;

/// Belt time of the paper's evaluation, in seconds; also the minimum for a regime.
const EVALUATION_TIME_S: f64 = 4.0;

/// Share out up to which rates are evaluated.
const FLOW_SHARE: f64 = 0.8;

/// Share out at which a hopper counts as emptied: the last fillets straddle the gate.
const EMPTIED_SHARE: f64 = 0.95;

/// Minimum duration of a mean rate, in seconds.
const MIN_MEAN_S: f64 = 0.1;

/// Largest `rate_variation` of a steady discharge.
const MAX_STEADY_VARIATION: f64 = 0.2;

/// A sampled discharge with its reference values.
#[derive(Clone, Copy, Debug)]
pub struct Discharge<'a> {
    /// Belt times of the samples, increasing, from 0 (belt start) on, in seconds.
    pub t_s: &'a [f64],
    /// Mass that has passed the gate at those times, in kilograms.
    pub mass_kg: &'a [f64],
    /// Mass in the hopper at those times, in kilograms.
    pub inside_kg: &'a [f64],
    /// Time without a passage that makes a jam, in seconds.
    pub jam_after_s: f64,
    /// Reason of the end: an empty hopper stays empty, a jammed one is final.
    pub end_reason: EndReason,
    /// Mass of all fillets in the hopper at belt start, in kilograms.
    pub filled_kg: f64,
    /// Hopper area times the 95th percentile of the bed's surface height at rest, in m³.
    pub bed_volume_m3: f64,
    /// Volume per second that the belt carries through the full opening: its speed times the opening's width and height, in
    /// m³/s. `None` when speed or opening are unknown.
    pub full_opening_m3_s: Option<f64>,
    /// Maximum height above the belt of the fillets left in the hopper at the end, in metres; `None` when it
    /// is empty.
    pub greatest_height_m: Option<f64>,
}

/// The responses of a discharge. `None` means "not reached" or "not enough data".
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DischargeResponses {
    /// Mass in the hopper at belt start.
    pub filled_kg: f64,
    /// Mass out at the end.
    pub discharged_kg: f64,
    /// Mass out at 4 s; a hopper that is empty sooner keeps its last value.
    pub discharged_kg_at_4s: Option<f64>,
    /// When 95 % of the filled mass was out.
    pub time_to_95_percent_s: Option<f64>,
    /// When 99 % of the filled mass was out.
    pub time_to_99_percent_s: Option<f64>,
    /// 95 % of the filled mass over the time until it was out; none when it was not.
    pub effective_throughput_kg_s: Option<f64>,
    /// Mean rate from 0.5 s until 80 % is out; none when that is under 0.1 s.
    pub mean_rate_kg_s: Option<f64>,
    /// Highest running 1 s mean of the rate, opening spill included.
    pub peak_rate_kg_s: Option<f64>,
    /// Coefficient of variation of the running 1 s mean of the rate, windows from 0.5 s until 80 % is out;
    /// none when those are under 1.5 s apart.
    pub rate_variation: Option<f64>,
    /// Whether `rate_variation` is under 0.2: a low rate may be slow but steady.
    pub steady: Option<bool>,
    /// Longest stretch with the rate, over 0.25 s, under 0.15 of the belt's capacity, until 80 % is out.
    pub longest_stoppage_s: Option<f64>,
    /// Regime; `None` without a belt capacity: unknown, or 0 when the belt stands still or the bed has no volume.
    pub regime: Option<Regime>,
    /// 1 if the hopper jammed, else 0; none when that is not known.
    pub jammed: Option<u8>,
    /// When the last mass passed before the jam; none without a jam.
    pub time_to_jam_s: Option<f64>,
    /// Q_b: mass rate that the belt carries away with a full opening.
    pub belt_capacity_kg_s: Option<f64>,
    /// q, the lowest running 1 s mean of the rate over Q_b, from 0.5 s until 80 % is out.
    pub lowest_rate_ratio: Option<f64>,
    /// R² of a straight line through the curve from 0 to `linearity_until_s`.
    pub linearity_r2: Option<f64>,
    /// 4 s, or when 80 % was out or the run ended, if that was sooner.
    pub linearity_until_s: f64,
    /// Filled mass over bed volume at rest; none when the bed has no volume.
    pub bulk_density_kg_m3: Option<f64>,
    /// Maximum height of the remaining fillets. Fillets that hang on a wall resemble a jam.
    pub greatest_height_m: Option<f64>,
}

impl DischargeResponses {
    /// The responses by name, for [`crate::result::RunResult::responses`].
    pub fn into_map(self) -> Map<String, Value> {
        match serde_json::to_value(self) {
            Ok(Value::Object(map)) => map,
            other => unreachable!("a struct of scalars serialises to an object, not {other:?}"),
        }
    }
}

impl Discharge<'_> {
    /// Evaluates the responses.
    ///
    /// # Panics
    /// When the numbers of masses and times differ.
    pub fn responses(&self) -> DischargeResponses {
        let curve = Curve::new(self.t_s, self.mass_kg);
        let out = |share: f64| self.time_of(&curve, share);
        let until = self.flowing_until_s();
        let bulk_density = (self.bed_volume_m3 > 0.0).then(|| self.filled_kg / self.bed_volume_m3);
        let belt_capacity = self.full_opening_m3_s.map(|volume| bulk_density.unwrap_or(0.0) * volume);
        let capacity = belt_capacity.filter(|capacity| *capacity > 0.0);
        let lowest_rate = (until > 0.0).then(|| regime::lowest_rate(&curve, until));
        let rate_variation = regime::variation(&curve, until);
        let linearity_until = until.min(EVALUATION_TIME_S);
        let &Self { t_s, mass_kg, inside_kg, filled_kg, .. } = self;
        let jam = Passages { t_s, mass_kg, inside_kg, filled_kg }.jam(self.jam_after_s);
        DischargeResponses {
            filled_kg: self.filled_kg,
            discharged_kg: curve.final_mass(),
            discharged_kg_at_4s: self
                .known_at(&curve, EVALUATION_TIME_S)
                .then(|| curve.at(EVALUATION_TIME_S)),
            time_to_95_percent_s: out(EMPTIED_SHARE),
            time_to_99_percent_s: out(0.99),
            effective_throughput_kg_s: out(EMPTIED_SHARE)
                .filter(|t| *t > 0.0)
                .map(|t| EMPTIED_SHARE * self.filled_kg / t),
            mean_rate_kg_s: (until - SPILL_S >= MIN_MEAN_S).then(|| curve.mean_rate(SPILL_S, until)),
            peak_rate_kg_s: self.peak_rate(&curve),
            rate_variation,
            steady: rate_variation.map(|variation| variation < MAX_STEADY_VARIATION),
            longest_stoppage_s: capacity
                .and_then(|capacity| regime::longest_stoppage(&curve, until, capacity)),
            regime: capacity.map(|capacity_kg_s| match lowest_rate {
                Some(lowest_rate_kg_s) if self.judged(&curve, out(FLOW_SHARE).is_some()) => {
                    Regime::of(Flow {
                        lowest_rate_kg_s,
                        capacity_kg_s,
                        filled_kg: self.filled_kg,
                        emptied: self.end_reason == EndReason::Empty || out(EMPTIED_SHARE).is_some(),
                    })
                }
                _ => Regime::TooShort,
            }),
            jammed: match jam {
                Jam::At(_) => Some(1),
                Jam::Never => Some(0),
                Jam::Unknown => None,
            },
            time_to_jam_s: if let Jam::At(time_s) = jam { Some(time_s) } else { None },
            belt_capacity_kg_s: belt_capacity,
            lowest_rate_ratio: lowest_rate.zip(capacity).map(|(rate, capacity)| rate / capacity),
            linearity_r2: curve.linearity(0.0, linearity_until),
            linearity_until_s: linearity_until,
            bulk_density_kg_m3: bulk_density,
            greatest_height_m: self.greatest_height_m,
        }
    }

    /// End of the rate evaluation, in seconds: 80 % out, or the end of the curve.
    ///
    /// # Panics
    /// When the numbers of masses and times differ.
    pub fn flowing_until_s(&self) -> f64 {
        let curve = Curve::new(self.t_s, self.mass_kg);
        self.time_of(&curve, FLOW_SHARE).unwrap_or(curve.end())
    }

    /// Time at which a share of the filled mass was out, if it was.
    fn time_of(&self, curve: &Curve<'_>, share: f64) -> Option<f64> {
        curve.time_of(share * self.filled_kg).filter(|_| self.filled_kg > 0.0)
    }

    /// Whether the mass out at a time is known: sampled, or the hopper was empty or had jammed before.
    fn known_at(&self, curve: &Curve<'_>, t: f64) -> bool {
        let is_over = matches!(self.end_reason, EndReason::Empty | EndReason::Jammed);
        reached(curve, t) || is_over && !self.t_s.is_empty()
    }

    fn peak_rate(&self, curve: &Curve<'_>) -> Option<f64> {
        let end = if self.known_at(curve, WINDOW_S) { curve.end().max(WINDOW_S) } else { curve.end() };
        curve.running_mean(0.0, end, WINDOW_S).iter().map(|rate| rate.1).reduce(f64::max)
    }

    /// Whether the run is long enough for a regime: 80 % out, an empty or jammed hopper, or 4 s of belt time.
    fn judged(&self, curve: &Curve<'_>, flowed_out: bool) -> bool {
        let ended = matches!(self.end_reason, EndReason::Empty | EndReason::Jammed);
        flowed_out || ended || reached(curve, EVALUATION_TIME_S)
    }
}

/// Samples are taken at the nearest step, and so less than this early, in seconds.
const EARLY_S: f64 = 1e-3;

/// Whether the curve extends to `t`.
fn reached(curve: &Curve<'_>, t: f64) -> bool {
    curve.end() >= t - EARLY_S
}

//! Curves drawn by hand, with answers known in advance.

use super::{Discharge, DischargeResponses, RATE_WINDOW_S, Regime, known_mass_rates, mass_rate};
use crate::result::EndReason;

/// Filled mass of every test, in kilograms; the capacity of its belt is 10 kg/s.
const FILLED: f64 = 40.0;

/// Samples of a curve every 20 ms up to `end`.
struct Sampled {
    t_s: Vec<f64>,
    mass_kg: Vec<f64>,
    inside_kg: Vec<f64>,
    end_reason: EndReason,
}

fn sample(end: f64, curve: impl Fn(f64) -> f64) -> Sampled {
    sample_every(0.02, end, curve)
}

fn sample_every(interval: f64, end: f64, curve: impl Fn(f64) -> f64) -> Sampled {
    let t_s =
        (0..=(end / interval).round() as usize).map(|index| index as f64 * interval).collect::<Vec<_>>();
    let mass_kg: Vec<f64> = t_s.iter().map(|t| curve(*t)).collect();
    let inside_kg = mass_kg.iter().map(|mass| FILLED - mass).collect();
    Sampled { t_s, mass_kg, inside_kg, end_reason: EndReason::Duration }
}

impl Sampled {
    fn ended(self, end_reason: EndReason) -> Self {
        Self { end_reason, ..self }
    }

    fn discharge(&self) -> Discharge<'_> {
        Discharge {
            t_s: &self.t_s,
            mass_kg: &self.mass_kg,
            inside_kg: &self.inside_kg,
            jam_after_s: 1.0,
            end_reason: self.end_reason,
            filled_kg: FILLED,
            bed_volume_m3: 0.04,
            full_opening_m3_s: Some(0.25 * 0.5 * 0.08),
            greatest_height_m: Some(0.1),
        }
    }

    fn responses(&self) -> DischargeResponses {
        self.discharge().responses()
    }
}

/// A straight line of `rate` until all is out.
fn line(rate: f64) -> impl Fn(f64) -> f64 {
    move |t| (rate * t).min(FILLED)
}

#[track_caller]
fn close(found: impl Into<Option<f64>>, expected: f64) {
    let found = found.into().expect("a number");
    assert!((found - expected).abs() < 1e-6, "{found} is not {expected}");
}

#[track_caller]
fn near(found: Option<f64>, expected: f64, tolerance: f64) {
    let found = found.expect("a number");
    assert!((found - expected).abs() <= tolerance, "{found} is not {expected} ± {tolerance}");
}

#[test]
fn effective_throughput_is_95_percent_of_the_mass_over_its_discharge_time() {
    let responses = sample(10.0, line(8.0)).responses();
    close(responses.effective_throughput_kg_s, 8.0);
    // Slow at first, and fast at last: the mean counts.
    let late = sample(10.0, |t| if t < 4.0 { 2.0 * t } else { (8.0 + 10.0 * (t - 4.0)).min(FILLED) });
    close(late.responses().effective_throughput_kg_s, 38.0 / 7.0);
    assert_eq!(sample(4.0, line(8.0)).responses().effective_throughput_kg_s, None, "80 % came out");
    assert_eq!(sample(4.0, |_| FILLED).responses().effective_throughput_kg_s, None, "in no time");
}

#[test]
fn constant_flow_has_the_expected_responses() {
    let responses = sample(6.0, line(8.0)).responses();
    close(responses.discharged_kg, 40.0);
    close(responses.discharged_kg_at_4s, 32.0);
    close(responses.time_to_95_percent_s, 4.75);
    close(responses.time_to_99_percent_s, 4.95);
    close(responses.mean_rate_kg_s, 8.0);
    close(responses.peak_rate_kg_s, 8.0);
    close(responses.rate_variation, 0.0);
    assert_eq!(responses.steady, Some(true));
    close(responses.longest_stoppage_s, 0.0);
    assert_eq!(responses.regime, Some(Regime::Constant));
    close(responses.belt_capacity_kg_s, 10.0);
    close(responses.lowest_rate_ratio, 0.8);
    close(responses.linearity_r2, 1.0);
    close(responses.linearity_until_s, 4.0);
    close(responses.bulk_density_kg_m3, 1000.0);
}

#[test]
fn stoppage_of_two_seconds_has_the_expected_responses() {
    // 8 kg/s for 2 s, nothing for 2 s, 8 kg/s again: 80 % (32 kg) is out at 6 s.
    let responses = sample(8.0, |t| line(8.0)(if t < 2.0 { t } else { (t - 2.0).max(2.0) })).responses();
    close(responses.discharged_kg_at_4s, 16.0);
    close(responses.mean_rate_kg_s, (32.0 - 4.0) / 5.5);
    close(responses.lowest_rate_ratio, 0.0);
    assert_eq!(responses.regime, Some(Regime::Inconsistent), "it emptied");
    assert_eq!(responses.steady, Some(false));
    // A window of 0.25 s stays under 1.5 kg/s with 0.047 s of flow in it, on either side.
    near(responses.longest_stoppage_s, 2.0 + 2.0 * RATE_WINDOW_S * 1.5 / 8.0, 0.021);
}

#[test]
fn a_stop_shorter_than_the_running_mean_is_inconsistent() {
    // The worst second holds 0.6 s of nothing and 0.4 s of 8 kg/s.
    let responses = sample(8.0, |t| line(8.0)(if t < 2.0 { t } else { (t - 0.6).max(2.0) })).responses();
    close(responses.lowest_rate_ratio, 0.32);
    assert_eq!(responses.regime, Some(Regime::Inconsistent));
    near(responses.longest_stoppage_s, 0.69, 0.021);
}

#[test]
fn spill_without_later_flow_is_no_flow() {
    // 8 kg/s for 0.4 s: the spill is neither flow nor the measure of flow.
    let responses = sample(6.0, |t| 8.0 * t.min(0.4)).responses();
    close(responses.discharged_kg_at_4s, 3.2);
    assert_eq!(responses.time_to_95_percent_s, None);
    assert_eq!(responses.time_to_99_percent_s, None);
    close(responses.mean_rate_kg_s, 0.0);
    close(responses.peak_rate_kg_s, 3.2);
    assert_eq!(responses.rate_variation, None);
    assert_eq!(responses.steady, None);
    assert_eq!(responses.regime, Some(Regime::NoFlow));
    close(responses.lowest_rate_ratio, 0.0);
    near(responses.longest_stoppage_s, 5.6 + RATE_WINDOW_S * 1.5 / 8.0, 0.011);
    assert!(responses.linearity_r2.unwrap() < 0.5);
}

#[test]
fn initial_spill_is_excluded_from_mean_rate_and_variation() {
    let responses = sample(6.0, |t| 16.0 * t.min(0.3) + 7.0 * (t - 0.3).max(0.0)).responses();
    close(responses.mean_rate_kg_s, 7.0);
    close(responses.rate_variation, 0.0);
    close(responses.lowest_rate_ratio, 0.7);
    close(responses.peak_rate_kg_s, 16.0 * 0.3 + 7.0 * 0.7);
}

#[test]
fn exponential_discharge_matches_its_closed_form() {
    // m = 40 (1 − e^(−t/2)): 80 % out at 2 ln 5, and the slowest second is the last before that.
    let responses = sample(12.0, |t| FILLED * (1.0 - (-t / 2.0).exp())).responses();
    let until = 2.0 * 5f64.ln();
    near(responses.time_to_95_percent_s, 2.0 * 20f64.ln(), 1e-4);
    near(responses.time_to_99_percent_s, 2.0 * 100f64.ln(), 1e-4);
    near(responses.mean_rate_kg_s, (32.0 - FILLED * (1.0 - (-0.25f64).exp())) / (until - 0.5), 1e-3);
    near(responses.peak_rate_kg_s, FILLED * (1.0 - (-0.5f64).exp()), 1e-6);
    near(responses.lowest_rate_ratio, 4.0 * ((-(until - 1.0) / 2.0).exp() - 0.2), 1e-4);
    near(Some(responses.linearity_until_s), until, 1e-4);
    // R² of 1 − e^(−x) on [0, a] from its integrals, a = ln 5.
    let a = 5f64.ln();
    let e = 1.0 / 5.0;
    let mean = (1.0 - e) / a;
    let variance = (1.0 - e * e) / (2.0 * a) - mean * mean;
    let covariance = (1.0 - e * (1.0 + a)) / a - mean * a / 2.0;
    near(responses.linearity_r2, covariance * covariance / (variance * a * a / 12.0), 1e-3);
    // The running mean falls as e^(−t/2) over b = (until − 1.5) / 2: mean and mean square from integrals.
    let b = (until - 1.5) / 2.0;
    let first = (1.0 - (-b).exp()) / b;
    let second = (1.0 - (-2.0 * b).exp()) / (2.0 * b);
    near(responses.rate_variation, (second / (first * first) - 1.0).sqrt(), 2e-3);
}

#[test]
fn variation_of_a_sinusoidal_rate_matches_its_closed_form() {
    // A rate of 6 + 3 cos(πt) kg/s: over 1 s, half a period, its running mean swings by 3 · 2/π.
    let responses =
        sample(5.0, |t| 6.0 * t + 3.0 / std::f64::consts::PI * (std::f64::consts::PI * t).sin()).responses();
    near(responses.rate_variation, 3.0 * std::f64::consts::FRAC_2_PI / 6.0 / 2f64.sqrt(), 0.01);
    near(responses.lowest_rate_ratio, 0.6 - 0.3 * std::f64::consts::FRAC_2_PI, 1e-3);
    assert_eq!(responses.steady, Some(false));
}

#[test]
fn rate_variation_needs_2_s_of_discharge() {
    assert_eq!(sample(1.98, line(8.0)).responses().rate_variation, None);
    close(sample(2.0, line(8.0)).responses().rate_variation, 0.0);
}

#[test]
fn regime_of_a_hopper_that_empties_early_is_known() {
    let responses = sample(2.5, line(16.0)).ended(EndReason::Empty).responses();
    close(responses.discharged_kg_at_4s, 40.0);
    close(responses.time_to_99_percent_s, 0.99 * 2.5);
    close(responses.mean_rate_kg_s, 16.0);
    assert_eq!(responses.regime, Some(Regime::Constant));
    close(responses.linearity_until_s, 2.0);
    close(responses.linearity_r2, 1.0);
    // The same curve, cut off: what 4 s would have brought is not known, that it flowed is.
    let cut = sample(2.5, line(16.0)).responses();
    assert_eq!(cut.discharged_kg_at_4s, None);
    assert_eq!(cut.regime, Some(Regime::Constant));
}

#[test]
fn hopper_that_empties_within_a_second_has_a_regime_but_no_mean_rate() {
    for (rate, end) in [(60.0, 0.68), (200.0, 0.2)] {
        let responses = sample(end, line(rate)).ended(EndReason::Empty).responses();
        assert_eq!(responses.regime, Some(Regime::Constant));
        close(responses.peak_rate_kg_s, 40.0);
        close(responses.discharged_kg_at_4s, 40.0);
        close(responses.time_to_95_percent_s, 38.0 / rate);
        assert_eq!(responses.mean_rate_kg_s, None);
        assert_eq!(responses.rate_variation, None);
        close(responses.lowest_rate_ratio, rate / 10.0);
    }
    let cut = sample(0.68, line(60.0)).responses();
    assert_eq!(cut.peak_rate_kg_s, None);
}

#[test]
fn short_run_is_too_short_unless_the_hopper_emptied_or_jammed() {
    let short = |end_reason| sample(3.98, line(3.0)).ended(end_reason).responses();
    assert_eq!(short(EndReason::Duration).regime, Some(Regime::TooShort));
    assert_eq!(short(EndReason::Unstable).regime, Some(Regime::TooShort));
    assert_eq!(short(EndReason::Empty).regime, Some(Regime::Inconsistent));
    assert_eq!(sample(4.0, line(3.0)).responses().regime, Some(Regime::Inconsistent));
    let jammed = sample(2.0, |t| 8.0 * t.min(0.5)).ended(EndReason::Jammed).responses();
    assert_eq!(jammed.regime, Some(Regime::NoFlow));
    assert_eq!(jammed.discharged_kg_at_4s, Some(4.0), "what has jammed stays");
    // The step nearest to 4 s may lie before it.
    let early = sample(3.9998, line(3.0)).responses();
    assert_eq!((early.regime, early.discharged_kg_at_4s.is_some()), (Some(Regime::Inconsistent), true));
}

#[test]
fn regimes_change_at_their_shares_of_the_belt_capacity() {
    let regime = |rate| sample(6.0, line(rate)).responses().regime.unwrap();
    assert_eq!(regime(1.499), Regime::NoFlow);
    assert_eq!(regime(1.501), Regime::Inconsistent);
    assert_eq!(regime(5.499), Regime::Inconsistent);
    assert_eq!(regime(5.501), Regime::Constant);
}

#[test]
fn only_a_hopper_that_does_not_empty_has_no_flow() {
    // 8 kg/s, a stop of 2 s after 16 kg, and 8 kg/s again until the last sample: 94.9 %, 95.1 % or all of it.
    let stopped = |t: f64| 8.0 * (if t < 2.0 { t } else { (t - 2.0).max(2.0) });
    let regime = |end: f64| sample(end, stopped).responses().regime;
    assert_eq!(regime(2.0 + 0.949 * 5.0), Some(Regime::NoFlow));
    assert_eq!(regime(2.0 + 0.952 * 5.0), Some(Regime::Inconsistent));
    // Nothing for the first 3 s.
    let late = |end: f64| sample(end, |t| (20.0 * (t - 3.0)).clamp(0.0, FILLED)).responses().regime;
    assert_eq!((late(4.0), late(5.0)), (Some(Regime::NoFlow), Some(Regime::Inconsistent)));
    // An empty hopper is empty, whatever the curve says.
    let empty = sample(1.0, |_| 0.0).ended(EndReason::Empty).responses();
    assert_eq!(empty.regime, Some(Regime::Inconsistent));
}

#[test]
fn belt_that_outruns_the_bed_has_the_regime_outrun() {
    // The bed of 40 kg has 1000 kg/m³; 0.08 m³/s carry it away in exactly 0.5 s.
    let regime = |opening_m3_s: f64, flow: &Sampled| {
        Discharge { full_opening_m3_s: Some(opening_m3_s), ..flow.discharge() }.responses().regime
    };
    let steady = sample(6.0, line(10.0));
    assert_eq!(regime(0.0799, &steady), Some(Regime::Inconsistent), "q is 0.125, and it emptied");
    assert_eq!(regime(0.0801, &steady), Some(Regime::Outrun));
    assert_eq!(regime(0.0801, &sample(6.0, line(2.0))), Some(Regime::Outrun), "a slow flow is a flow");
    assert_eq!(regime(0.0801, &sample(3.0, line(2.0))), Some(Regime::TooShort));
    // After a spill of 4 kg nothing moves: less than 1 % of 40 kg in a second is a jam.
    let stopped = |rate: f64| sample(6.0, move |t| 8.0 * t.min(0.5) + rate * (t - 0.5).max(0.0));
    assert_eq!(regime(0.0801, &stopped(0.39)), Some(Regime::NoFlow));
    assert_eq!(regime(0.0801, &stopped(0.41)), Some(Regime::Outrun));
}

#[test]
fn without_an_opening_the_regime_is_null() {
    let moving = sample(6.0, line(8.0));
    let unknown = Discharge { full_opening_m3_s: None, ..moving.discharge() }.responses();
    assert_eq!((unknown.regime, unknown.belt_capacity_kg_s), (None, None));
    assert_eq!((unknown.lowest_rate_ratio, unknown.longest_stoppage_s), (None, None));
    close(unknown.mean_rate_kg_s, 8.0);
}

#[test]
fn regime_ignores_slow_flow_of_the_last_fifth() {
    let responses = sample(10.0, |t| if t < 4.2 { 8.0 * t } else { 33.6 + 0.1 * (t - 4.2) }).responses();
    assert_eq!(responses.regime, Some(Regime::Constant));
    close(responses.longest_stoppage_s, 0.0);
    assert_eq!(responses.time_to_95_percent_s, None);
}

#[test]
fn zero_discharge_has_the_expected_responses() {
    let responses = sample(6.0, |_| 0.0).responses();
    close(responses.discharged_kg, 0.0);
    close(responses.discharged_kg_at_4s, 0.0);
    close(responses.mean_rate_kg_s, 0.0);
    close(responses.peak_rate_kg_s, 0.0);
    assert_eq!((responses.rate_variation, responses.linearity_r2), (None, None));
    assert_eq!(responses.regime, Some(Regime::NoFlow));
    close(responses.longest_stoppage_s, 6.0);
}

#[test]
fn responses_are_null_without_samples_capacity_or_fill() {
    let of = |t_s: Vec<f64>, end_reason| Sampled {
        mass_kg: vec![0.0; t_s.len()],
        inside_kg: vec![FILLED; t_s.len()],
        t_s,
        end_reason,
    };
    let none = of(vec![], EndReason::FillNotAtRest).responses();
    assert_eq!(none.regime, Some(Regime::TooShort));
    let one = of(vec![0.0], EndReason::Unstable).responses();
    assert_eq!((one.regime, one.longest_stoppage_s), (Some(Regime::TooShort), None));
    let moving = sample(6.0, line(8.0));
    let still = Discharge { full_opening_m3_s: Some(0.0), ..moving.discharge() }.responses();
    assert_eq!((still.regime, still.lowest_rate_ratio, still.longest_stoppage_s), (None, None, None));
    close(still.mean_rate_kg_s, 8.0);
    let flat = Discharge { bed_volume_m3: 0.0, filled_kg: 0.0, ..moving.discharge() }.responses();
    assert_eq!((flat.regime, flat.bulk_density_kg_m3, flat.time_to_95_percent_s), (None, None, None));
    for responses in [none, one, still, flat] {
        let map = responses.into_map();
        assert!(map.values().all(|value| !value.is_object() && !value.is_array()), "{map:?}");
    }
}

#[test]
fn responses_hardly_depend_on_the_output_interval() {
    let wave = |t: f64| 7.0 * t + 0.5 * (2.0 * t).sin();
    let fine = sample_every(0.001, 6.0, wave).responses();
    let coarse = sample_every(0.1, 6.0, wave).responses();
    near(coarse.rate_variation, fine.rate_variation.unwrap(), 2e-3);
    near(coarse.lowest_rate_ratio, fine.lowest_rate_ratio.unwrap(), 2e-3);
    near(coarse.mean_rate_kg_s, fine.mean_rate_kg_s.unwrap(), 2e-3);
    near(coarse.linearity_r2, fine.linearity_r2.unwrap(), 2e-3);
}

#[test]
fn response_map_is_flat_and_has_regimes_as_words() {
    let map = sample(6.0, line(3.0)).responses().into_map();
    assert_eq!(map["regime"], "inconsistent");
    assert_eq!((&map["jammed"], &map["time_to_jam_s"]), (&0.into(), &serde_json::Value::Null));
    let stopped = sample(6.0, |t| 8.0 * t.min(2.0)).responses().into_map();
    assert_eq!((&stopped["jammed"], &stopped["time_to_jam_s"]), (&1.into(), &2.0.into()));
    let short = sample(0.5, line(3.0)).responses().into_map();
    assert!(short["jammed"].is_null() && short["time_to_jam_s"].is_null());
    assert_eq!(map["steady"], true);
    assert_eq!(map["discharged_kg"], 18.0);
    assert!(map["time_to_95_percent_s"].is_null());
    for name in ["discharged_kg_at_4s", "peak_rate_kg_s", "longest_stoppage_s", "belt_capacity_kg_s"] {
        assert!(map[name].is_number(), "{name}");
    }
}

#[test]
fn mass_rate_is_the_mean_slope_over_its_window() {
    let sampled = sample(2.0, |t| 8.0 * (t - 1.0).max(0.0));
    let rates = mass_rate(&sampled.t_s, &sampled.mass_kg);
    assert_eq!(rates.len(), sampled.t_s.len());
    close(rates[0], 0.0);
    close(rates[43], 0.0); // 0.86 s: the window ends at 0.985 s
    close(rates[50], 4.0); // 1 s: half the window
    close(rates[57], 8.0); // 1.14 s: the window begins at 1.015 s
    close(rates[100], 8.0);
    assert_eq!(mass_rate(&[0.0], &[0.0]), [0.0]);
    assert!(mass_rate(&[], &[]).is_empty());
}

#[test]
fn known_mass_rates_equal_those_of_the_complete_curve() {
    let sampled = sample(2.0, |t| t * t);
    let all = mass_rate(&sampled.t_s, &sampled.mass_kg);
    for n in 0..=all.len() {
        let known: Vec<f64> = known_mass_rates(&sampled.t_s[..n], &sampled.mass_kg[..n], 0).collect();
        assert_eq!(known, all[..known.len()], "of {n} samples");
        // Half a window of 0.25 s is six samples and a quarter.
        assert!(known.len() + 7 >= n && (known.is_empty() || known.len() + 6 < n), "{} of {n}", known.len());
    }
}

#[test]
fn integral_of_the_mass_rate_is_the_mass() {
    let sampled = sample(6.0, |t| 16.0 * t.min(0.3) + 6.0 * (t - 0.3).max(0.0));
    let rates = mass_rate(&sampled.t_s, &sampled.mass_kg);
    let sum = rates.windows(2).map(|pair| (pair[0] + pair[1]) / 2.0 * 0.02).sum::<f64>();
    near(Some(sum), 39.0, 0.3);
}

//! The monitor of a hopper: waits for rest, starts the belt, counts the mass past the gate, removes fillets that have left.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::curl::Curls;
use super::feed::Feed;
use super::loads::LoadMonitor;
use super::opening::full_opening_m3_s;
use super::{DISCHARGED_MASS, GONE_BEYOND_M, INSIDE_MASS, MASS_RATE, RESIDENCE_SHARE, floor};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::experiments::interpenetration::Interpenetration;
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::warnings::{FEED_SHORT, NO_REGIME, never_at_rest};
use crate::observe::{
    Discharge, REST_DURATION_S, Recorder, ResidenceTimes, RestDetector, SeriesId, has_stopped,
    known_mass_rates, mass_rate,
};
use crate::result::{Curve, EndReason, Warning};
use crate::scenario::{Equipment, Numerics, Scenario};

/// The bed's surface is the height that this share of the hopper's floor stays below.
const SURFACE_SHARE: f64 = 0.95;

/// The bed at rest, when the belt starts.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
struct Bed {
    mass_kg: f64,
    volume_m3: f64,
    fill_s: f64,
    /// Share of the sub-particles that lie inside another fillet.
    interpenetrated: Option<f64>,
}

/// The hopper's monitor.
#[derive(Debug)]
pub(super) struct HopperMonitor {
    equipment: Equipment,
    numerics: Numerics,
    low_m: glam::DVec3,
    high_m: glam::DVec3,
    periodic: bool,
    /// Nothing can be at rest before the highest fillet has fallen, in seconds.
    longest_fall_s: f64,
    rest: RestDetector,
    interpenetration: Interpenetration,
    bed: Option<Bed>,
    /// Whether each sub-particle, by serial, has passed the gate.
    passed: Vec<bool>,
    unpassed: usize,
    discharged_kg: f64,
    escaped_kg: f64,
    last_passage_s: f64,
    recorder: Recorder,
    mass: SeriesId,
    rate: SeriesId,
    bonds_intact: SeriesId,
    kinetic_energy: SeriesId,
    inside: SeriesId,
    feed: Feed,
    curls: Curls,
    loads: LoadMonitor,
    residence: ResidenceTimes,
    /// Volume per second through the full opening, or why it is unknown.
    full_opening_m3_s: Result<f64, String>,
    greatest_height_m: Option<f64>,
    max_overlap_m: f32,
    radius_m: f64,
    mass_at_start_kg: f64,
}

impl HopperMonitor {
    /// For a scenario and the scene made from it.
    pub(super) fn new(scenario: &Scenario, equipment: &Equipment, scene: &Scene) -> Self {
        let subparticles: usize =
            scene.bodies.iter().map(|body| &scene.kinds[body.kind]).map(|kind| kind.meta.points.len()).sum();
        let mut recorder = Recorder::default();
        Self {
            equipment: equipment.clone(),
            numerics: scenario.numerics.clone(),
            low_m: scene.low,
            high_m: scene.high,
            periodic: scene.periodic_y,
            longest_fall_s: longest_fall(scene),
            rest: RestDetector::default(),
            interpenetration: Interpenetration::new(scene),
            bed: None,
            passed: vec![false; subparticles],
            unpassed: subparticles,
            discharged_kg: 0.0,
            escaped_kg: 0.0,
            last_passage_s: 0.0,
            mass: recorder.add_row(&DISCHARGED_MASS),
            rate: recorder.add_row(&MASS_RATE),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            curls: Curls::new(scene),
            residence: ResidenceTimes::default(),
            full_opening_m3_s: full_opening_m3_s(equipment, scene),
            greatest_height_m: None,
            max_overlap_m: 0.0,
            radius_m: scene.radius_m,
            mass_at_start_kg: scene.present().iter().map(|body| scene.kinds[body.kind].mass_kg()).sum(),
            inside: recorder.add_row(&INSIDE_MASS),
            loads: LoadMonitor::new(equipment, scene, &mut recorder),
            feed: Feed::new(scenario, equipment, scene),
            recorder,
        }
    }

    fn at_rest(&mut self, state: &State, now_s: f64) -> bool {
        let moving = state.faster_than(self.numerics.rest_speed_m_s);
        self.rest.record(now_s, moving, state.particles.len());
        now_s >= self.longest_fall_s && self.rest.since_s(REST_DURATION_S).is_some()
    }

    fn count_passed(&mut self, state: &State, now_s: f64) {
        let before = self.unpassed;
        for (i, &serial) in state.serials.iter().enumerate() {
            let passed = &mut self.passed[serial as usize];
            if !*passed && state.position(i).x > 0.0 {
                *passed = true;
                self.unpassed -= 1;
                self.discharged_kg += f64::from(state.masses[i]);
            }
        }
        if self.unpassed < before {
            self.last_passage_s = now_s;
        }
    }

    /// Serials of sub-particles that leave: of fillets wholly past the gate, and those outside the domain.
    fn leaving(&mut self, state: &State) -> Vec<u32> {
        let mut left = Vec::new();
        for (_, range) in state.body_ranges() {
            let gone = range.clone().all(|i| state.position(i).x > GONE_BEYOND_M);
            left.extend(range.filter(|&i| gone || self.is_outside(state.position(i))));
        }
        for &i in &left {
            if !std::mem::replace(&mut self.passed[state.serials[i] as usize], true) {
                self.unpassed -= 1;
                self.escaped_kg += f64::from(state.masses[i]);
            }
        }
        left.into_iter().map(|i| state.serials[i]).collect()
    }

    fn is_outside(&self, x: glam::DVec3) -> bool {
        let (below, above) = (x.cmplt(self.low_m), x.cmpgt(self.high_m));
        below.x || below.z || above.x || above.z || (!self.periodic && (below.y || above.y))
    }

    /// Mass that has not passed the gate, in kilograms.
    fn inside_kg(&self, state: &State) -> f64 {
        let inside =
            state.serials.iter().zip(&state.masses).filter(|(serial, _)| !self.passed[**serial as usize]);
        inside.map(|(_, &mass)| f64::from(mass)).fold(0.0, |a, b| a + b)
    }

    fn stop(&self, now_s: f64) -> Option<EndReason> {
        let stop = &self.numerics.stop;
        if stop.when_empty && self.unpassed == 0 {
            return Some(EndReason::Empty);
        }
        let is_jammed = |after_s| has_stopped(self.last_passage_s, now_s, after_s);
        stop.when_jammed_s.is_some_and(is_jammed).then_some(EndReason::Jammed)
    }
}

impl ExperimentMonitor for HopperMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let state = sample.state;
        self.max_overlap_m = sample.max_overlap_m;
        self.loads.passed_through = sample.passed_through;
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        let Some(now_s) = sample.belt_time_s else {
            if state.particles.is_empty() {
                // All fillets sank through the belt.
                return Decision::End(EndReason::FillNotAtRest);
            }
            if self.at_rest(state, sample.simulated_s) {
                let mass_kg = state.masses.iter().map(|&m| f64::from(m)).sum();
                let volume_m3 = bed_volume(state, &self.equipment);
                let interpenetrated = self.interpenetration.fraction(state);
                self.bed = Some(Bed { mass_kg, volume_m3, fill_s: sample.simulated_s, interpenetrated });
                return Decision::Start;
            }
            return Decision::Continue { remove: self.leaving(state) };
        };
        self.count_passed(state, now_s);
        self.curls.note(state, now_s);
        self.loads.record(sample, now_s, &mut self.recorder);
        for (body, range) in state.body_ranges() {
            let (count, x) = (range.len() as f64, range.map(|i| state.position(i).x).sum::<f64>());
            self.residence.record(body as usize, now_s, x / count);
        }
        let remove = self.leaving(state);
        self.recorder.record(self.mass, self.discharged_kg);
        self.recorder.record(self.inside, self.inside_kg(state));
        let known = self.recorder.values(self.rate).len();
        let (t_s, mass_kg) = (self.recorder.belt_s(self.mass), self.recorder.values(self.mass));
        let rates: Vec<f64> = known_mass_rates(t_s, mass_kg, known).collect();
        self.recorder.record_derived(self.rate, self.mass, rates);
        let inside = (0..state.particles.len()).map(|i| state.position(i)).filter(|x| x.x <= 0.0);
        self.greatest_height_m = inside.map(|x| x.z + self.radius_m).reduce(f64::max);
        match self.stop(now_s) {
            Some(reason) => Decision::End(reason),
            None => Decision::Continue { remove },
        }
    }

    fn entering(&mut self, state: &State, belt_time_s: Option<f64>) -> Vec<Placement> {
        let Some(now_s) = belt_time_s else { return Vec::new() };
        let first = self.feed.next_body();
        let entering = self.feed.entering(state, now_s);
        for (body, placement) in (first..).zip(&entering) {
            self.residence.record(body, now_s, placement.position.x);
        }
        entering
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(
            self.recorder.save(),
            &self.rest,
            &self.bed,
            &self.passed,
            &self.unpassed,
            &self.discharged_kg,
            &self.escaped_kg,
            &self.last_passage_s,
            &self.residence,
            &self.greatest_height_m,
            &self.max_overlap_m,
            &self.curls.samples,
            &self.loads.samples,
            &self.loads.passed_through,
            self.feed.save(),
        ))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let (samples, feed);
        let bodies = self.passed.len();
        (
            samples,
            self.rest,
            self.bed,
            self.passed,
            self.unpassed,
            self.discharged_kg,
            self.escaped_kg,
            self.last_passage_s,
            self.residence,
            self.greatest_height_m,
            self.max_overlap_m,
            self.curls.samples,
            self.loads.samples,
            self.loads.passed_through,
            feed,
        ) = saved.read()?;
        let fits = self.passed.len() == bodies && self.feed.restore(feed) && self.recorder.restore(samples);
        if fits { Ok(()) } else { Err(SavedFieldsError) }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn discharged_kg(&self) -> f64 {
        self.discharged_kg
    }

    fn finish(&mut self) {
        let known = self.recorder.values(self.rate).len();
        let rates = mass_rate(self.recorder.belt_s(self.mass), self.recorder.values(self.mass));
        self.recorder.record_derived(self.rate, self.mass, rates.into_iter().skip(known));
    }

    fn responses(&self, reason: EndReason) -> Map<String, Value> {
        let bed = self.bed.unwrap_or_default();
        let discharge = Discharge {
            t_s: self.recorder.belt_s(self.mass),
            mass_kg: self.recorder.values(self.mass),
            inside_kg: self.recorder.values(self.inside),
            jam_after_s: self.numerics.shortest_jam_s(),
            end_reason: reason,
            filled_kg: bed.mass_kg,
            bed_volume_m3: bed.volume_m3,
            full_opening_m3_s: self.full_opening_m3_s.as_ref().ok().copied(),
            greatest_height_m: self.greatest_height_m,
        };
        let curl = self.curls.mean_and_largest_deg(discharge.flowing_until_s());
        let mut responses = discharge.responses().into_map();
        let is_fed = self.equipment.feed_kg_s > 0.0;
        let end_s = self.recorder.belt_s(self.mass).last().copied().unwrap_or_default();
        // With a feed the first filling is no steady state.
        let load_times_s = if is_fed { 0.5 * end_s..=end_s } else { 0.0..=discharge.flowing_until_s() };
        self.loads.add_responses(load_times_s, &mut responses);
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("loaded_kg", self.mass_at_start_kg.into());
        add("escaped_kg", self.escaped_kg.into());
        add("fed_kg", self.feed.fed_kg().into());
        add("inside_kg", self.recorder.last(self.inside).into());
        let (t_s, mass_kg) = (self.recorder.belt_s(self.mass), self.recorder.values(self.mass));
        let steady_kg_s = second_half_rate(t_s, mass_kg).filter(|_| is_fed);
        add("steady_rate_kg_s", steady_kg_s.into());
        let residence = self.residence.residence();
        add("residence_mean_s", residence.mean_s().into());
        add("residence_5_percent_s", residence.percentile_s(0.05).into());
        add("residence_median_s", residence.percentile_s(0.5).into());
        add("residence_95_percent_s", residence.percentile_s(0.95).into());
        add("fillets_remaining", residence.so_far_s.len().into());
        add("curl_angle_deg", curl.map(|(mean, _)| mean).into());
        add("largest_curl_angle_deg", curl.map(|(_, largest)| largest).into());
        add("interpenetrated_fraction", bed.interpenetrated.into());
        add("fill_duration_s", self.bed.map(|bed| bed.fill_s).into());
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        add("kinetic_energy_end_j", self.recorder.last(self.kinetic_energy).into());
        add("max_overlap_ratio", (f64::from(self.max_overlap_m) / self.radius_m).into());
        responses
    }

    fn warnings(&self, reason: EndReason) -> Vec<Warning> {
        let at_rest = reason != EndReason::FillNotAtRest;
        let never_began = (!at_rest).then(|| never_at_rest(self.numerics.max_fill_s));
        let no_regime = self.full_opening_m3_s.as_ref().err().map(|reason| {
            NO_REGIME.with(&format!("regime, lowest_rate_ratio and longest_stoppage_s are null: {reason}."))
        });
        let feed_short = self.feed.missed_kg().map(|due_kg| {
            FEED_SHORT.with(&format!("The feed brought {:.2} kg of {due_kg:.2} kg due.", self.feed.fed_kg()))
        });
        [never_began, no_regime, feed_short].into_iter().flatten().collect()
    }

    fn curves(&self) -> Vec<Curve> {
        let residence = self.residence.residence();
        vec![RESIDENCE_SHARE.curve(residence.times_s.clone(), residence.shares())]
    }
}

/// Mean rate in the second half of the samples' time, in kg/s; none without time.
fn second_half_rate(t_s: &[f64], mass_kg: &[f64]) -> Option<f64> {
    let end = t_s.len().checked_sub(1)?;
    let middle = t_s.partition_point(|&t| t < 0.5 * t_s[end]);
    (t_s[middle] < t_s[end]).then(|| (mass_kg[end] - mass_kg[middle]) / (t_s[end] - t_s[middle]))
}

/// Time that the highest fillet takes to fall to the belt, in seconds; none without gravity.
fn longest_fall(scene: &Scene) -> f64 {
    let top = scene.present().iter().map(|body| body.position.z).fold(0.0, f64::max);
    let gravity = scene.gravity.length();
    if gravity > 0.0 { (2.0 * top / gravity).sqrt() } else { 0.0 }
}

/// Hopper area times the height that 95 % of its floor, in squares of a sub-particle's diameter, stay below; in m³. The area is
/// that of the floor: the part above a sloped back wall counts as if the wall stood upright.
fn bed_volume(state: &State, equipment: &Equipment) -> f64 {
    let floor = floor(equipment);
    let (size, cell) = (floor.high - floor.low, 2.0 * f64::from(state.radius_m));
    let counts = (size / cell).floor().max(glam::DVec2::ONE);
    let mut heights = vec![0.0f64; (counts.x * counts.y) as usize];
    for i in 0..state.particles.len() {
        let x = state.position(i);
        let at = ((x.truncate() - floor.low) / size * counts).floor();
        if at.cmpge(glam::DVec2::ZERO).all() && at.cmplt(counts).all() {
            let cell = (at.x + counts.x * at.y) as usize;
            heights[cell] = heights[cell].max(x.z + f64::from(state.radius_m));
        }
    }
    heights.sort_unstable_by(f64::total_cmp);
    let surface = heights[((heights.len() - 1) as f64 * SURFACE_SHARE).round() as usize];
    size.x * size.y * surface
}

//! The monitor of a drop: broken bonds, settling, and parts that leave the space over their plate.

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use super::scene::Grid;
use super::{BONDS_OF_EACH, PLATE_FORCE, SETTLE_TIME};
use crate::engine::run::{Decision, ExperimentMonitor, Sample};
use crate::engine::saved_fields::{SavedFields, SavedFieldsError};
use crate::engine::scene::{Placement, Scene};
use crate::engine::state::State;
use crate::experiments::CurveRow;
use crate::experiments::energy::{ENERGY_MARGIN, given_j};
use crate::experiments::outputs::{BONDS_INTACT, KINETIC_ENERGY};
use crate::experiments::placement::GAP_RATIO;
use crate::experiments::warnings::TEST_NEVER_BEGAN;
use crate::observe::{Recorder, RestDetector, SeriesId, SettlingTimer};
use crate::result::{Curve, EndReason, Warning};
use crate::scenario::{Drop, Numerics, Scenario};

/// The run ends once all have settled and have been at rest for this long, in seconds. A fillet that stands on its end and
/// is about to topple has moved by then.
const REST_FOR_S: f64 = 0.25;

/// The state of one fillet.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Fillet {
    bonds: u64,
    /// Broken bonds of sub-particles that have left.
    broken_and_gone: u64,
    broken: u64,
    settling: SettlingTimer,
    /// Maximum kinetic energy of a passive body, in joule.
    most_energy_j: f64,
}

impl Fillet {
    fn bonds_intact_fraction(&self) -> f64 {
        if self.bonds == 0 { 1.0 } else { 1.0 - self.broken as f64 / self.bonds as f64 }
    }
}

/// The drop's monitor.
#[derive(Debug)]
pub(super) struct DropMonitor {
    numerics: Numerics,
    grid: Grid,
    fillets: Vec<Fillet>,
    rest: RestDetector,
    escaped_kg: f64,
    max_overlap_m: f32,
    passed_through: u64,
    radius_m: f64,
    recorder: Recorder,
    kinetic_energy: SeriesId,
    bonds_intact: SeriesId,
    plate_force: SeriesId,
}

impl DropMonitor {
    pub(super) fn new(scenario: &Scenario, drop: &Drop, scene: &Scene, grid: Grid) -> Self {
        // A free fall through the gap.
        let gap_m = GAP_RATIO * scene.radius_m;
        let (g, speed) = (scenario.numerics.gravity_m_s2, drop.speed_m_s);
        let hits_at = (speed * speed + 2.0 * g * gap_m).sqrt();
        let contact_s = 2.0 * gap_m / (speed + hits_at);
        let fillet = |body: &Placement| {
            let kind = &scene.kinds[body.kind];
            let mass_kg = kind.subparticle_mass_kg * kind.meta.points.len() as f64;
            let energy_j = 0.5 * mass_kg * hits_at * hits_at;
            let given_j = given_j(kind, &scenario.contact, scene.radius_m, hits_at, g * body.position.z);
            Fillet {
                bonds: kind.meta.bonds.len() as u64,
                broken_and_gone: 0,
                broken: 0,
                settling: SettlingTimer::new(contact_s, energy_j),
                most_energy_j: ENERGY_MARGIN * given_j,
            }
        };
        let mut recorder = Recorder::default();
        Self {
            numerics: scenario.numerics.clone(),
            grid,
            fillets: scene.bodies.iter().map(fillet).collect(),
            rest: RestDetector::default(),
            escaped_kg: 0.0,
            max_overlap_m: 0.0,
            passed_through: 0,
            radius_m: scene.radius_m,
            kinetic_energy: recorder.add_row(&KINETIC_ENERGY),
            bonds_intact: recorder.add_row(&BONDS_INTACT),
            plate_force: recorder.add_row(&PLATE_FORCE),
            recorder,
        }
    }

    /// Observes each fillet. Returns serials that have left the space over their plate, or the reason of a divergence.
    fn observe_fillets(&mut self, state: &State, now_s: f64) -> Result<Vec<u32>, String> {
        let mut left = Vec::new();
        let mut diverged = None;
        for (number, range) in state.body_ranges() {
            let (fillet, middle) = (&mut self.fillets[number as usize], self.grid.middle(number as usize));
            let broken = |i: usize| u64::from(state.broken[i]);
            fillet.broken = fillet.broken_and_gone + range.clone().map(broken).sum::<u64>();
            let energy_j = state.kinetic_energy_of(range.clone());
            fillet.settling.record(now_s, energy_j);
            if energy_j > fillet.most_energy_j {
                let most = fillet.most_energy_j;
                diverged.get_or_insert(format!(
                    "fillet {number} has {energy_j:.2e} J of kinetic energy; the limit is {most:.2e} J, twice the energy that it can have"
                ));
            }
            for i in range.filter(|&i| !self.grid.holds(state.position(i) - middle)) {
                fillet.broken_and_gone += broken(i);
                self.escaped_kg += f64::from(state.masses[i]);
                left.push(state.serials[i]);
            }
        }
        diverged.map_or(Ok(left), Err)
    }

    fn settle_times_s(&self) -> impl Iterator<Item = Option<f64>> {
        self.fillets.iter().map(|fillet| fillet.settling.time_s())
    }

    fn is_done(&self) -> bool {
        self.numerics.stop.when_done
            && self.rest.since_s(REST_FOR_S).is_some()
            && self.settle_times_s().all(|time| time.is_some())
    }
}

impl ExperimentMonitor for DropMonitor {
    fn observe(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        let state = sample.state;
        self.max_overlap_m = sample.max_overlap_m;
        self.passed_through = sample.passed_through;
        self.recorder.begin_sample(sample.simulated_s, sample.belt_time_s);
        self.recorder.record(self.kinetic_energy, state.kinetic_energy());
        self.recorder.record(self.bonds_intact, state.bonds_intact_fraction());
        let force_n = sample.surface_loads.iter().fold(0.0, |sum, load| sum - load.force.z);
        self.recorder.record(self.plate_force, force_n);
        self.rest.record(now_s, state.faster_than(self.numerics.rest_speed_m_s), state.particles.len());
        match self.observe_fillets(state, now_s) {
            Err(reason) => Decision::Diverged(reason),
            Ok(_) if self.is_done() => Decision::End(EndReason::Done),
            Ok(remove) => Decision::Continue { remove },
        }
    }

    fn save(&self) -> SavedFields {
        SavedFields::of(&(
            self.recorder.save(),
            &self.rest,
            &self.escaped_kg,
            &self.max_overlap_m,
            &self.passed_through,
            &self.fillets,
        ))
    }

    fn restore(&mut self, saved: &SavedFields) -> Result<(), SavedFieldsError> {
        let samples;
        let fillets = self.fillets.len();
        (samples, self.rest, self.escaped_kg, self.max_overlap_m, self.passed_through, self.fillets) =
            saved.read()?;
        if self.fillets.len() == fillets && self.recorder.restore(samples) {
            Ok(())
        } else {
            Err(SavedFieldsError)
        }
    }

    fn recorder(&self) -> &Recorder {
        &self.recorder
    }

    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let intact = || self.fillets.iter().map(Fillet::bonds_intact_fraction);
        let settled: Vec<f64> = self.settle_times_s().flatten().collect();
        let count = self.fillets.len();
        let all = (settled.len() == count).then_some(&settled);
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("bonds_intact_fraction", self.recorder.last(self.bonds_intact).into());
        add("lowest_bonds_intact_fraction", intact().reduce(f64::min).into());
        add("settle_time_s", all.map(|times| times.iter().sum::<f64>() / count as f64).into());
        add("longest_settle_time_s", all.and_then(|times| times.iter().copied().reduce(f64::max)).into());
        add("settled_fraction", (settled.len() as f64 / count as f64).into());
        add("max_overlap_ratio", (f64::from(self.max_overlap_m) / self.radius_m).into());
        add("kinetic_energy_end_j", self.recorder.last(self.kinetic_energy).into());
        add("escaped_kg", self.escaped_kg.into());
        add("passed_through", self.passed_through.into());
        responses
    }

    fn warnings(&self, _reason: EndReason) -> Vec<Warning> {
        let touched = self.recorder.values(self.plate_force).iter().any(|force| *force != 0.0);
        let end_s = self.recorder.belt_s(self.plate_force).last().copied().unwrap_or(0.0);
        let figures = format!("No fillet touched its plate until the end at {end_s:.3} s.");
        (!touched).then(|| TEST_NEVER_BEGAN.with(&figures)).into_iter().collect()
    }

    fn curves(&self) -> Vec<Curve> {
        let curve = |row: &CurveRow, of: &dyn Fn(&Fillet) -> Option<f64>| {
            let values = self.fillets.iter().enumerate().filter_map(|(i, f)| Some((i as f64, of(f)?)));
            let (x, values) = values.unzip();
            row.curve(x, values)
        };
        vec![
            curve(&BONDS_OF_EACH, &|fillet| Some(fillet.bonds_intact_fraction())),
            curve(&SETTLE_TIME, &|fillet| fillet.settling.time_s()),
        ]
    }
}

//! Fillets that hit a plate, each by itself (paper sections 2.3.3 and 3.3, Fig. 9 to 12): how many bonds hold, and how long
//! it takes until 99 % of the kinetic energy are lost.
//!
//! Each fillet stands just above a plate of its own, turned as asked for, and moves down at the speed of the impact. The plates
//! lie so far apart that nothing gets from one to another; what leaves the room over its plate leaves the simulation,
//! counted as escaped and not as broken. Expected at Table 2: 99 % intact flat to 4 m/s and 85 % end on, settled after
//! 0.1 to 0.35 s, later at larger scale; S_t ≫ S_n breaks bonds, and the published bond diverges at S_n 1e7, S_t 1e5.
//!
//! *Settled* is a matter of the kinetic energy alone, and for good: until it falls under 1 % of what it was at first contact and
//! stays there. Gravity feeds it anew while a fillet topples over, so one dropped on end settles once it has come to lie.

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde_json::{Map, Value};

use super::placement::uniform;
use super::{Prepared, Watch, bounds_on_timestep, kind_of_each, kinds, laws, orientation, plan, timestep_s};
use crate::engine::run::{Decision, Director, Sample};
use crate::engine::scene::{Kind, Placement, Scene};
use crate::engine::state::State;
use crate::equipment::{Surface, SurfaceKind};
use crate::mesh::Meshes;
use crate::observe::{Rest, Settling};
use crate::result::{Curve, EndReason, Series};
use crate::scenario::{Drop, Numerics, Scenario};

/// Clearance over the plate at the start, as a share of R.
const GAP_RATIO: f64 = 0.05;
/// A fillet may slide for this long at the speed of its impact before it leaves its plate, in seconds.
const SLIDING_S: f64 = 0.1;
/// The plates are no farther apart than this, in metres, or positions would lose digits: at the default interval of samples
/// it stops all that is slower than 250 m/s.
const WIDEST_GAP_M: f64 = 1.0;
/// The domain holds at least this many plates in a row, so that it has the same fixed-point positions for up to the square of
/// that many fillets, and a fillet falls alike to the bit however many others there are.
const FEWEST_COLUMNS: u32 = 16;
/// The run is over once all have settled and have been at rest for this long, in seconds: what stands on its end and is about to
/// topple has moved by then.
const REST_FOR_S: f64 = 0.25;

/// Where the fillets stand: one plate each, on a square grid about the origin.
#[derive(Clone, Copy, Debug)]
struct Grid {
    columns: u32,
    rows: u32,
    /// Half the width of a plate, and the height of the room over it, in metres.
    room_m: f64,
    /// Distance of the plates' middles, in metres.
    pitch_m: f64,
}

impl Grid {
    fn new(count: u32, reach_m: f64, radius_m: f64, drop: &Drop, numerics: &Numerics) -> Self {
        let columns = f64::from(count).sqrt().ceil() as u32;
        // However it topples, a fillet ends within twice its reach.
        let room_m = 2.0 * (reach_m + radius_m) + SLIDING_S * drop.speed_m_s;
        // What leaves two plates towards each other between samples does not meet.
        let flight_m = numerics.speed_limit_m_s * numerics.output_interval_s;
        let pitch_m = 2.0 * room_m + (2.0 * flight_m).min(WIDEST_GAP_M) + 4.0 * radius_m;
        // In 64ths of a metre, which fixed-point positions hold exactly: all plates are alike to the bit.
        Self { columns, rows: count.div_ceil(columns), room_m, pitch_m: (32.0 * pitch_m).ceil() / 32.0 }
    }

    /// The middle of a plate, in metres.
    fn middle(&self, fillet: usize) -> DVec3 {
        let (column, row) = (fillet as u32 % self.columns, fillet as u32 / self.columns);
        let along = |index: u32, count: u32| (f64::from(index) - f64::from(count - 1) / 2.0) * self.pitch_m;
        DVec3::new(along(column, self.columns), along(row, self.rows), 0.0)
    }

    /// Half the width of the domain, in metres.
    fn half_m(&self) -> f64 {
        f64::from(self.columns.max(FEWEST_COLUMNS)) * self.pitch_m / 2.0
    }

    /// Whether a place, relative to the middle of the plate, lies in the room over it.
    fn holds(&self, x: DVec3) -> bool {
        let low = DVec3::splat(-self.room_m);
        x.cmpge(low).all() && x.cmple(-low).all()
    }
}

/// The experiment of a drop.
pub(super) fn prepare(scenario: &Scenario, drop: &Drop, meshes: &Meshes) -> Prepared {
    let (scene, grid) = scene_on_grid(scenario, drop, meshes);
    let watch = Box::new(DropWatch::new(scenario, drop, &scene, grid));
    Prepared { plan: plan(scenario), watch, scene }
}

/// The scene of a drop scenario.
pub fn scene(scenario: &Scenario, drop: &Drop, meshes: &Meshes) -> Scene {
    scene_on_grid(scenario, drop, meshes).0
}

fn scene_on_grid(scenario: &Scenario, drop: &Drop, meshes: &Meshes) -> (Scene, Grid) {
    let kinds = kinds(scenario, meshes);
    let radius_m = scenario.product.radius_m();
    let reach_m = kinds.iter().map(|kind| kind.meta.reach_m).fold(0.0, f64::max);
    let grid = Grid::new(scenario.product.count, reach_m, radius_m, drop, &scenario.numerics);
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    let bodies: Vec<Placement> = kind_of_each(scenario, kinds.len())
        .into_iter()
        .enumerate()
        .map(|(i, kind)| {
            let orientation = scattered(drop, &mut rng);
            let height = height_over_plate(&kinds[kind], orientation, radius_m);
            let position = grid.middle(i) + DVec3::Z * height;
            Placement { kind, position, orientation, velocity: DVec3::NEG_Z * drop.speed_m_s }
        })
        .collect();
    let plate = |i: usize| {
        let (middle, half) = (grid.middle(i), grid.room_m);
        let corner = middle - DVec3::new(half, half, 0.0);
        let (u, v) = (DVec3::X * 2.0 * half, DVec3::Y * 2.0 * half);
        Surface::parallelogram(&format!("plate {i}"), SurfaceKind::Equipment, corner, u, v)
    };
    let high = DVec3::splat(grid.half_m());
    let scene = Scene {
        radius_m,
        surfaces: (0..bodies.len()).map(plate).collect(),
        laws: laws::laws(scenario),
        gravity: DVec3::NEG_Z * scenario.numerics.gravity_m_s2,
        low: -high,
        high,
        periodic_y: false,
        timestep_s: timestep_s(scenario, &bounds_on_timestep(scenario, &kinds)),
        speed_limit_m_s: scenario.numerics.speed_limit_m_s,
        kinds,
        bodies,
        held: Vec::new(),
    };
    (scene, grid)
}

/// The orientation asked for, each angle off by up to the scatter.
fn scattered(drop: &Drop, rng: &mut ChaCha8Rng) -> DQuat {
    let mut off = || drop.scatter_deg * (2.0 * uniform(rng) - 1.0);
    orientation([drop.yaw_deg + off(), drop.pitch_deg + off(), drop.roll_deg + off()])
}

/// Height of the centre of mass at which the lowest sub-particle just does not touch, in metres.
fn height_over_plate(kind: &Kind, orientation: DQuat, radius_m: f64) -> f64 {
    let lowest = kind.meta.points.iter().map(|&point| (orientation * point).z).fold(f64::INFINITY, f64::min);
    radius_m * (1.0 + GAP_RATIO) - lowest
}

/// What is known of one fillet.
#[derive(Clone, Debug)]
struct Fillet {
    bonds: u64,
    /// Broken bonds of sub-particles that have left.
    broken_and_gone: u64,
    broken: u64,
    settling: Settling,
}

impl Fillet {
    fn bonds_intact_fraction(&self) -> f64 {
        if self.bonds == 0 { 1.0 } else { 1.0 - self.broken as f64 / self.bonds as f64 }
    }
}

/// The drop's director.
#[derive(Debug)]
pub struct DropWatch {
    numerics: Numerics,
    grid: Grid,
    fillets: Vec<Fillet>,
    rest: Rest,
    escaped_kg: f64,
    max_overlap_m: f32,
    radius_m: f64,
    t_s: Vec<f64>,
    kinetic_energy_j: Vec<f64>,
    bonds_intact: Vec<f64>,
    plate_force_n: Vec<f64>,
}

impl DropWatch {
    fn new(scenario: &Scenario, drop: &Drop, scene: &Scene, grid: Grid) -> Self {
        // A free fall through the gap.
        let gap_m = GAP_RATIO * scene.radius_m;
        let (g, speed) = (scenario.numerics.gravity_m_s2, drop.speed_m_s);
        let hits_at = (speed * speed + 2.0 * g * gap_m).sqrt();
        let contact_s = 2.0 * gap_m / (speed + hits_at);
        let fillet = |body: &Placement| {
            let kind = &scene.kinds[body.kind];
            let mass_kg = kind.subparticle_mass_kg * kind.meta.points.len() as f64;
            Fillet {
                bonds: kind.meta.bonds.len() as u64,
                broken_and_gone: 0,
                broken: 0,
                settling: Settling::new(contact_s, 0.5 * mass_kg * hits_at * hits_at),
            }
        };
        Self {
            numerics: scenario.numerics.clone(),
            grid,
            fillets: scene.bodies.iter().map(fillet).collect(),
            rest: Rest::default(),
            escaped_kg: 0.0,
            max_overlap_m: 0.0,
            radius_m: scene.radius_m,
            t_s: Vec::new(),
            kinetic_energy_j: Vec::new(),
            bonds_intact: Vec::new(),
            plate_force_n: Vec::new(),
        }
    }

    /// Looks at each fillet, and returns the serials of what has left the room over its plate.
    fn look_at_fillets(&mut self, state: &State, now_s: f64) -> Vec<u32> {
        let mut left = Vec::new();
        for (number, range) in state.body_ranges() {
            let (fillet, middle) = (&mut self.fillets[number as usize], self.grid.middle(number as usize));
            let broken = |i: usize| u64::from(state.broken[i]);
            fillet.broken = fillet.broken_and_gone + range.clone().map(broken).sum::<u64>();
            fillet.settling.note(now_s, state.kinetic_energy_of(range.clone()));
            for i in range.filter(|&i| !self.grid.holds(state.position(i) - middle)) {
                fillet.broken_and_gone += broken(i);
                self.escaped_kg += f64::from(state.masses[i]);
                left.push(state.serials[i]);
            }
        }
        left
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

impl Director for DropWatch {
    fn look(&mut self, sample: &Sample<'_>) -> Decision {
        let Some(now_s) = sample.belt_time_s else { return Decision::Start };
        let state = sample.state;
        self.max_overlap_m = sample.max_overlap_m;
        self.t_s.push(now_s);
        self.kinetic_energy_j.push(state.kinetic_energy());
        self.bonds_intact.push(state.bonds_intact_fraction());
        self.plate_force_n.push(sample.surface_forces.iter().fold(0.0, |sum, force| sum - force.z));
        self.rest.note(now_s, state.faster_than(self.numerics.rest_speed_m_s), state.particles.len());
        let remove = self.look_at_fillets(state, now_s);
        if self.is_done() { Decision::End(EndReason::Done) } else { Decision::Continue { remove } }
    }

    fn discharged_kg(&self) -> f64 {
        0.0
    }
}

impl Watch for DropWatch {
    fn responses(&self, _reason: EndReason) -> Map<String, Value> {
        let intact = || self.fillets.iter().map(Fillet::bonds_intact_fraction);
        let settled: Vec<f64> = self.settle_times_s().flatten().collect();
        let count = self.fillets.len();
        let all = (settled.len() == count).then_some(&settled);
        let mut responses = Map::new();
        let mut add = |name: &str, value: Value| responses.insert(name.to_owned(), value);
        add("bonds_intact_fraction", self.bonds_intact.last().copied().into());
        add("lowest_bonds_intact_fraction", intact().reduce(f64::min).into());
        add("settle_time_s", all.map(|times| times.iter().sum::<f64>() / count as f64).into());
        add("longest_settle_time_s", all.and_then(|times| times.iter().copied().reduce(f64::max)).into());
        add("settled_fraction", (settled.len() as f64 / count as f64).into());
        add("max_overlap_ratio", (f64::from(self.max_overlap_m) / self.radius_m).into());
        add("kinetic_energy_end_j", self.kinetic_energy_j.last().copied().into());
        add("escaped_kg", self.escaped_kg.into());
        responses
    }

    fn series(&self) -> Vec<Series> {
        let series = |name: &str, unit: &str, values: &[f64]| Series {
            name: name.into(),
            unit: unit.into(),
            t_s: self.t_s.clone(),
            values: values.to_vec(),
        };
        vec![
            series("kinetic_energy", "J", &self.kinetic_energy_j),
            series("bonds_intact_fraction", "1", &self.bonds_intact),
            series("plate_force", "N", &self.plate_force_n),
        ]
    }

    // Per fillet, numbered from 0; those that have not settled have no time.
    fn curves(&self) -> Vec<Curve> {
        let curve = |name: &str, unit: &str, of: &dyn Fn(&Fillet) -> Option<f64>| {
            let values = self.fillets.iter().enumerate().filter_map(|(i, f)| Some((i as f64, of(f)?)));
            let (x, values) = values.unzip();
            Curve {
                name: name.into(),
                unit: unit.into(),
                over: "fillet".into(),
                over_unit: "1".into(),
                x,
                values,
            }
        };
        vec![
            curve("bonds_intact_fraction", "1", &|fillet| Some(fillet.bonds_intact_fraction())),
            curve("settle_time", "s", &|fillet| fillet.settling.time_s()),
        ]
    }
}

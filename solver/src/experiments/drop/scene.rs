//! The scene of a drop: one plate per fillet, on a square grid.

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use crate::engine::scene::{BodyKind, Placement, Scene};
use crate::equipment::{Surface, SurfaceKind};
use crate::experiments::Setup;
use crate::experiments::placement::{height_over_plate, orientation, uniform};
use crate::scenario::{Drop, Scenario};

/// A fillet may slide for this long at the speed of its impact before it leaves its plate, in seconds.
const SLIDING_S: f64 = 0.1;
/// The plates are no farther apart than this, in metres, or positions would lose digits: at the default interval of samples
/// it stops all that is slower than 250 m/s.
const WIDEST_GAP_M: f64 = 1.0;
/// The domain holds at least this many plates in a row, so that it has the same fixed-point positions for up to the square of
/// that many fillets, and a fillet falls alike to the bit however many others there are.
const FEWEST_COLUMNS: u32 = 16;

/// The plates of the fillets, on a square grid about the origin.
#[derive(Clone, Copy, Debug)]
pub(super) struct Grid {
    columns: u32,
    rows: u32,
    /// Half the width of a plate, and the height of the room over it, in metres.
    room_m: f64,
    /// Distance of the plates' middles, in metres.
    pitch_m: f64,
}

impl Grid {
    pub(super) fn new(scenario: &Scenario, drop: &Drop, bounding_radius_m: f64) -> Self {
        let (numerics, radius_m) = (&scenario.numerics, scenario.product.radius_m());
        let count = scenario.product.count;
        let columns = f64::from(count).sqrt().ceil() as u32;
        // However it topples, a fillet ends within twice its reach.
        let room_m = 2.0 * (bounding_radius_m + radius_m) + SLIDING_S * drop.speed_m_s;
        // Parts that leave two plates towards each other between samples do not meet.
        let flight_m = numerics.speed_limit_m_s * numerics.output_interval_s;
        let pitch_m = 2.0 * room_m + (2.0 * flight_m).min(WIDEST_GAP_M) + 4.0 * radius_m;
        // In 64ths of a metre, which fixed-point positions hold exactly: all plates are alike to the bit.
        Self { columns, rows: count.div_ceil(columns), room_m, pitch_m: (32.0 * pitch_m).ceil() / 32.0 }
    }

    /// The middle of a plate, in metres.
    pub(super) fn middle(&self, fillet: usize) -> DVec3 {
        let (column, row) = (fillet as u32 % self.columns, fillet as u32 / self.columns);
        let along = |index: u32, count: u32| (f64::from(index) - f64::from(count - 1) / 2.0) * self.pitch_m;
        DVec3::new(along(column, self.columns), along(row, self.rows), 0.0)
    }

    /// Half the width of the domain, in metres.
    fn half_m(&self) -> f64 {
        f64::from(self.columns.max(FEWEST_COLUMNS)) * self.pitch_m / 2.0
    }

    /// Whether a place, relative to the middle of the plate, lies in the room over it.
    pub(super) fn holds(&self, x: DVec3) -> bool {
        let low = DVec3::splat(-self.room_m);
        x.cmpge(low).all() && x.cmple(-low).all()
    }
}

/// The maximum bounding radius of the kinds, in metres.
pub(super) fn bounding_radius_m(kinds: &[BodyKind]) -> f64 {
    kinds.iter().map(|kind| kind.meta.bounding_radius_m).fold(0.0, f64::max)
}

/// The scene of a drop scenario.
pub(super) fn scene(setup: &Setup, drop: &Drop) -> Scene {
    let (scenario, kinds) = (&setup.scenario, &setup.kinds);
    let radius_m = scenario.product.radius_m();
    let grid = Grid::new(scenario, drop, bounding_radius_m(kinds));
    let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
    let bodies: Vec<Placement> = setup
        .kind_of_each()
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
    Scene {
        surfaces: (0..bodies.len()).map(plate).collect(),
        low: -high,
        high,
        bodies,
        ..setup.empty_scene()
    }
}

/// The orientation asked for, each angle off by up to the scatter.
fn scattered(drop: &Drop, rng: &mut ChaCha8Rng) -> DQuat {
    let mut off = || drop.scatter_deg * (2.0 * uniform(rng) - 1.0);
    orientation([drop.yaw_deg + off(), drop.pitch_deg + off(), drop.roll_deg + off()])
}

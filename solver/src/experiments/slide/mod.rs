//! A fillet on a plate that is tilted until it slides (paper sections 2.3.2 and 3.2, Fig. 8): the critical angle.
//!
//! The fillet is set flat on a level plate and comes to rest; from t = 0 on the plate turns steadily about an axis across the slope,
//! in its surface under the fillet. The critical angle is the tilt at which sliding sets in for good, from the speed of the centre
//! of mass in the plate's own frame ([`crate::observe::SlidingDetector`]).
//!
//! Expected: atan μ within 3° for μ ≤ 0.5, linear in μ, the surface energy being negligible.

mod monitor;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::outputs::{BONDS_INTACT, BONDS_INTACT_FRACTION, KINETIC_ENERGY, boolean, number, series};
use super::placement::{height_over_plate, orientation, uniform};
use super::warnings::{WARNING_CODES, WARNING_COUNT};
use super::{Definition, Outputs, ResponseDefinition, SeriesRow, Setup};
use crate::engine::run::ExperimentMonitor;
use crate::engine::scene::{Placement, Scene};
use crate::equipment::{Motion, Surface, SurfaceKind};
use crate::scenario::{Numerics, Scenario, Slide};

/// Distance that the plate leaves for sliding, in metres.
const SLIDING_M: f64 = 0.5;
/// Margin of the domain around everything, in metres.
const MARGIN_M: f64 = 0.1;

#[rustfmt::skip]
const RESPONSES: &[ResponseDefinition] = &[
    number("critical_angle_deg", "°",
        "Tilt of the plate at which the fillet begins to slide and does not stop again. Rolling also counts as sliding. Null if the \
         fillet did not slide at any tilt up to `max_tilt_deg`.").headline(),
    number("friction_angle_deg", "°",
        "Tilt at which an ideal rigid block slides: atan μ. The coefficient of friction μ is \
         `/contact/fillet_equipment/static_friction`.").headline(),
    boolean("slid", "Whether the fillet slid. If the fillet did not slide, `critical_angle_deg` is null."),
    boolean("rolled_over",
        "Whether the fillet rolled over. A fillet has rolled over if, at any time, its upper side faced the plate."),
    BONDS_INTACT_FRACTION,
    WARNING_COUNT,
    WARNING_CODES,
];

const TILT_ANGLE: SeriesRow = series("tilt_angle", "°", "Tilt of the plate.");
#[rustfmt::skip]
const SLIDING_SPEED: SeriesRow = series("sliding_speed", "m/s",
    "Speed of the fillet's centre of mass down the plate, relative to the plate.").headline();
#[rustfmt::skip]
const DISPLACEMENT: SeriesRow = series("displacement", "m",
    "Distance that the fillet's centre of mass has moved down the plate since t = 0.").headline();

pub(super) const OUTPUTS: Outputs = Outputs {
    responses: RESPONSES,
    series: &[TILT_ANGLE, SLIDING_SPEED, DISPLACEMENT, KINETIC_ENERGY.headline(), BONDS_INTACT],
    curves: &[],
};

impl Definition for Slide {
    fn outputs(&self) -> &'static Outputs {
        &OUTPUTS
    }

    fn scene(&self, setup: &Setup) -> Scene {
        let (scenario, kind) = (&setup.scenario, &setup.kinds[0]);
        let radius_m = scenario.product.radius_m();
        let mut rng = ChaCha8Rng::seed_from_u64(scenario.seed);
        let yaw_deg = self.yaw_deg + self.scatter_deg * (2.0 * uniform(&mut rng) - 1.0);
        let orientation = orientation([yaw_deg, 0.0, 0.0]);
        let position = DVec3::Z * height_over_plate(kind, orientation, radius_m);
        let half_m = kind.meta.bounding_radius_m + radius_m + SLIDING_M;
        let corner = DVec3::new(-half_m, -half_m, 0.0);
        let (u, v) = (DVec3::X * 2.0 * half_m, DVec3::Y * 2.0 * half_m);
        let plate = Surface::parallelogram("plate", SurfaceKind::Equipment, corner, u, v);
        let domain = DVec3::splat(half_m + MARGIN_M);
        Scene {
            surfaces: vec![plate.moving(self.tilting())],
            low: -domain,
            high: domain,
            bodies: vec![Placement { kind: 0, position, orientation, velocity: DVec3::ZERO }],
            ..setup.empty_scene()
        }
    }

    fn monitor(&self, scenario: &Scenario, scene: &Scene) -> Box<dyn ExperimentMonitor> {
        Box::new(monitor::SlideMonitor::new(scenario, self, scene))
    }

    fn longest_fill_s(&self, numerics: &Numerics) -> f64 {
        numerics.max_fill_s
    }

    fn duration_s(&self, _numerics: &Numerics) -> f64 {
        self.max_tilt_deg / self.tilt_rate_deg_s
    }

    fn duration_field(&self, _numerics: &Numerics) -> (&'static str, f64) {
        ("/slide/tilt_rate_deg_s", self.tilt_rate_deg_s)
    }
}

impl Slide {
    /// The motion of the plate. The fillet's length points up the slope: +x rises.
    fn tilting(&self) -> Motion {
        let spin = DVec3::NEG_Y * self.tilt_rate_deg_s.to_radians();
        Motion::Moving { velocity: DVec3::ZERO, pivot: DVec3::ZERO, spin }
    }
}

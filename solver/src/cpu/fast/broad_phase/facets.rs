//! Twin of [`Walls::nearest_point`], bit for bit: nearest points of a facet in lanes.
//!
//! A sub-particle may therefore change between this path and the scalar one without a change of its bits.

use glam::{Mat3, Vec3};
use pulp::Simd;

use crate::cpu::fast::instructions::arrays::{Ints, Lanes, Lanes3, Quads, WIDTH, in_metres};
use crate::cpu::fast::instructions::lanes::{F, F3, Mask};
use crate::cpu::fast::instructions::set::LaneOps;
use crate::cpu::fast::instructions::transpose::{ints, three};
use crate::cpu::fast::storage::pair_lanes::PairKinematics;
use crate::engine::frame::Frame;
use crate::walls::{SurfacePose, Walls};

/// A facet of few triangles, in its current pose.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SmallFacet<'a> {
    triangles: &'a [[Vec3; 3]],
    normal: Vec3,
    pose: &'a SurfacePose,
}

/// Distances to a facet and heights over its plane, like those of [`crate::walls::NearestPoint`].
#[derive(Clone, Copy, Debug)]
pub(crate) struct FacetDistances {
    pub(crate) distance: Lanes,
    pub(crate) height: Lanes,
}

/// Nearest points of a facet, like [`crate::walls::NearestPoint`].
struct NearestPoints<S: Simd> {
    to_wall: F3<S>,
    distance: F<S>,
    height: F<S>,
    velocity: F3<S>,
}

/// A chunk of sub-particles near a facet.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ParticleLanes {
    /// Fixed-point position.
    position: [Ints; 3],
    /// In m/s.
    velocity: Lanes3,
    /// In rad/s.
    spin: Lanes3,
}

/// Offset to a facet that is out of range, in metres.
const FAR_AWAY: Vec3 = Vec3::splat(1e3);

impl ParticleLanes {
    /// From quads; positions are passed as bits.
    #[inline(always)]
    pub(crate) fn of<S: LaneOps>(simd: S, position: &Quads, velocity: &Quads, spin: &Quads) -> Self {
        let [x, y, z, _] = ints(simd, position);
        Self { position: [x, y, z], velocity: three(simd, velocity), spin: three(simd, spin) }
    }
}

impl<'a> SmallFacet<'a> {
    /// A facet of a run, if it has few triangles and no sliver.
    pub(crate) fn of(walls: &'a Walls, facet: u32) -> Option<Self> {
        let facet = &walls.facets()[facet as usize];
        let surface = &walls.surfaces()[facet.surface];
        let normal = facet.facet.normal;
        facet.facet.triangles_if_few().map(|triangles| Self { triangles, normal, pose: &surface.pose })
    }

    /// Kinematics of two chunks of sub-particles relative to the facet, and their distances. Facets beyond `reach` are moved far away. So are facets through a centre, which have no side.
    #[inline(always)]
    pub(crate) fn kinematics<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        [radius, reach]: [f32; 2],
        [a, b]: &[ParticleLanes; 2],
    ) -> ([PairKinematics; 2], [FacetDistances; 2]) {
        let mut kinematics = [PairKinematics::ZERO; 2];
        let mut distances = [FacetDistances { distance: Lanes::ZERO, height: Lanes::ZERO }; 2];
        let one = in_metres(&a.position, self.pose.anchor, frame.unit_m);
        let two = in_metres(&b.position, self.pose.anchor, frame.unit_m);
        let spin = F3::splat(simd, self.pose.spin * 2.0);
        for part in 0..WIDTH / S::F32_LANES {
            let points = self.nearest_points(simd, F3::load(simd, [&one, &two], part));
            let NearestPoints { to_wall, distance, height, velocity } = points;
            let mine = F3::load(simd, [&a.velocity, &b.velocity], part);
            let my_spin = F3::load(simd, [&a.spin, &b.spin], part);
            let near = F::splat(simd, -reach).le(F::splat(simd, radius) - distance);
            let in_contact = near & F::splat(simd, 0.0).lt(distance);
            let [one, two] = &mut kinematics;
            in_contact
                .select3(to_wall, F3::splat(simd, FAR_AWAY))
                .store([&mut one.offset, &mut two.offset], part);
            let against = velocity - mine - my_spin.cross_unfused(to_wall);
            against.store([&mut one.velocity, &mut two.velocity], part);
            spin.store([&mut one.spin, &mut two.spin], part);
            let [one, two] = &mut distances;
            distance.store([&mut one.distance, &mut two.distance], part);
            height.store([&mut one.height, &mut two.height], part);
        }
        (kinematics, distances)
    }

    /// Distances of two chunks of sub-particles at fixed-point positions, in metres.
    #[inline(always)]
    pub(crate) fn distances<S: Simd>(
        &self,
        simd: S,
        frame: &Frame,
        positions: [&[Ints; 3]; 2],
    ) -> [Lanes; 2] {
        let a = in_metres(positions[0], self.pose.anchor, frame.unit_m);
        let b = in_metres(positions[1], self.pose.anchor, frame.unit_m);
        let [mut one, mut two] = [Lanes::ZERO; 2];
        for part in 0..WIDTH / S::F32_LANES {
            let points = self.nearest_points(simd, F3::load(simd, [&a, &b], part));
            points.distance.store([&mut one, &mut two], part);
        }
        [one, two]
    }

    /// Nearest points to positions relative to the anchor, in metres.
    #[inline(always)]
    fn nearest_points<S: Simd>(&self, simd: S, relative: F3<S>) -> NearestPoints<S> {
        let SurfacePose { turn, velocity, spin, .. } = *self.pose;
        let p = rotated(simd, turn.transpose(), relative);
        let mut local = F3::zero(simd);
        let mut nearest2 = F::splat(simd, f32::INFINITY);
        for triangle in self.triangles {
            let q = nearest_on_triangle(simd, p, triangle);
            let d2 = (p - q).length2_unfused();
            let nearer = d2.lt(nearest2);
            local = nearer.select3(q, local);
            nearest2 = nearer.select(d2, nearest2);
        }
        let d = local - p;
        NearestPoints {
            to_wall: rotated(simd, turn, d),
            distance: d.length2_unfused().sqrt(),
            height: F::splat(simd, 0.0) - F3::splat(simd, self.normal).dot_unfused(d),
            velocity: F3::splat(simd, velocity)
                + F3::splat(simd, spin).cross_unfused(rotated(simd, turn, local)),
        }
    }
}

/// Matrix times vectors.
#[inline(always)]
fn rotated<S: Simd>(simd: S, by: Mat3, v: F3<S>) -> F3<S> {
    let [x, y, z] = v.parts();
    F3::splat(simd, by.x_axis) * x + F3::splat(simd, by.y_axis) * y + F3::splat(simd, by.z_axis) * z
}

/// Twin of [`crate::mesh::nearest::nearest_on_triangle`]. Its regions are tested from last to first; each
/// yields a point, a direction, and a quotient along the direction.
#[inline(always)]
fn nearest_on_triangle<S: Simd>(simd: S, p: F3<S>, &[a, b, c]: &[Vec3; 3]) -> F3<S> {
    let (ab, ac, bc) = (b - a, c - a, c - b);
    let normal = ab.cross(ac);
    let at = |v: Vec3| F3::splat(simd, v);
    let (zero, one) = (F::splat(simd, 0.0), F::splat(simd, 1.0));
    let (ap, bp, cp) = (p - at(a), p - at(b), p - at(c));
    let (along, across) = (at(ab), at(ac));
    let (d1, d3, d5) = (along.dot_unfused(ap), along.dot_unfused(bp), along.dot_unfused(cp));
    let (d2, d4, d6) = (across.dot_unfused(ap), across.dot_unfused(bp), across.dot_unfused(cp));
    let (va, vb, vc) = (d3 * d6 - d5 * d4, d5 * d2 - d1 * d6, d1 * d4 - d3 * d2);
    let (towards_c, towards_b) = (d4 - d3, d5 - d6);
    let mut found = Along {
        from: p,
        way: -at(normal),
        numerator: at(normal).dot_unfused(ap),
        denominator: F::splat(simd, normal.dot(normal)),
    };
    found.take(
        va.le(zero) & zero.le(towards_c) & zero.le(towards_b),
        Along { from: at(b), way: at(bc), numerator: towards_c, denominator: towards_c + towards_b },
    );
    found.take(
        vb.le(zero) & zero.le(d2) & d6.le(zero),
        Along { from: at(a), way: at(ac), numerator: d2, denominator: d2 - d6 },
    );
    let corner =
        |corner: Vec3| Along { from: at(corner), way: F3::zero(simd), numerator: zero, denominator: one };
    found.take(zero.le(d6) & d5.le(d6), corner(c));
    found.take(
        vc.le(zero) & zero.le(d1) & d3.le(zero),
        Along { from: at(a), way: at(ab), numerator: d1, denominator: d1 - d3 },
    );
    found.take(zero.le(d3) & d4.le(d3), corner(b));
    found.take(d1.le(zero) & d2.le(zero), corner(a));
    found.from + found.way * (found.numerator / found.denominator)
}

/// Points along directions: `from` + `way` · `numerator` / `denominator`.
struct Along<S: Simd> {
    from: F3<S>,
    way: F3<S>,
    numerator: F<S>,
    denominator: F<S>,
}

impl<S: Simd> Along<S> {
    #[inline(always)]
    fn take(&mut self, mask: Mask<S>, other: Self) {
        self.from = mask.select3(other.from, self.from);
        self.way = mask.select3(other.way, self.way);
        self.numerator = mask.select(other.numerator, self.numerator);
        self.denominator = mask.select(other.denominator, self.denominator);
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;
    use pulp::Scalar;
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};
    use serde_json::json;

    use super::*;
    use crate::check::scene_of;
    use crate::engine::scene::Scene;
    use crate::equipment::{Motion, Surface, SurfaceKind};
    use crate::scenario::from_value;

    #[test]
    fn vectorised_facet_kinematics_equal_the_scalar_nearest_point_bit_for_bit() {
        let (u, v) = (DVec3::new(0.05, 0.02, 0.0), DVec3::new(-0.01, 0.04, 0.01));
        let motion =
            Motion::Moving { velocity: DVec3::X * 0.3, pivot: DVec3::new(0.3, 0.2, 0.1), spin: DVec3::ONE };
        let plate = Surface::parallelogram("plate", SurfaceKind::Equipment, DVec3::ZERO, u, v).moving(motion);
        let drop = from_value(&json!({"experiment": "drop"})).expect("a scenario");
        let scene = Scene { surfaces: vec![plate], ..scene_of(&drop) };
        let frame = Frame::new(DVec3::splat(-0.5), DVec3::splat(0.5), false);
        let mut walls = Walls::new(&scene, &frame);
        walls.pose(Some(0.4), &frame);
        let facet = SmallFacet::of(&walls, 0).expect("two triangles");
        let mut random = ChaCha8Rng::seed_from_u64(1);
        let mut draw = |from: f64, to: f64| from + (to - from) * f64::from(random.next_u32()) / 2f64.powi(32);
        let normal = facet.pose.turn * walls.facets()[0].facet.normal;
        let mut inside = 0;
        for _ in 0..20_000 {
            // Above its interior, beyond its edges and beyond its corners.
            let local = u * draw(-0.5, 1.5) + v * draw(-0.5, 1.5) + DVec3::Z * draw(-0.01, 0.01);
            let pose = facet.pose;
            let x = pose.anchor
                + frame.encode(frame.origin + (pose.turn.as_dmat3() * (local - DVec3::new(0.3, 0.2, 0.1))));
            let expected = walls.nearest_point(0, x, &frame);
            let seers = ParticleLanes {
                position: [0, 1, 2].map(|axis| Ints([x[axis]; WIDTH])),
                velocity: [Lanes::ZERO; 3],
                spin: [Lanes::ZERO; 3],
            };
            let (kinematics, distances) = facet.kinematics(Scalar::new(), &frame, [1.0, 0.0], &[seers; 2]);
            let of = |lanes: &Lanes3| Vec3::new(lanes[0].0[3], lanes[1].0[3], lanes[2].0[3]);
            assert_eq!(of(&kinematics[1].offset), expected.to_wall, "{local}");
            assert_eq!(of(&kinematics[1].velocity), expected.velocity, "{local}");
            assert_eq!(of(&kinematics[1].spin), expected.spin * 2.0, "{local}");
            assert_eq!(distances[1].distance.0[3], expected.distance, "{local}");
            assert_eq!(distances[1].height.0[3], expected.height, "{local}");
            inside += u32::from(expected.to_wall.dot(normal).abs() > 0.9999 * expected.distance);
        }
        assert!((2_000..18_000).contains(&inside), "{inside}");
    }
}

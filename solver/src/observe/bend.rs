//! Bend angle of a fillet: the rotation of its centre line's tangent from end to end (paper Fig. 7, section
//! 3.4).
//!
//! The tangent of a cross-section is the mean direction of the material that lay along the length (x) before
//! bending: from each sub-particle to the next in its row of the lattice. The bend angle lies between the
//! mean tangents of the two outermost tenths of the length, thin tips excluded.
//!
//! A flat fillet has 0° in any orientation, a folded one 180°. An S counts as the difference of its ends. An
//! evenly bent fillet reads a tenth to a quarter less than the arc between its tips.

use std::collections::BTreeMap;

use glam::DVec3;

/// Share of the length over which the tangent of an end is averaged.
const END_SHARE: f64 = 0.1;
/// Cross-sections with fewer sub-particles than this share of the largest belong to a tip.
const MIN_SECTION_SHARE: f64 = 0.25;

/// Measures the bend angle of bodies of one shape.
#[derive(Clone, Debug)]
pub struct BendGauge {
    /// In the outermost tenths of the length: the first of each pair of neighbours in a row.
    ends: [Vec<usize>; 2],
}

impl BendGauge {
    /// For bodies with sub-particles at `reference` in metres, about any origin, with the length along x and
    /// sorted by z, y, x ([`crate::shape::lattice::MetaParticle::points`]).
    pub fn new(reference: &[DVec3]) -> Self {
        let follows = |(i, pair): (usize, &[DVec3])| {
            let d = pair[1] - pair[0];
            let is_next = d.x > 0.0 && d.truncate().with_x(d.z).length() < 1e-3 * d.x;
            is_next.then(|| (i, (pair[0].x + pair[1].x) / 2.0))
        };
        let along = without_tips(reference.windows(2).enumerate().filter_map(follows).collect());
        let low = along.iter().map(|(_, x)| *x).fold(f64::INFINITY, f64::min);
        let high = along.iter().map(|(_, x)| *x).fold(f64::NEG_INFINITY, f64::max);
        // A slightly larger share, so that rounding excludes no sub-particle of a lattice layer.
        let end = (END_SHARE + 1e-6) * (high - low);
        let those = |inside: &dyn Fn(f64) -> bool| {
            along.iter().filter(|(_, x)| inside(*x)).map(|(i, _)| *i).collect()
        };
        Self { ends: [those(&|x| x <= low + end), those(&|x| x >= high - end)] }
    }

    /// Bend angle in degrees, 0 to 180. `step(i)` is the vector from the `i`th sub-particle to the next, in
    /// any unit. `None` where no two sub-particles lie along the length, or an end has no direction.
    pub fn angle_deg(&self, step: impl Fn(usize) -> DVec3) -> Option<f64> {
        let tangent = |end: &[usize]| end.iter().map(|&i| step(i)).sum::<DVec3>().try_normalize();
        let [blunt, tail] = &self.ends;
        let (blunt, tail) = (tangent(blunt)?, tangent(tail)?);
        // More accurate than the arc cosine near 0 and 180°.
        Some(blunt.cross(tail).length().atan2(blunt.dot(tail)).to_degrees())
    }
}

/// The part between the outermost cross-sections of at least [`MIN_SECTION_SHARE`] of the largest. Thinner
/// ends are chains of single sub-particles. They hinge freely at every bond and do not show the bend of the
/// body.
fn without_tips(mut along: Vec<(usize, f64)>) -> Vec<(usize, f64)> {
    let section = |x: f64| (x * 1e7).round() as i64;
    let mut sizes: BTreeMap<i64, usize> = BTreeMap::new();
    along.iter().for_each(|(_, x)| *sizes.entry(section(*x)).or_default() += 1);
    let largest = sizes.values().copied().max().unwrap_or(0) as f64;
    let sound =
        || sizes.iter().filter(|(_, size)| **size as f64 >= MIN_SECTION_SHARE * largest).map(|(x, _)| *x);
    if let (Some(first), Some(last)) = (sound().min(), sound().max()) {
        along.retain(|(_, x)| (first..=last).contains(&section(*x)));
    }
    along
}

#[cfg(test)]
mod tests {
    use std::f64::consts::PI;

    use glam::DQuat;

    use super::*;

    /// Bend angle of one body with sub-particles at `reference`, now at `current`, in the same order.
    fn bend_angle_deg(reference: &[DVec3], current: &[DVec3]) -> Option<f64> {
        BendGauge::new(reference).angle_deg(|i| current[i + 1] - current[i])
    }
    use crate::scenario::Fill;
    use crate::shape::lattice::MetaParticle;
    use crate::shape::teardrop::Teardrop;

    const SIZE_M: [f64; 3] = [0.172, 0.072, 0.032];

    fn fillet(radius: f64) -> Vec<DVec3> {
        MetaParticle::fill(&Teardrop { size_m: SIZE_M, mirrored: false }, radius, Fill::Centres, 1).points
    }

    /// The points bent to an arc of `radius` metres about the y axis, plane sections staying plane.
    fn bent(points: &[DVec3], radius: f64) -> Vec<DVec3> {
        let bend = |p: &DVec3| {
            let (sin, cos) = (p.x / radius).sin_cos();
            DVec3::new((radius + p.z) * sin, p.y, (radius + p.z) * cos)
        };
        points.iter().map(bend).collect()
    }

    #[test]
    fn flat_fillet_has_no_bend_angle_in_any_orientation() {
        for radius in [0.003, 0.004, 0.009] {
            let flat = fillet(radius);
            let turn = DQuat::from_scaled_axis(DVec3::new(0.3, -1.1, 0.7));
            let moved: Vec<DVec3> = flat.iter().map(|&p| turn * p + DVec3::ONE).collect();
            assert!(bend_angle_deg(&flat, &moved).unwrap() < 1e-9, "R = {radius}");
        }
    }

    #[test]
    fn bend_angle_of_an_arc_is_measured_between_its_outer_tenths() {
        for (radius, arc) in [(0.002, 0.05), (0.002, 0.2), (0.004, 0.08)] {
            let flat = fillet(radius);
            // Between the outermost rows' middles; the outermost layers hold few sub-particles, so the means lie further in.
            let (low, high) = flat.iter().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p.x), b.max(p.x)));
            let whole = ((high - low - 2.0 * radius) / arc).to_degrees();
            let found = bend_angle_deg(&flat, &bent(&flat, arc)).unwrap();
            assert!((0.7..0.95).contains(&(found / whole)), "{found} of {whole}");
        }
    }

    #[test]
    fn dangling_tip_does_not_change_the_bend_angle() {
        let flat = fillet(0.004);
        let tip = flat.iter().map(|p| p.x).fold(f64::MIN, f64::max);
        let dangle = |p: &DVec3| if p.x > tip - 0.004 { *p + DVec3::new(-0.008, 0.0, -0.008) } else { *p };
        let dangling: Vec<DVec3> = flat.iter().map(dangle).collect();
        assert_ne!(flat, dangling);
        assert!(bend_angle_deg(&flat, &dangling).unwrap() < 1e-9);
    }

    #[test]
    fn folded_fillet_has_a_bend_angle_of_180_degrees() {
        // Straight legs, and between them a half circle of 1 cm about x = 0.
        let flat = fillet(0.002);
        let half = PI * 0.01 / 2.0;
        let fold = |p: &DVec3| {
            let turn = DQuat::from_rotation_y(p.x.clamp(-half, half) / 0.01);
            let leg = p.x - p.x.clamp(-half, half);
            turn * DVec3::new(leg, p.y, 0.01 + p.z)
        };
        let folded: Vec<DVec3> = flat.iter().map(fold).collect();
        let found = bend_angle_deg(&flat, &folded).unwrap();
        assert!((found - 180.0).abs() < 1e-6, "{found}");
    }

    #[test]
    fn bend_angle_of_an_s_shape_is_the_difference_of_its_end_slopes() {
        let flat = fillet(0.003);
        let wave = |p: &DVec3| DVec3::new(p.x, p.y, p.z + 0.02 * (p.x * 40.0).sin());
        let found = bend_angle_deg(&flat, &flat.iter().map(wave).collect::<Vec<_>>()).unwrap();
        let slope = |x: f64| (0.8 * (x * 40.0).cos()).atan().to_degrees();
        let (low, high) = flat.iter().fold((f64::MAX, f64::MIN), |(a, b), p| (a.min(p.x), b.max(p.x)));
        let ends = |share: f64| {
            let inwards = share * (high - low);
            (slope(low + inwards) - slope(high - inwards)).abs()
        };
        let (a, b) = (ends(0.02), ends(0.1));
        assert!((a.min(b)..=a.max(b)).contains(&found), "{found} is not between {a} and {b}");
    }

    #[test]
    fn body_without_length_has_no_bend_angle() {
        let column = [DVec3::ZERO, DVec3::Z, DVec3::Z * 2.0];
        assert_eq!(bend_angle_deg(&column, &column), None);
        assert_eq!(bend_angle_deg(&[], &[]), None);
        let askew = [DVec3::ZERO, DVec3::ONE];
        assert_eq!(bend_angle_deg(&askew, &askew), None, "of two rows");
        let pair = [DVec3::ZERO, DVec3::X];
        assert_eq!(bend_angle_deg(&pair, &[DVec3::ONE; 2]), None);
        assert_eq!(bend_angle_deg(&pair, &pair), Some(0.0));
    }
}

//! The surface of a fillet: an asymmetric teardrop inscribed in the box of Table 1.
//!
//! The paper's meshes are not public. Its sizes are, and so is the mass: 191 fillets weigh 38.21 kg.
//!
//! Let s run from 0 (blunt end) to 1 (tail) along the length L. The cross-section at s is two half ellipses
//! that meet at y = 0. Their half widths are W/2 · p(s; ½, 0.6) for y > 0 and W/2 · p(s; ½, 1) for y < 0.
//! Their common half thickness is T/2 · p(s; ½, 0.6). Here p(s; a, b) = s^a (1 − s)^b, scaled to a maximum of
//! 1.
//!
//! The surface touches all six sides of its box and fills 48.66 % of it: 191 fillets at 940 kg/m³ weigh 38.35
//! kg.

use glam::DVec3;

use super::Shape;

/// Exponents of the profile on the right (y > 0) side.
const RIGHT: (f64, f64) = (0.5, 0.6);
/// Exponents of the profile on the left (y < 0) side.
const LEFT: (f64, f64) = (0.5, 1.0);
/// Exponents of the thickness profile.
const THICKNESS: (f64, f64) = (0.5, 0.6);

/// A teardrop with its origin at the centre of its box: length along x, width along y, thickness along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Teardrop {
    /// Length, width and thickness, in metres.
    pub size_m: [f64; 3],
    /// Mirrored in y.
    pub mirrored: bool,
}

/// s^a (1 − s)^b, scaled to a maximum of 1.
fn profile((a, b): (f64, f64), s: f64) -> f64 {
    let peak = a / (a + b);
    (s / peak).powf(a) * ((1.0 - s) / (1.0 - peak)).powf(b)
}

impl Shape for Teardrop {
    fn size_m(&self) -> DVec3 {
        DVec3::from(self.size_m)
    }

    fn contains(&self, point: DVec3) -> bool {
        let [length, width, thickness] = self.size_m;
        let s = point.x / length + 0.5;
        if !(0.0..=1.0).contains(&s) {
            return false;
        }
        let y = if self.mirrored { -point.y } else { point.y };
        let half_width = width / 2.0 * profile(if y > 0.0 { RIGHT } else { LEFT }, s);
        let half_thickness = thickness / 2.0 * profile(THICKNESS, s);
        let (v, w) = (y / half_width, point.z / half_thickness);
        v * v + w * w <= 1.0
    }

    /// L · π/2 · W/2 · T/2 · ∫ thickness (left + right) ds, by the midpoint rule.
    fn volume_m3(&self) -> f64 {
        let [length, width, thickness] = self.size_m;
        let n = 20_000;
        let integral: f64 = (0..n)
            .map(|k| (f64::from(k) + 0.5) / f64::from(n))
            .map(|s| profile(THICKNESS, s) * (profile(LEFT, s) + profile(RIGHT, s)))
            .sum();
        length * width * thickness * std::f64::consts::PI / 8.0 * integral / f64::from(n)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn load_of_the_paper_has_the_published_mass() {
        let sizes = [[0.144, 0.072, 0.040], [0.172, 0.072, 0.032], [0.176, 0.072, 0.040]];
        let mass: f64 = (0..191)
            .map(|i| Teardrop { size_m: sizes[i % 6 / 2], mirrored: i % 2 == 1 }.volume_m3() * 940.0)
            .sum();
        assert!((mass / 38.21 - 1.0).abs() < 0.01, "191 fillets weigh {mass} kg");
    }

    #[test]
    fn teardrop_volume_agrees_with_counting_points() {
        let shape = Teardrop { size_m: [0.144, 0.072, 0.040], mirrored: false };
        let (nx, ny, nz) = (144, 72, 40);
        let mut inside = 0;
        for i in 0..nx * ny * nz {
            let cell = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
            let point = (cell + 0.5) * 1e-3 - DVec3::new(0.072, 0.036, 0.020);
            inside += usize::from(shape.contains(point));
        }
        let counted = inside as f64 * 1e-9;
        assert!((counted / shape.volume_m3() - 1.0).abs() < 5e-3, "{counted} {}", shape.volume_m3());
    }

    #[test]
    fn mirrored_teardrop_is_the_mirror_image_and_differs_from_the_original() {
        let shape = Teardrop { size_m: [0.144, 0.072, 0.040], mirrored: false };
        let mirror = Teardrop { mirrored: true, ..shape };
        let mut differ = 0;
        for i in 0..1000 {
            let y = (f64::from(i) + 0.5) / 1000.0 * 0.072 - 0.036;
            let point = DVec3::new(0.03, y, 0.0);
            assert_eq!(shape.contains(point), mirror.contains(point * DVec3::new(1.0, -1.0, 1.0)));
            differ += usize::from(shape.contains(point) != mirror.contains(point));
        }
        assert!(differ > 20, "an asymmetric shape differs from its mirror image");
    }
}

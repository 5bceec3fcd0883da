//! Surfaces as CAD programs cut them: a plate, caps and pipes of many triangles, and places drawn at random.
#![allow(dead_code, unreachable_pub, reason = "each test binary uses some of these")]

use glam::{DQuat, DVec3, EulerRot};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::equipment::facet::facets;
use roost_solver::equipment::{Motion, Presence, Surface, SurfaceKind};

use crate::stl::{Triangle, grid, moved, quad, turned};

pub fn surface(triangles: Vec<Triangle>) -> Surface {
    Surface {
        name: "from a file".into(),
        kind: SurfaceKind::Equipment,
        friction: None,
        motion: Motion::Fixed,
        presence: Presence::Always,
        closed: None,
        triangles,
    }
}

pub struct Draw(ChaCha8Rng);

impl Draw {
    pub fn new(seed: u64) -> Self {
        Self(ChaCha8Rng::seed_from_u64(seed))
    }

    pub fn share(&mut self) -> f64 {
        f64::from(self.0.next_u32()) / f64::from(u32::MAX)
    }

    pub fn within(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.share()
    }
}

/// The square of 20 cm about the origin in the plane z = 0, cut at random places into 1000 triangles, slivers among them.
pub fn cut_plate() -> Vec<Triangle> {
    let mut draw = Draw::new(1);
    let mut triangles = quad(DVec3::new(-0.1, -0.1, 0.0), DVec3::X * 0.2, DVec3::Y * 0.2).to_vec();
    while triangles.len() < 1000 {
        let area = |[a, b, c]: &Triangle| (b - a).cross(c - a).length();
        let largest =
            (0..triangles.len()).max_by(|&i, &j| area(&triangles[i]).total_cmp(&area(&triangles[j])));
        let [a, b, c] = triangles.swap_remove(largest.unwrap());
        let (u, v) = (draw.within(0.1, 0.8), draw.share());
        let p = a + (b - a) * u * (1.0 - v) + (c - a) * u * v;
        triangles.extend([[a, b, p], [b, c, p], [c, a, p]]);
    }
    triangles
}

/// How a plate lies that is nowhere along the axes.
pub fn tilt() -> (DQuat, DVec3) {
    (DQuat::from_euler(EulerRot::ZYX, 0.7, 0.4, -1.1), DVec3::new(0.31, -0.22, 0.17))
}

/// The cut plate, tilted, as a file has it: in millimetres rounded to `f32`. No two of its triangles lie in quite one
/// plane, and some not in nearly one.
pub fn tilted_plate() -> Vec<Triangle> {
    let (turn, at) = tilt();
    let plate = moved(&cut_plate(), |p| ((turn * p + at) * 1e3).as_vec3().as_dvec3() * 1e-3);
    let pieces = facets(&plate, at).len();
    assert!(pieces > 20, "{pieces} facets");
    plate
}

/// A part of a ball about the origin of radius `r`, round +z, of `n`² · 2 triangles within 12° of it.
pub fn cap(r: f64, n: usize) -> Vec<Triangle> {
    let side = |i: usize| (i as f64 / n as f64 - 0.5) * 0.3;
    grid(n, n, |i, j| DVec3::new(side(i), side(j), 1.0).normalize() * r)
}

/// A pipe of that radius along y, of `n` facets, from −5 to 5 cm: from angle `from` on, `n` steps of `step`.
pub fn pipe(r: f64, n: usize, from: f64, step: f64) -> Vec<Triangle> {
    let at = |i: usize, j: usize| {
        let angle = from + i as f64 * step;
        DVec3::new(r * angle.cos(), 0.1 * j as f64 - 0.05, r * angle.sin())
    };
    grid(n, 1, at)
}

/// Two parallel squares of 20 cm, x = 0 and x = `width`, as one surface. `is_turned`: with opposite normals.
pub fn slot(width: f64, is_turned: bool) -> Vec<Triangle> {
    let sheet = |x: f64| quad(DVec3::new(x, -0.1, -0.1), DVec3::Y * 0.2, DVec3::Z * 0.2);
    let far = sheet(width);
    [sheet(0.0).to_vec(), if is_turned { turned(&far) } else { far.to_vec() }].concat()
}

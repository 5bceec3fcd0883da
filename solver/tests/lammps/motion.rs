//! The motions of LAMMPS' runs, carried out by the solver: collisions, and surfaces rubbed out and back.
#![allow(unreachable_pub, reason = "a module of one test")]

use glam::{DVec3, Vec3};
use roost_solver::engine::Backend;
use roost_solver::engine::scene::Scene;
use roost_solver::equipment::{Surface, SurfaceKind};
use roost_solver::physics::contact::{self, ContactHistory, ContactLaw};
use roost_solver::physics::damping::BODY_CAP;

use crate::common::{Bench, MASS, RADIUS, at, block, law, scene};
use crate::curve::{Curve, Table};

/// The partner of a sphere in a contact.
#[derive(Clone, Copy, PartialEq)]
pub enum Against {
    Sphere,
    Wall,
}

pub use Against::{Sphere, Wall};

impl Against {
    /// As the tables' names have it.
    pub fn name(self) -> &'static str {
        if self == Sphere { "pair" } else { "wall" }
    }

    pub fn law(self, restitution: f64, mu: f64, gamma: f64) -> ContactLaw {
        law(self == Wall, restitution, mu, gamma)
    }

    pub fn r_star(self) -> f64 {
        if self == Sphere { RADIUS / 2.0 } else { RADIUS }
    }

    /// Distance of the centre from the other's, or from the wall, at touch.
    fn touch(self) -> f64 {
        if self == Sphere { 2.0 * RADIUS } else { RADIUS }
    }
}

/// The plate x = 0. No diagonal of it runs under the sphere: there the nearest point is only sure to a nanometre.
fn wall() -> Surface {
    let (corner, size) = (DVec3::new(0.0, -0.004, -0.016), 0.02);
    Surface::parallelogram("wall", SurfaceKind::Equipment, corner, DVec3::Y * size, DVec3::Z * size)
}

/// One moment of a collision.
pub struct Moment {
    pub overlap: f64,
    /// Of the first sphere against the other or the wall.
    pub velocity: DVec3,
    /// Of the first sphere, about z.
    pub spin: f64,
    /// On the first sphere, along x.
    pub force: f64,
}

/// A free collision through the whole engine, from `gap` metres apart. `velocity` is that of the first sphere against
/// the other or the wall.
pub fn collide(
    against: Against,
    law: ContactLaw,
    gap: f64,
    velocity: DVec3,
    dt: f64,
    steps: u64,
) -> Vec<Moment> {
    let x = DVec3::X * (against.touch() + gap);
    let mut scene = scene(block([1, 1, 1]), vec![], dt);
    if against == Sphere {
        scene.bodies = vec![at(x / 2.0, velocity / 2.0), at(x / -2.0, velocity / -2.0)];
    } else {
        scene.bodies = vec![at(x, velocity)];
        scene.surfaces = vec![wall()];
    }
    (scene.laws.tissue, scene.laws.equipment) = (law, law);
    let mut bench = Bench::new(&scene);
    let relative = |bench: &mut Bench, of: fn(&mut Bench, usize) -> DVec3| {
        of(bench, 0) - if against == Sphere { of(bench, 1) } else { DVec3::ZERO }
    };
    let spin = |bench: &mut Bench| f64::from(bench.state().particles[0].spin.z);
    let moment = |_| {
        let overlap = against.touch() - relative(&mut bench, Bench::position).length();
        let (velocity, turning) = (relative(&mut bench, Bench::velocity), spin(&mut bench));
        let before = bench.velocity(0).x;
        assert_eq!(bench.steps(1), None);
        // Velocities are known half a step before the position, and half a step after.
        let velocity = (velocity + relative(&mut bench, Bench::velocity)) / 2.0;
        let turning = (turning + spin(&mut bench)) / 2.0;
        Moment { overlap, velocity, spin: turning, force: (bench.velocity(0).x - before) * MASS / dt }
    };
    (0..steps).map(moment).collect()
}

/// The force on a sphere, along x and along y, over the length of its way along y: out, and back past the start.
#[derive(Default)]
pub struct Rub {
    pub normal: Curve,
    pub tangential: Curve,
}

impl Rub {
    /// As LAMMPS has it.
    pub fn read(name: &str) -> Self {
        let table = Table::read(name);
        let (normal, tangential) = (table.column("normal_n"), table.column("tangential_n"));
        let (mut rub, mut path, mut last) = (Self::default(), 0.0, 0.0);
        for (k, moved) in table.column("moved_m").into_iter().enumerate() {
            path += f64::abs(moved - last);
            last = moved;
            rub.push(path, DVec3::new(normal[k], tangential[k], 0.0));
        }
        rub
    }

    fn push(&mut self, path: f64, force: DVec3) {
        self.normal.push((path, force.x));
        self.tangential.push((path, force.y));
    }
}

/// Rubs a sphere on the wall, through the whole engine: thrown along it by one that is too heavy for the contact to slow it, and
/// pulled back by a gravity along the wall, by `way` to either side of where it began.
pub fn rub_wall(law: ContactLaw, overlap: f64, way: f64) -> Rub {
    const STEPS: u32 = 4000;
    let dt = 1.0 / f64::from(STEPS);
    // In one second: back at the start after 2/(1 + √2) of it, and by `way` beyond at the end.
    let speed = 2.0 * way * (1.0 + 2f64.sqrt());
    let pull = speed * (1.0 + 2f64.sqrt());
    let mut kind = block([1, 1, 1]);
    kind.subparticle_mass_kg = 1e6;
    // The speed of each step is that of its middle.
    let body = at(DVec3::X * (RADIUS - overlap), DVec3::Y * (speed - pull * dt / 2.0));
    let (low, high) = (DVec3::splat(-0.02), DVec3::splat(0.02));
    let mut scene = Scene { low, high, surfaces: vec![wall()], ..scene(kind, vec![body], dt) };
    scene.gravity = DVec3::NEG_Y * pull;
    scene.laws.equipment = law;
    let mut bench = Bench::new(&scene);
    let (mut path, mut rub) = (0.0, Rub::default());
    for _ in 0..STEPS {
        // The force of a step depends on the speed before it.
        path += bench.velocity(0).y.abs() * dt;
        assert_eq!(bench.steps(1), None);
        rub.push(path, -bench.cpu.surface_forces(&mut bench.run)[0]);
    }
    rub
}

/// Rubs sphere 1 past sphere 2, which is at the origin, on the straight way of LAMMPS' run. No scene makes a pair do that:
/// here the contact stands alone.
pub fn rub_pair(law: ContactLaw, overlap: f64, way: f64) -> Rub {
    let (steps, dt) = (1000, 1e-4);
    let step = way / f64::from(steps);
    let m_star = MASS as f32 / 2.0;
    let (mut y, mut history, mut rub) = (0.0, ContactHistory::default(), Rub::default());
    for k in 1..=3 * steps {
        let moved = if k <= steps { step } else { -step };
        y += moved;
        let to_other = -DVec3::new(2.0 * RADIUS - overlap, y, 0.0);
        let delta = 2.0 * RADIUS - to_other.length();
        let (n, v) = (to_other.normalize().as_vec3(), Vec3::Y * (moved / dt) as f32);
        let force =
            contact::force(&law, &mut history, n, delta as f32, v, Vec3::ZERO, m_star, BODY_CAP, dt as f32);
        let force = force.expect("touches");
        rub.push(f64::from(k) * step, (force.normal + force.tangential).as_dvec3());
    }
    rub
}

//! The state of a run, as observers read it: positions and motion of all sub-particles.

use glam::{DVec3, IVec3, Vec3};
use serde::{Deserialize, Serialize};

use super::frame::Frame;
use super::scene::{Placement, Scene};

/// The part of a sub-particle that changes every step and that neighbours read, kept together for locality.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Particle {
    /// Fixed-point position.
    pub position: IVec3,
    /// Velocity, in m/s.
    pub velocity: Vec3,
    /// Angular velocity, in rad/s.
    pub spin: Vec3,
}

/// All sub-particles, body by body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct State {
    /// The coordinate frame of positions.
    pub frame: Frame,
    /// Radius of every sub-particle, in metres.
    pub radius_m: f32,
    /// Position, velocity and spin.
    pub particles: Vec<Particle>,
    /// Fraction of a unit that positions have moved beyond integer units, in units.
    pub remainders: Vec<Vec3>,
    /// Mass, in kilograms.
    pub masses: Vec<f32>,
    /// Number of the body of each sub-particle, ascending.
    pub bodies: Vec<u32>,
    /// Serial number within the run, ascending. It persists when others are removed.
    pub serials: Vec<u32>,
    /// Whether a sub-particle is clamped: forces act on it, but it does not move.
    pub held: Vec<bool>,
    /// Bonds broken so far between it and sub-particles of higher index.
    pub broken: Vec<u32>,
    /// Bonds of all bodies that have entered.
    pub bonds_at_start: u64,
    /// Bonds broken so far. A body that leaves takes its bonds along unbroken.
    pub bonds_broken: u64,
}

impl State {
    /// A state of a scene without sub-particles.
    pub(crate) fn empty(scene: &Scene) -> Self {
        Self {
            frame: Frame::new(scene.low, scene.high, scene.periodic_y),
            radius_m: scene.radius_m as f32,
            particles: Vec::new(),
            remainders: Vec::new(),
            masses: Vec::new(),
            bodies: Vec::new(),
            serials: Vec::new(),
            held: Vec::new(),
            broken: Vec::new(),
            bonds_at_start: 0,
            bonds_broken: 0,
        }
    }

    /// Initial state of a scene.
    pub fn new(scene: &Scene) -> Self {
        let mut state = Self::empty(scene);
        state.enter(scene, 0, scene.present());
        for &serial in &scene.held {
            state.held[serial as usize] = true;
            state.particles[serial as usize].velocity = Vec3::ZERO;
        }
        state
    }

    /// Appends bodies of a scene, numbered from `first` on, at these places.
    pub fn enter(&mut self, scene: &Scene, first: usize, bodies: &[Placement]) {
        let frame = self.frame;
        let mut serial = scene.first_serial(first);
        for (number, body) in (first as u32..).zip(bodies) {
            let kind = &scene.kinds[body.kind];
            for &point in &kind.meta.points {
                self.serials.push(serial);
                self.particles.push(Particle {
                    position: frame.wrap(frame.encode(body.position + body.orientation * point)),
                    velocity: body.velocity.as_vec3(),
                    spin: Vec3::ZERO,
                });
                self.masses.push(kind.subparticle_mass_kg as f32);
                self.bodies.push(number);
                serial += 1;
            }
            self.bonds_at_start += kind.meta.bonds.len() as u64;
        }
        let count = self.particles.len();
        self.remainders.resize(count, Vec3::ZERO);
        self.broken.resize(count, 0);
        self.held.resize(count, false);
    }

    /// Whether it has as many of everything, as it has unless somebody else has written it.
    pub(crate) fn is_consistent(&self) -> bool {
        let lengths = [
            self.remainders.len(),
            self.masses.len(),
            self.bodies.len(),
            self.serials.len(),
            self.held.len(),
        ];
        lengths.iter().all(|length| *length == self.particles.len())
    }

    /// Position of a sub-particle, in metres.
    pub fn position(&self, i: usize) -> DVec3 {
        self.frame.decode(self.particles[i].position)
    }

    /// Maximum speed, in m/s. Exact in any order of evaluation.
    pub fn max_speed(&self) -> f64 {
        let square = self.particles.iter().map(|p| p.velocity.dot(p.velocity)).fold(0.0, f32::max);
        f64::from(square).sqrt()
    }

    /// Number of sub-particles faster than `speed` in m/s. Exact in any order of evaluation.
    pub fn faster_than(&self, speed: f64) -> usize {
        let limit2 = (speed * speed) as f32;
        self.particles.iter().filter(|p| p.velocity.dot(p.velocity) > limit2).count()
    }

    /// Kinetic energy of translation and spin, in joule.
    pub fn kinetic_energy(&self) -> f64 {
        self.kinetic_energy_of(0..self.particles.len())
    }

    /// Kinetic energy of a range of sub-particles, in joule.
    pub fn kinetic_energy_of(&self, range: std::ops::Range<usize>) -> f64 {
        let inertia = 0.4 * f64::from(self.radius_m).powi(2);
        let of = |(p, &m): (&Particle, &f32)| {
            let (v, w) = (p.velocity.as_dvec3(), p.spin.as_dvec3());
            0.5 * f64::from(m) * (v.length_squared() + inertia * w.length_squared())
        };
        // `sum` would return -0 for an empty range.
        self.particles[range.clone()].iter().zip(&self.masses[range]).map(of).fold(0.0, |a, b| a + b)
    }

    /// Share of intact bonds, 0 to 1.
    pub fn bonds_intact_fraction(&self) -> f64 {
        if self.bonds_at_start == 0 {
            return 1.0;
        }
        1.0 - self.bonds_broken as f64 / self.bonds_at_start as f64
    }

    /// Ranges of sub-particles of the same body: (number, range).
    pub fn body_ranges(&self) -> impl Iterator<Item = (u32, std::ops::Range<usize>)> + '_ {
        let mut from = 0;
        self.bodies.chunk_by(|a, b| a == b).map(move |part| {
            let range = from..from + part.len();
            from = range.end;
            (part[0], range)
        })
    }

    /// Removes sub-particles by serial, ascending, with their bonds unbroken.
    ///
    /// Returns the new index of each former sub-particle, or `u32::MAX` if it was removed.
    pub fn remove(&mut self, serials: &[u32]) -> Vec<u32> {
        let kept = |serial: &u32| serials.binary_search(serial).is_err();
        let keep: Vec<bool> = self.serials.iter().map(kept).collect();
        let mut next = 0;
        let map = keep.iter().map(|&kept| {
            next += u32::from(kept);
            if kept { next - 1 } else { u32::MAX }
        });
        let map = map.collect();
        fn retain<T>(values: &mut Vec<T>, keep: &[bool]) {
            let mut keep = keep.iter();
            values.retain(|_| *keep.next().expect("as many as particles"));
        }
        retain(&mut self.particles, &keep);
        retain(&mut self.remainders, &keep);
        retain(&mut self.masses, &keep);
        retain(&mut self.bodies, &keep);
        retain(&mut self.serials, &keep);
        retain(&mut self.held, &keep);
        retain(&mut self.broken, &keep);
        map
    }
}

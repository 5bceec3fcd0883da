//! The share of sub-particles that lie inside another body.
//!
//! A body fills the cells of its lattice: eight neighbouring sub-particles are the corners of a cell, which deforms with
//! them. Six tetrahedra around one diagonal fill a cell (Kuhn's subdivision). All cells use the same diagonal, so
//! neighbouring cells leave no gap. A cell counts while each of its twelve edges is shorter than the length at which
//! bonds break. The half sphere outside the outermost centres does not count: only a sub-particle that has passed
//! between the spheres of the surface is inside.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use crate::engine::scene::Scene;
use crate::engine::state::State;
use crate::shape::lattice::MetaParticle;

/// Tetrahedra of a cell. Bits 0, 1 and 2 of a corner's number are its place along x, y and z.
const TETRAHEDRA: [[usize; 4]; 6] =
    [[0, 1, 3, 7], [0, 1, 5, 7], [0, 2, 3, 7], [0, 2, 6, 7], [0, 4, 5, 7], [0, 4, 6, 7]];

/// Edges of a cell.
const EDGES: [[usize; 2]; 12] =
    [[0, 1], [2, 3], [4, 5], [6, 7], [0, 2], [1, 3], [4, 6], [5, 7], [0, 4], [1, 5], [2, 6], [3, 7]];

/// Edge of the cubes that sort the cells of a body, in R.
const BIN_RATIO: f64 = 4.0;

/// Measures interpenetration in the states of a scene.
#[derive(Debug)]
pub(super) struct Interpenetration {
    /// Corners of the cells of each kind.
    cells: Vec<Vec<[u32; 8]>>,
    /// Kind of each body, and the serial of its first sub-particle.
    bodies: Vec<(usize, u32)>,
    break_length_m: f64,
    bin_m: f64,
}

/// A body at the moment of the measurement.
struct Placed {
    body: u32,
    /// Position of each sub-particle in metres, in one piece across a periodic seam.
    points: Vec<DVec3>,
    /// Index of its first sub-particle in the state.
    first: usize,
    low: DVec3,
    high: DVec3,
}

impl Placed {
    /// Whether the boxes of two bodies meet; along y always if it is periodic.
    fn meets(&self, other: &Self, period_m: f64) -> bool {
        let apart = self.low.cmpgt(other.high) | self.high.cmplt(other.low);
        !(apart.x || apart.z || (apart.y && period_m == 0.0))
    }
}

impl Interpenetration {
    pub(super) fn new(scene: &Scene) -> Self {
        let mut next = 0;
        let bodies = scene.bodies.iter().map(|body| {
            let first = next;
            next += scene.kinds[body.kind].meta.points.len() as u32;
            (body.kind, first)
        });
        Self {
            bodies: bodies.collect(),
            cells: scene.kinds.iter().map(|kind| cells(&kind.meta, 2.0 * scene.radius_m)).collect(),
            break_length_m: f64::from(scene.laws.bond.break_length),
            bin_m: BIN_RATIO * scene.radius_m,
        }
    }

    /// Whether a body has a cell that a sub-particle can be in. Spheres have none.
    pub(super) fn has_cells(&self) -> bool {
        self.cells.iter().any(|cells| !cells.is_empty())
    }

    /// Share of the sub-particles whose centre lies inside another body, 0 to 1; `None` without sub-particles.
    pub(super) fn fraction(&self, state: &State) -> Option<f64> {
        let bodies: Vec<Placed> =
            state.body_ranges().map(|(body, range)| placed(state, body, range)).collect();
        let mut is_inside = vec![false; state.particles.len()];
        let period_m = f64::from(state.frame.period_y) * f64::from(state.frame.unit_m);
        let is_solid = |body: &&Placed| !self.cells[self.bodies[body.body as usize].0].is_empty();
        for solid in bodies.iter().filter(is_solid) {
            let mut bins = None;
            for other in
                bodies.iter().filter(|other| other.body != solid.body && other.meets(solid, period_m))
            {
                for (k, &point) in other.points.iter().enumerate() {
                    let x = nearest_image(point, (solid.low + solid.high) / 2.0, period_m);
                    if x.cmpge(solid.low).all() && x.cmple(solid.high).all() {
                        let bins = bins.get_or_insert_with(|| self.bins(state, solid));
                        is_inside[other.first + k] |= bins.contain(x);
                    }
                }
            }
        }
        let inside = is_inside.iter().filter(|&&is_inside| is_inside).count();
        (!is_inside.is_empty()).then(|| inside as f64 / is_inside.len() as f64)
    }

    /// The intact cells of a body.
    fn bins(&self, state: &State, solid: &Placed) -> Bins {
        let (kind, serial) = self.bodies[solid.body as usize];
        let serials = &state.serials[solid.first..solid.first + solid.points.len()];
        let corner = |&local: &u32| serials.binary_search(&(serial + local)).ok().map(|k| solid.points[k]);
        let mut bins = Bins { edge_m: self.bin_m, cells: Vec::new(), bins: HashMap::new() };
        for cell in &self.cells[kind] {
            let corners: Vec<DVec3> = cell.iter().map_while(corner).collect();
            let Ok(corners) = <[DVec3; 8]>::try_from(corners) else { continue };
            if EDGES.iter().all(|[a, b]| corners[*a].distance(corners[*b]) < self.break_length_m) {
                bins.add(corners);
            }
        }
        bins
    }
}

/// Cells of a lattice with that spacing in metres, by their corners.
fn cells(meta: &MetaParticle, spacing_m: f64) -> Vec<[u32; 8]> {
    let Some(&first) = meta.points.first() else { return Vec::new() };
    let place = |point: &DVec3| ((*point - first) / spacing_m).round().as_ivec3();
    let index: HashMap<IVec3, u32> = meta.points.iter().map(place).zip(0..).collect();
    let corner = |low: IVec3, k: i32| index.get(&(low + IVec3::new(k & 1, k >> 1 & 1, k >> 2))).copied();
    let cell = |point| -> Option<[u32; 8]> {
        let corners: Option<Vec<u32>> = (0..8).map(|k| corner(place(point), k)).collect();
        corners?.try_into().ok()
    };
    meta.points.iter().filter_map(cell).collect()
}

fn placed(state: &State, body: u32, range: std::ops::Range<usize>) -> Placed {
    let unit_m = f64::from(state.frame.unit_m);
    let particles = &state.particles[range.clone()];
    let mut at = particles[0].position;
    let mut points = vec![at.as_dvec3() * unit_m];
    for pair in particles.windows(2) {
        at += state.frame.wrap(pair[1].position - pair[0].position);
        points.push(at.as_dvec3() * unit_m);
    }
    let low = points.iter().copied().fold(DVec3::INFINITY, DVec3::min);
    let high = points.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
    Placed { body, points, first: range.start, low, high }
}

/// The periodic image of a point nearest to another; the point itself without a period.
fn nearest_image(mut point: DVec3, to: DVec3, period_m: f64) -> DVec3 {
    if period_m > 0.0 {
        point.y -= period_m * ((point.y - to.y) / period_m).round();
    }
    point
}

/// Cells sorted into cubes, to find the ones around a point.
struct Bins {
    edge_m: f64,
    cells: Vec<[DVec3; 8]>,
    bins: HashMap<IVec3, Vec<usize>>,
}

impl Bins {
    fn bin(&self, point: DVec3) -> IVec3 {
        (point / self.edge_m).floor().as_ivec3()
    }

    fn add(&mut self, corners: [DVec3; 8]) {
        let low = self.bin(corners.iter().copied().fold(DVec3::INFINITY, DVec3::min));
        let high = self.bin(corners.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max));
        for z in low.z..=high.z {
            for y in low.y..=high.y {
                for x in low.x..=high.x {
                    self.bins.entry(IVec3::new(x, y, z)).or_default().push(self.cells.len());
                }
            }
        }
        self.cells.push(corners);
    }

    fn contain(&self, point: DVec3) -> bool {
        let near = self.bins.get(&self.bin(point)).into_iter().flatten();
        let mut tetrahedra =
            near.flat_map(|&k| TETRAHEDRA.map(|corners| corners.map(|corner| self.cells[k][corner])));
        tetrahedra.any(|tetrahedron| is_within(tetrahedron, point))
    }
}

/// Whether a point lies in a tetrahedron. One without volume holds nothing.
fn is_within([a, b, c, d]: [DVec3; 4], x: DVec3) -> bool {
    let volume = |a: DVec3, b: DVec3, c: DVec3, d: DVec3| (b - a).cross(c - a).dot(d - a);
    let whole = volume(a, b, c, d);
    let parts = [volume(x, b, c, d), volume(a, x, c, d), volume(a, b, x, d), volume(a, b, c, x)];
    whole != 0.0 && parts.iter().all(|part| part * whole >= 0.0)
}

#[cfg(test)]
mod tests {
    use glam::{DMat3, DQuat};
    use serde_json::json;

    use super::*;
    use crate::check::scene_of;
    use crate::scenario::from_value;

    const RADIUS_M: f64 = 0.006;

    /// Two equal fillets far apart.
    fn two_fillets(side_m: f64) -> Scene {
        let body = |y| json!({"position_m": [0.0, y, 0.0]});
        let document = json!({
            "experiment": "scene",
            "product": {"subparticle_radius_m": RADIUS_M},
            "scene": {"bodies": [body(-0.1), body(0.1)]},
        });
        let mut scene = scene_of(&from_value(&document).expect("a scenario"));
        (scene.low.y, scene.high.y) = (-side_m, side_m);
        scene
    }

    /// A state of two fillets, the second one shifted by so many R against the first, in the lattice's axes. `map` then
    /// moves all points.
    fn nested(scene: &Scene, shift: DVec3, map: impl Fn(DVec3) -> DVec3) -> State {
        let mut state = State::new(scene);
        let points = &scene.kinds[scene.bodies[0].kind].meta.points;
        for i in 0..state.particles.len() {
            let shift = if state.bodies[i] == 1 { shift * RADIUS_M } else { DVec3::ZERO };
            let place = state.frame.encode(map(points[i % points.len()] + shift));
            state.particles[i].position = state.frame.wrap(place);
        }
        state
    }

    /// Number of lattice points that have a neighbour on seven places above, behind and beside them.
    fn whole_cells(scene: &Scene) -> usize {
        let points = &scene.kinds[scene.bodies[0].kind].meta.points;
        let above = |low: &DVec3| {
            let is_corner = |x: &&DVec3| {
                let d = (**x - *low) / (2.0 * RADIUS_M);
                d.min_element() > -0.1 && d.max_element() < 1.1
            };
            points.iter().filter(is_corner).count() == 8
        };
        points.iter().filter(|&point| above(point)).count()
    }

    #[test]
    fn interpenetration_of_nested_lattices_is_one_sub_particle_per_cell() {
        let scene = two_fillets(0.3);
        let expected = whole_cells(&scene) as f64 / scene.kinds[0].meta.points.len() as f64;
        assert!(expected > 0.2, "{expected}");
        let turn = DQuat::from_rotation_x(0.4) * DQuat::from_rotation_z(1.1);
        let shear = DMat3::from_cols(DVec3::X, DVec3::new(0.3, 0.9, 0.0), DVec3::new(0.0, 0.2, 1.1));
        let measure = Interpenetration::new(&scene);
        // A point lies in the tetrahedron of the order of its coordinates: these and their complements have all six.
        for shift in [[1.1, 0.9, 0.8], [0.1, 1.8, 1.5], [0.9, 1.1, 0.8]].map(DVec3::from) {
            for map in [DMat3::IDENTITY, DMat3::from_quat(turn), shear] {
                let state = nested(&scene, shift, |point| map * point);
                assert_eq!(measure.fraction(&state), Some(expected), "{shift} {map}");
            }
        }
    }

    #[test]
    fn fillets_side_by_side_have_no_interpenetration() {
        let scene = two_fillets(0.3);
        let measure = Interpenetration::new(&scene);
        assert_eq!(measure.fraction(&State::new(&scene)), Some(0.0));
        // Closer than the spheres are thick, but no centre is beyond the outermost centres.
        let layers = scene.kinds[0].meta.points.iter().map(|point| point.z).fold(0.0, f64::max) / RADIUS_M;
        let state = nested(&scene, DVec3::new(0.9, 0.7, 2.0 * layers + 3.0), |point| point);
        assert_eq!(measure.fraction(&state), Some(0.0));
    }

    #[test]
    fn interpenetration_is_the_same_across_a_periodic_boundary() {
        let mut scene = two_fillets(0.3);
        let shift = DVec3::new(1.1, 0.9, 0.8);
        let apart = Interpenetration::new(&scene).fraction(&nested(&scene, shift, |point| point));
        let half_m = 0.11;
        scene = two_fillets(half_m);
        scene.periodic_y = true;
        let measure = Interpenetration::new(&scene);
        let mut boxes_apart = 0;
        for k in 0..88 {
            let y = 2.0 * half_m * f64::from(k) / 88.0;
            let state = nested(&scene, shift, |point| point + DVec3::Y * y);
            assert_eq!(measure.fraction(&state), apart, "moved by {y} m");
            let placed: Vec<Placed> =
                state.body_ranges().map(|(body, range)| placed(&state, body, range)).collect();
            boxes_apart += usize::from(!placed[0].meets(&placed[1], 0.0));
        }
        // A body is in one piece from its first sub-particle on. Two such pieces are a period apart where the seam is between
        // their first sub-particles.
        assert!(boxes_apart > 0, "no place of the seam separates the boxes");
    }

    #[test]
    fn interpenetration_excludes_torn_cells_and_cells_with_missing_corners() {
        let scene = two_fillets(0.3);
        let measure = Interpenetration::new(&scene);
        let count = scene.kinds[0].meta.points.len();
        let shift = DVec3::new(1.1, 0.9, 0.8);
        let whole = measure.fraction(&nested(&scene, shift, |point| point));
        // Both fillets are stretched until their bonds along z are nearly as long as bonds that break, or longer.
        let break_ratio = f64::from(scene.laws.bond.break_length) / (2.0 * RADIUS_M);
        for (share, expected) in [(0.99, whole), (1.01, Some(0.0))] {
            let stretch = DVec3::new(1.0, 1.0, share * break_ratio);
            let state = nested(&scene, shift, |point| point * stretch);
            assert_eq!(measure.fraction(&state), expected, "{share} of the length at which bonds break");
        }
        // Every second sub-particle of the first fillet is pulled out of its lattice, or gone.
        let mut state = nested(&scene, shift, |point| point);
        let inside = measure.fraction(&state).expect("it has sub-particles") * 2.0 * count as f64;
        for i in (0..count).step_by(2) {
            state.particles[i].position.z += (0.1 / f64::from(state.frame.unit_m)) as i32;
        }
        let torn = measure.fraction(&state).expect("it has sub-particles") * 2.0 * count as f64;
        assert!(torn < 0.5 * inside && torn > 0.0, "{torn} of {inside}");
        let odd: Vec<u32> = (0..count as u32).step_by(2).collect();
        state.remove(&odd);
        let gone = measure.fraction(&state).expect("it has sub-particles") * state.particles.len() as f64;
        assert!(gone <= torn && gone > 0.0, "{gone} of {torn}");
    }
}

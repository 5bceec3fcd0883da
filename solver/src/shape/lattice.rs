//! The lattice fill: a shape becomes a meta-particle of bonded sub-particles on a simple cubic lattice.
//!
//! Lattice points are 2R apart, symmetric about the centre of the shape's box. With two types in a
//! checkerboard only unlike types bond: within √3 of the spacing exactly the six nearest neighbours (Fig. 2,
//! 3). With one type all neighbours within the contact radius bond, diagonals included: the stiff truss of
//! Fig. 2a.

use std::collections::HashMap;

use glam::{DVec3, IVec3};

use super::Shape;
use crate::scenario::Fill;

/// A bond between two points of a meta-particle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct LatticeBond {
    /// The lower index.
    pub i: u32,
    /// The higher index.
    pub j: u32,
    /// 1 along a lattice edge, 2 on a face diagonal, 3 on a body diagonal. The rest length is 2R √class.
    pub class: u32,
}

/// A fillet as the engine represents it: points about their centre of mass, and bonds.
#[derive(Clone, Debug, PartialEq)]
pub struct MetaParticle {
    /// Centres of the sub-particles relative to their centre of mass, in metres, sorted by z, y, x.
    pub points: Vec<DVec3>,
    /// Bonds, sorted.
    pub bonds: Vec<LatticeBond>,
    /// Volume of the surface, in m³.
    pub volume_m3: f64,
    /// Maximum distance of a point from the centre of mass, in metres.
    pub bounding_radius_m: f64,
}

impl MetaParticle {
    /// Layers of sub-particles of that radius along the axis with the fewest.
    pub fn layers(&self, radius_m: f64) -> usize {
        let across = |axis: usize| {
            let along = || self.points.iter().map(|point| point[axis]);
            let extent_m = along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min);
            (extent_m / (2.0 * radius_m)).round() as usize + 1
        };
        (0..3).map(across).min().unwrap_or(0)
    }
}

/// Highest bond class within the contact radius. Contact radii sum to 2R · ratio, lengths are 2R √class. With
/// two types only odd lattice steps join unlike types.
pub fn max_bond_class(types: u32, contact_radius_ratio: f64) -> u32 {
    if types == 1 && contact_radius_ratio >= 2f64.sqrt() { 2 } else { 1 }
}

impl MetaParticle {
    /// A single sphere of a radius in metres.
    pub fn sphere(radius_m: f64) -> Self {
        let volume_m3 = 4.0 / 3.0 * std::f64::consts::PI * radius_m.powi(3);
        Self { points: vec![DVec3::ZERO], bonds: Vec::new(), volume_m3, bounding_radius_m: 0.0 }
    }

    /// A scaled copy, sub-particles included.
    pub fn scaled(&self, scale: f64) -> Self {
        Self {
            points: self.points.iter().map(|&point| point * scale).collect(),
            bonds: self.bonds.clone(),
            volume_m3: self.volume_m3 * scale.powi(3),
            bounding_radius_m: self.bounding_radius_m * scale,
        }
    }

    /// Fills a shape with sub-particles of `radius` in metres. The result is empty when no lattice point lies inside.
    pub fn fill(shape: &impl Shape, radius: f64, fill: Fill, reach: u32) -> Self {
        Self::fill_counting_discarded(shape, radius, fill, reach).0
    }

    /// Like [`MetaParticle::fill`]; also returns the number of inner points discarded because they are not
    /// connected to the rest.
    pub fn fill_counting_discarded(shape: &impl Shape, radius: f64, fill: Fill, reach: u32) -> (Self, usize) {
        let (spacing, volume_m3) = (2.0 * radius, shape.volume_m3());
        let counts = shape.layers(spacing) + 2;
        let centre = |cell: IVec3| (cell.as_dvec3() + 0.5 - counts.as_dvec3() / 2.0) * spacing;
        let rows = (0..counts.z).flat_map(|z| (0..counts.y).map(move |y| (y, z)));
        let all = rows.flat_map(|(y, z)| (0..counts.x).map(move |x| IVec3::new(x, y, z)));
        let cells: Vec<IVec3> = match fill {
            Fill::Centres => all.filter(|&cell| shape.contains(centre(cell))).collect(),
            Fill::WholeSpheres => all.filter(|&cell| shape.contains_sphere(centre(cell), radius)).collect(),
            Fill::Volume => {
                let is_inside = all.clone().map(|cell| shape.contains(centre(cell))).collect();
                let inside = Inside { counts, is_inside };
                let covered: Vec<u8> = all
                    .clone()
                    .map(|cell| covered_samples(shape, &inside, cell, centre(cell), spacing))
                    .collect();
                most_covered(all, &covered, volume_m3 / spacing.powi(3))
            }
        };
        let inside = cells.len();
        let cells = largest_component(cells);
        let mut points: Vec<DVec3> = cells.iter().map(|&cell| centre(cell)).collect();
        let centre_of_mass = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        points.iter_mut().for_each(|point| *point -= centre_of_mass);
        let meta = Self {
            bonds: bonds(&cells, reach),
            bounding_radius_m: points.iter().map(|point| point.length()).fold(0.0, f64::max),
            volume_m3,
            points,
        };
        (meta, inside - cells.len())
    }
}

/// Samples along an edge of a cell.
const SAMPLES: i32 = 6;
/// Samples of a cell; a byte holds their number.
const ALL_SAMPLES: usize = SAMPLES.pow(3) as usize;

/// Whether the centre of each cell lies in the shape.
struct Inside {
    /// Cells along each axis.
    counts: IVec3,
    /// In z, y, x order.
    is_inside: Vec<bool>,
}

impl Inside {
    fn contains(&self, cell: IVec3) -> bool {
        let is_cell = cell.cmpge(IVec3::ZERO).all() && cell.cmplt(self.counts).all();
        is_cell && self.is_inside[((cell.z * self.counts.y + cell.y) * self.counts.x + cell.x) as usize]
    }
}

/// The number of evenly spaced samples of a cell that lie in a shape. Only a cell at the surface is sampled: one that has neighbours of both
/// kinds.
fn covered_samples(shape: &impl Shape, inside: &Inside, cell: IVec3, centre: DVec3, edge_m: f64) -> u8 {
    let is_inside = inside.contains(cell);
    let mut neighbours = neighbour_steps().flat_map(|step| [cell + step, cell - step]);
    if neighbours.all(|neighbour| inside.contains(neighbour) == is_inside) {
        return if is_inside { ALL_SAMPLES as u8 } else { 0 };
    }
    // Odd steps from the centre: the samples of mirrored cells are exact mirror images.
    let step = |k: i32| f64::from(2 * k + 1 - SAMPLES);
    let samples = (0..SAMPLES.pow(3)).map(|k| {
        let steps = DVec3::new(step(k % SAMPLES), step(k / SAMPLES % SAMPLES), step(k / SAMPLES.pow(2)));
        centre + steps * (edge_m / f64::from(2 * SAMPLES))
    });
    samples.filter(|&sample| shape.contains(sample)).count() as u8
}

/// The cells with the most covered samples, in their order; `covered` has their numbers. Their number is the one nearest to the volume of the shape, in cells. Cells
/// with equally many samples are taken or left together, so that a symmetric shape has a symmetric fill.
fn most_covered(cells: impl Iterator<Item = IVec3>, covered: &[u8], volume: f64) -> Vec<IVec3> {
    let mut with = [0_usize; ALL_SAMPLES + 1];
    covered.iter().for_each(|samples| with[usize::from(*samples)] += 1);
    let all: usize = covered.iter().map(|samples| usize::from(*samples)).sum();
    // The volume of a mesh counts twice what two of its bodies share; the samples count it once.
    let wanted = volume.min(all as f64 / ALL_SAMPLES as f64);
    let error = |least: usize| (with[least..].iter().sum::<usize>() as f64 - wanted).abs();
    let least = (1..=ALL_SAMPLES).min_by(|&a, &b| error(a).total_cmp(&error(b))).unwrap_or(ALL_SAMPLES);
    cells.zip(covered).filter(|(_, samples)| usize::from(**samples) >= least).map(|(cell, _)| cell).collect()
}

/// Half of the 26 neighbours of a cell: those that come later in z, y, x order.
pub(super) fn neighbour_steps() -> impl Iterator<Item = IVec3> {
    (14..27).map(|k| IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))
}

fn bonds(cells: &[IVec3], reach: u32) -> Vec<LatticeBond> {
    let index: HashMap<IVec3, u32> = cells.iter().copied().zip(0..).collect();
    let mut bonds: Vec<LatticeBond> = cells
        .iter()
        .zip(0u32..)
        .flat_map(|(&cell, i)| neighbour_steps().map(move |step| (cell, i, step)))
        .filter(|(_, _, step)| step.length_squared() as u32 <= reach)
        .filter_map(|(cell, i, step)| {
            let &j = index.get(&(cell + step))?;
            Some(LatticeBond { i: i.min(j), j: i.max(j), class: step.length_squared() as u32 })
        })
        .collect();
    bonds.sort_unstable();
    bonds
}

/// Connected components of `count` elements joined by `pairs`. Each element gets the lowest index of its
/// component.
pub fn connected_components(count: usize, pairs: impl Iterator<Item = (u32, u32)>) -> Vec<usize> {
    let mut part: Vec<usize> = (0..count).collect();
    fn root(part: &mut [usize], mut i: usize) -> usize {
        while part[i] != i {
            part[i] = part[part[i]];
            i = part[i];
        }
        i
    }
    for (i, j) in pairs {
        let (a, b) = (root(&mut part, i as usize), root(&mut part, j as usize));
        part[a.max(b)] = a.min(b);
    }
    (0..count).map(|i| root(&mut part, i)).collect()
}

/// The largest connected part. Cells cut off by a coarse lattice would fall away as loose spheres.
fn largest_component(cells: Vec<IVec3>) -> Vec<IVec3> {
    let roots = connected_components(cells.len(), bonds(&cells, 1).iter().map(|bond| (bond.i, bond.j)));
    let mut sizes: HashMap<usize, usize> = HashMap::new();
    roots.iter().for_each(|&r| *sizes.entry(r).or_default() += 1);
    let largest = sizes.iter().max_by_key(|&(&r, &n)| (n, usize::MAX - r)).map(|(&r, _)| r);
    cells.iter().zip(roots).filter(|&(_, r)| Some(r) == largest).map(|(&cell, _)| cell).collect()
}

#[cfg(test)]
mod tests {
    use super::super::teardrop::Teardrop;
    use super::*;

    const SIZE_1: Teardrop = Teardrop { size_m: [0.144, 0.072, 0.040], mirrored: false };

    #[test]
    fn bonds_join_nearest_neighbours_and_diagonals_only_with_one_type() {
        let two = MetaParticle::fill(&SIZE_1, 0.004, Fill::Centres, max_bond_class(2, 1.732));
        assert!(two.bonds.iter().all(|bond| {
            let length = (two.points[bond.i as usize] - two.points[bond.j as usize]).length();
            (length - 0.008).abs() < 1e-12 && bond.class == 1
        }));
        let one = MetaParticle::fill(&SIZE_1, 0.004, Fill::Centres, max_bond_class(1, 1.5));
        let diagonals = one.bonds.iter().filter(|bond| bond.class == 2).count();
        assert!(diagonals > one.bonds.len() / 2, "{diagonals} of {}", one.bonds.len());
        assert_eq!(one.bonds.len() - diagonals, two.bonds.len());
        assert_eq!(max_bond_class(1, 1.4), 1, "below √2 no diagonal is within reach");
    }

    #[test]
    fn lattice_volume_follows_the_shape_and_sorting_is_z_y_x() {
        let meta = MetaParticle::fill(&SIZE_1, 0.002, Fill::Centres, 1);
        let volume = meta.points.len() as f64 * 0.004f64.powi(3);
        assert!((volume / meta.volume_m3 - 1.0).abs() < 0.03);
        assert!(meta.points.is_sorted_by(|a, b| (a.z, a.y, a.x) < (b.z, b.y, b.x)));
        assert!(meta.points.iter().sum::<DVec3>().length() < 1e-9);
    }

    #[test]
    fn fill_of_whole_spheres_has_fewer_points_than_fill_of_centres() {
        let centres = MetaParticle::fill(&SIZE_1, 0.004, Fill::Centres, 1);
        let whole = MetaParticle::fill(&SIZE_1, 0.004, Fill::WholeSpheres, 1);
        assert!(whole.points.len() < centres.points.len() * 2 / 3);
        assert!(!whole.points.is_empty());
    }

    #[test]
    fn fill_by_volume_has_the_volume_of_the_shape_whatever_the_radius() {
        for size_m in [[0.144, 0.072, 0.040], [0.172, 0.072, 0.032], [0.176, 0.072, 0.040]] {
            for radius in [0.002, 0.003, 0.004, 0.005, 0.006, 0.007, 0.008] {
                let shape = Teardrop { size_m, mirrored: false };
                let meta = MetaParticle::fill(&shape, radius, Fill::Volume, 1);
                let wanted = meta.volume_m3 / (2.0 * radius).powi(3);
                // Half of a group of equally covered cells.
                let error = (meta.points.len() as f64 - wanted).abs();
                assert!(error <= 3.0, "{size_m:?} {radius}: {error} of {wanted}");
                let upside_down: Vec<_> = meta.points.iter().map(|point| point.z).collect();
                assert!(upside_down.iter().sum::<f64>().abs() < 1e-9, "as thick above as below");
                let mirrored = Teardrop { mirrored: true, ..shape };
                let mirrored = MetaParticle::fill(&mirrored, radius, Fill::Volume, 1);
                let mut image: Vec<_> =
                    mirrored.points.iter().map(|p| *p * DVec3::new(1.0, -1.0, 1.0)).collect();
                image.sort_by(|a, b| (a.z, a.y, a.x).partial_cmp(&(b.z, b.y, b.x)).unwrap());
                assert_eq!(image.len(), meta.points.len());
                assert!(image.iter().zip(&meta.points).all(|(a, b)| (*a - *b).length() < 1e-9));
            }
        }
    }

    #[test]
    fn equally_covered_cells_are_taken_together() {
        let taken = |covered: &[u8]| {
            let cells = (0..covered.len()).map(|x| IVec3::X * x as i32);
            most_covered(cells, covered, f64::INFINITY).iter().map(|cell| cell.x).collect::<Vec<_>>()
        };
        // In cells: 1 + 2/2 + 1/8 = 2.1, nearer to three cells than to one.
        assert_eq!(taken(&[108, 216, 27, 108]), [0, 1, 3]);
        // 1 + 2/4 + 1/8 = 1.6, nearer to one cell than to three.
        assert_eq!(taken(&[54, 216, 27, 54]), [1]);
        assert_eq!(taken(&[0, 0]), [0; 0]);
    }

    #[test]
    fn cells_outside_the_largest_component_are_dropped() {
        let cells = vec![IVec3::ZERO, IVec3::X, IVec3::new(5, 0, 0), IVec3::new(2, 0, 0)];
        assert_eq!(largest_component(cells), [IVec3::ZERO, IVec3::X, IVec3::new(2, 0, 0)]);
    }
}

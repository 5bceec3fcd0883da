//! Sub-particles as points, intact bonds as lines.

use roost_solver::engine::run::Snapshot;
use roost_solver::engine::state::Particle;

use super::file::{Cells, PolyData, scalars, vectors};

/// A `.vtp` file of a snapshot. `first_shape` is the number of the first shape of the scene.
///
/// Lines have the array `stretch`, their length over 2R: 1 at rest along an edge of the lattice, √2 along the diagonal of a face. Bonds across
/// a periodic boundary are left out, since ParaView would draw them through the whole domain.
pub fn particles(snapshot: &Snapshot<'_>, first_shape: u32) -> Vec<u8> {
    let state = snapshot.state;
    let count = state.particles.len();
    let shapes: Vec<u32> = snapshot.scene.bodies.iter().map(|body| first_shape + body.kind as u32).collect();
    let positions: Vec<[f32; 3]> = (0..count).map(|i| state.position(i).as_vec3().to_array()).collect();
    let flat = |of: fn(&Particle) -> [f32; 3]| state.particles.iter().flat_map(of).collect::<Vec<f32>>();

    // Serials stay the same after removals, indices change.
    let mut index = vec![0; state.serials.last().map_or(0, |&last| last as usize + 1)];
    state.serials.iter().zip(0usize..).for_each(|(&serial, i)| index[serial as usize] = i);
    let (mut ends, mut stretch) = (Vec::new(), Vec::new());
    for bond in snapshot.bonds {
        let [i, j] = bond.map(|serial| index[serial as usize]);
        let [a, b] = [i, j].map(|i| state.particles[i].position);
        let (apart, across) = (state.frame.between(a, b), b.wrapping_sub(a).y);
        if state.frame.period_y == 0 || across.unsigned_abs() <= state.frame.period_y.unsigned_abs() / 2 {
            ends.extend([i as u64, j as u64]);
            stretch.push(apart.length() / (2.0 * state.radius_m));
        }
    }
    let speeds: Vec<f32> = state.particles.iter().map(|p| p.velocity.length()).collect();
    let shapes: Vec<u32> = state.bodies.iter().map(|&body| shapes[body as usize]).collect();
    let point_data = vec![
        scalars("speed_m_s", speeds),
        vectors("velocity_m_s", flat(|p| p.velocity.to_array())),
        vectors("spin_rad_s", flat(|p| p.spin.to_array())),
        scalars("body", state.bodies.clone()),
        scalars("shape", shapes),
        scalars("radius_m", vec![state.radius_m; count]),
        scalars("bonds_broken", state.broken.clone()),
    ];
    let cell_data = vec![scalars("stretch", stretch)];
    PolyData { points: positions.concat(), point_data, cells: Cells::Lines(ends), cell_data }.into_file()
}

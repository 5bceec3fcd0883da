//! STL files: a valid one is the same after writing and reading, and gives a valid mesh or none.
#![no_main]

use libfuzzer_sys::fuzz_target;
use roost_solver::mesh::{MAX_TRIANGLES, Meshes, Units, stl};

fuzz_target!(|bytes: &[u8]| {
    let Ok(triangles) = stl::read(bytes) else { return };
    assert!((1..=MAX_TRIANGLES).contains(&triangles.len()));
    assert!(triangles.iter().flatten().all(|corner| corner.is_finite()));

    let mut written = vec![b'x'; 80];
    written.extend((triangles.len() as u32).to_le_bytes());
    for triangle in &triangles {
        written.extend([0; 12]);
        let numbers = triangle.iter().flat_map(|corner| corner.to_array());
        numbers.for_each(|number| written.extend((number as f32).to_le_bytes()));
        written.extend([0; 2]);
    }
    // Text may hold what is infinite as `f32`.
    if let Ok(again) = stl::read(&written) {
        let narrow = |corner: &[f64]| corner.iter().map(|x| (*x as f32).to_bits()).collect::<Vec<_>>();
        for (one, other) in triangles.iter().flatten().zip(again.iter().flatten()) {
            assert_eq!(narrow(&one.to_array()), narrow(&other.to_array()));
        }
    }

    let mut meshes = Meshes::default();
    let digest = meshes.insert(bytes).expect("it was read");
    for units in [Units::Mm, Units::M] {
        if let Ok(mesh) = meshes.get(&digest).expect("it was inserted").in_units(units) {
            assert!(!mesh.triangles.is_empty() && mesh.triangles.len() <= triangles.len());
            assert!(mesh.low.cmple(mesh.high).all() && mesh.size_m().is_finite());
        }
    }
});

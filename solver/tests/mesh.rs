//! CAD files: what is read, what is known of it, and every way in which a file is refused.

#[path = "common/stl.rs"]
mod stl;

use std::time::{Duration, Instant};

use glam::{DQuat, DVec3};
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use roost_solver::mesh::{MAX_TRIANGLES, Mesh, MeshError, Meshes, Units, digest};
use stl::{Triangle, ascii, ball, binary, binary_with, cuboid, mesh, moved, quad, turned};

/// A box of 30 × 20 × 10 in whatever units.
fn brick() -> Vec<Triangle> {
    cuboid(DVec3::new(-10.0, 5.0, 0.0), DVec3::new(20.0, 25.0, 10.0), 2)
}

fn read(bytes: &[u8], units: Units) -> Result<Mesh, MeshError> {
    let mut meshes = Meshes::default();
    let digest = meshes.insert(bytes)?;
    meshes.get(&digest).expect("it was put there").in_units(units)
}

fn refused(bytes: &[u8]) -> String {
    Meshes::default().insert(bytes).expect_err("refused").to_string()
}

#[test]
fn a_file_is_read_in_its_units_binary_or_ascii() {
    let from_binary = read(&binary(&brick()), Units::Mm).expect("sound");
    assert_eq!(from_binary.triangles.len(), 48);
    assert_eq!(
        (from_binary.low, from_binary.high),
        (DVec3::new(-0.01, 0.005, 0.0), DVec3::new(0.02, 0.025, 0.01))
    );
    assert!((from_binary.signed_volume_m3 - 6e-6).abs() < 1e-17);
    assert!(from_binary.is_closed() && from_binary.is_oriented() && from_binary.degenerate == 0);
    let from_ascii = read(ascii(&brick()).as_bytes(), Units::Mm).expect("sound");
    assert_eq!(from_ascii.triangles, from_binary.triangles);
    assert_ne!(from_ascii.digest, from_binary.digest);
    let in_metres = read(&binary(&brick()), Units::M).expect("sound");
    assert_eq!(in_metres.size_m(), DVec3::new(30.0, 20.0, 10.0));
    assert_eq!(in_metres.triangles[5].map(|corner| corner * 1e-3), from_binary.triangles[5]);
}

#[test]
fn a_binary_file_whose_header_says_solid_is_binary() {
    for header in [&b"solid brick"[..], &[b' '; 80], &[b"solid ".as_slice(), &[b'x'; 74]].concat()] {
        let found = read(&binary_with(header, &brick()), Units::Mm).expect("sound");
        assert_eq!(found.triangles.len(), 48);
    }
    // Cut short, it is binary all the same.
    let whole = binary_with(b"solid brick", &brick());
    assert!(refused(&whole[..1000]).contains("takes 2484 bytes, found 1000"), "{}", refused(&whole[..1000]));
}

#[test]
fn ascii_variants_are_read_like_the_plain_file() {
    let plain = read(ascii(&brick()).as_bytes(), Units::Mm).expect("sound").triangles;
    let capitals = ascii(&brick()).to_uppercase().replace('\n', "\r\n");
    let old_mac = ascii(&brick()).replace('\n', "\r");
    let nameless = ascii(&brick()).replace(" made by a test", "");
    let nan = ascii(&brick()).replace("normal 0 0 0", "normal -nan(ind) nan 1e400");
    let latin =
        [b"  \tsolid K\xfche facet\n".as_slice(), ascii(&brick()).split_once('\n').unwrap().1.as_bytes()]
            .concat();
    for text in [capitals.as_bytes(), old_mac.as_bytes(), nameless.as_bytes(), nan.as_bytes(), &latin] {
        assert_eq!(read(text, Units::Mm).expect("sound").triangles, plain);
    }
    // Several solids in one file.
    let two = ascii(&brick()[..20]) + &ascii(&brick()[20..]);
    assert_eq!(read(two.as_bytes(), Units::Mm).expect("sound").triangles, plain);
}

#[test]
fn invalid_files_are_refused_with_the_reason_and_numbers() {
    let (whole, text) = (binary(&brick()), ascii(&brick()));
    let empty_ascii = b"solid nothing\nendsolid nothing\n";
    let huge_count = [&[0; 80][..], &u32::MAX.to_le_bytes(), &[0; 50]].concat();
    let replaced = |from: &str, to: &str| text.replacen(from, to, 1);
    let cases: Vec<(Vec<u8>, &[&str])> = vec![
        (vec![], &["empty"]),
        (binary(&[]), &["no triangle"]),
        (empty_ascii.to_vec(), &["no triangle"]),
        (whole[..2483].to_vec(), &["cut short", "48 triangles", "2484", "2483"]),
        ([&whole[..], b"\n"].concat(), &["after its end", "48 triangles", "2484", "2485"]),
        (huge_count, &["neither", "4294967295 triangles", "214748364834 bytes", "found 134"]),
        (whole[..83].to_vec(), &["neither", "84 bytes, found 83"]),
        (b"v 1 2 3\nf 1 2 3\n".repeat(50), &["neither", "`solid`"]),
        (b"\x89PNG\r\n\x1a\n".repeat(50), &["neither"]),
        (replaced("endloop", "endlop").into(), &["line 7", "`endloop`", "`endlop`"]),
        (replaced("vertex -10", "vertex -10,0").into(), &["line 4", "a number", "`-10,0`"]),
        (text[..text.rfind("endsolid").unwrap()].into(), &["`facet` or `endsolid`", "the end of the file"]),
        ((text.clone() + "facet").into(), &["`solid` or the end of the file", "`facet`"]),
        (replaced("vertex -10", "vertex nan").into(), &["triangle 1 ", "(NaN, 5, 0)"]),
    ];
    for (bytes, words) in cases {
        let message = refused(&bytes);
        assert!(words.iter().all(|word| message.contains(word)), "{message} shall name {words:?}");
    }
    let mut endless = brick();
    endless[17][2].y = f64::INFINITY;
    let message = refused(&binary(&endless));
    assert!(message.starts_with("triangle 18 has a corner at (") && message.contains(", inf, "), "{message}");
    let many = vec![brick()[0]; MAX_TRIANGLES + 1];
    for bytes in [binary(&many), ascii(&many).into_bytes()] {
        assert_eq!(Meshes::default().insert(&bytes), Err(MeshError::TooMany { found: 200_001 }));
    }
    assert!(Meshes::default().insert(&binary(&many[1..])).is_ok());
}

#[test]
fn implausible_size_is_refused_with_a_hint_about_units() {
    let brick_m = moved(&brick(), |p| p * 1e-3);
    let small = read(&binary(&brick_m), Units::Mm).expect_err("30 µm").to_string();
    assert!(small.contains("are the units right?") && small.contains("millimetres"), "{small}");
    assert!(small.contains("0.001 to 100 m") && small.contains("3.000e-5 × 2.000e-5 ×"), "{small}");
    let large = moved(&brick(), |p| p * 100.0);
    assert!(
        matches!(read(&binary(&large), Units::M), Err(MeshError::Size { size_m: [x, _, _], .. }) if x == 3000.0)
    );
    assert!(read(&binary(&large), Units::Mm).is_ok());
    let line = [[DVec3::ZERO, DVec3::X, DVec3::X * 2.0], [DVec3::ONE; 3]];
    assert_eq!(read(&binary(&line), Units::M), Err(MeshError::AllDegenerate { triangles: 2 }));
}

#[test]
fn open_edges_reversed_edges_and_degenerate_triangles_are_counted() {
    let mut open = brick();
    open.remove(11);
    let found = mesh(&open);
    assert_eq!((found.open_edges, found.turned_edges, found.is_closed()), (3, 0, false));
    let mut wrong = brick();
    wrong[11].swap(0, 1);
    let found = mesh(&wrong);
    assert_eq!((found.open_edges, found.turned_edges, found.is_oriented()), (0, 3, false));
    let inwards = mesh(&turned(&brick()));
    assert!((inwards.signed_volume_m3 + 6000.0).abs() < 1e-9 && inwards.is_oriented());

    // A corner that stands on an edge of its neighbour, closed by a triangle without area.
    let (low, high) = (DVec3::ZERO, DVec3::ONE);
    let mut seam = cuboid(low, high, 1);
    let [a, b, c] = seam[0];
    let middle = (a + b) / 2.0;
    seam.splice(..1, [[a, middle, c], [middle, b, c], [a, b, middle]]);
    let found = mesh(&seam);
    assert_eq!((found.open_edges, found.turned_edges, found.degenerate), (0, 0, 1));
    assert!((found.signed_volume_m3 - 1.0).abs() < 1e-12);

    // Corners that fell together, and corners a rounding apart.
    let mut loose = cuboid(low, high, 1);
    loose.push([a, a, b]);
    for (k, triangle) in loose.iter_mut().enumerate() {
        triangle[k % 3] += DVec3::X * 5e-8;
    }
    let found = mesh(&loose);
    assert_eq!((found.open_edges, found.degenerate, found.triangles.len()), (0, 1, 12));

    // Two boxes that touch along an edge: four triangles there, two each way.
    let touching =
        [cuboid(low, high, 1), cuboid(DVec3::new(1.0, 1.0, 0.0), DVec3::new(2.0, 2.0, 1.0), 1)].concat();
    assert!(mesh(&touching).is_closed() && mesh(&touching).is_oriented());
    // The same triangle twice is no closed edge.
    let twice = [cuboid(low, high, 1), vec![[a, b, c]]].concat();
    assert_eq!(mesh(&twice).open_edges, 3);
}

#[test]
fn rotated_ball_mesh_keeps_its_volume() {
    let turn = DQuat::from_euler(glam::EulerRot::ZYX, 0.7, 0.4, -1.1);
    let found = mesh(&moved(&ball(0.05, 4), |p| turn * p + DVec3::new(3.0, -2.0, 1.0)));
    assert_eq!(found.triangles.len(), 2048);
    assert!(found.is_closed() && found.is_oriented());
    let ideal = 4.0 / 3.0 * std::f64::consts::PI * 0.05f64.powi(3);
    let short = 1.0 - found.signed_volume_m3 / ideal;
    assert!((0.0..0.01).contains(&short), "short of the ball by {short}");
}

#[test]
fn files_are_shared_by_digest() {
    let bytes = binary(&brick());
    let mut meshes = Meshes::default();
    let name = meshes.insert(&bytes).expect("sound");
    assert_eq!(name, blake3::hash(&bytes).to_hex().as_str());
    assert_eq!(name, digest(&bytes));
    let copy = meshes.clone();
    let other = meshes.insert(&binary(&brick()[..4])).expect("sound");
    assert!(copy.get(&other).is_none() && meshes.get(&other).is_some());
    assert!(std::sync::Arc::ptr_eq(&copy.get(&name).expect("here"), &meshes.get(&name).expect("here")));
    let size = |units| copy.get(&name).expect("here").in_units(units).expect("sound").size_m();
    assert_eq!(size(Units::Mm), size(Units::M) * 1e-3);
    // A mesh is worked out once.
    let again = || copy.get(&name).expect("here").in_units(Units::Mm).expect("sound").triangles;
    assert!(std::sync::Arc::ptr_eq(&again(), &again()));
    assert!(meshes.get("").is_none());
}

#[test]
fn no_file_makes_the_reader_panic() {
    let mut draw = ChaCha8Rng::seed_from_u64(1);
    let sound = [binary(&brick()), binary_with(b"solid", &brick()), ascii(&brick()).into_bytes()];
    let (mut taken, mut refused) = (0, 0);
    let mut look = |bytes: &[u8]| {
        match Meshes::default().insert(bytes) {
            Ok(_) => taken += 1,
            Err(error) => refused += usize::from(!error.to_string().is_empty()),
        }
        for units in [Units::Mm, Units::M] {
            let _ = read(bytes, units);
        }
    };
    for whole in &sound {
        (0..whole.len()).step_by(7).for_each(|end| look(&whole[..end]));
        for _ in 0..500 {
            let mut bytes = whole.clone();
            for _ in 0..1 + draw.next_u32() % 4 {
                let at = draw.next_u32() as usize % bytes.len();
                bytes[at] = draw.next_u32() as u8;
            }
            look(&bytes);
        }
    }
    for length in (0..600).chain([84 + 50, 84 + 500]) {
        let mut bytes = vec![0; length];
        draw.fill_bytes(&mut bytes);
        look(&bytes);
        // The same bytes as coordinates.
        if length >= 84 {
            bytes[80..84].copy_from_slice(&((length as u32 - 84) / 50).to_le_bytes());
            look(&bytes);
        }
    }
    assert!(taken > 300 && refused > 1500, "{taken} taken, {refused} refused");
}

#[test]
fn largest_mesh_files_are_read_in_seconds() {
    let start = Instant::now();
    // All corners of all triangles in the way of each other: a fan about one point, a book about one edge.
    let around = |k: u32| {
        let angle = f64::from(k) / 1e5 * std::f64::consts::TAU;
        DVec3::new(angle.cos(), angle.sin(), 0.0)
    };
    let fan: Vec<Triangle> = (0..100_000).map(|k| [DVec3::Z, around(k), around(k + 1)]).collect();
    let book: Vec<Triangle> = (0..100_000).map(|k| [DVec3::ZERO, DVec3::Z, around(k)]).collect();
    assert_eq!(mesh(&fan).triangles.len(), 100_000);
    assert_eq!(mesh(&book).open_edges, 200_000);
    let plate = quad(DVec3::ZERO, DVec3::X, DVec3::Y);
    assert_eq!(mesh(&vec![plate[0]; MAX_TRIANGLES]).triangles.len(), MAX_TRIANGLES);
    assert!(start.elapsed() < Duration::from_secs(10), "{:?}", start.elapsed());
}

//! Streams decode to what was written, complete or not, and damaged ones are harmless.

use std::io::{Cursor, Read, Write};

use glam::DVec3;
use roost_solver::engine::scene::Scene;
use roost_solver::engine::state::State;
use roost_solver::scenario::Scenario;

use super::*;
use crate::testing::{disturb, hopper_with_fillets, snapshot_at};

fn write(scenario: &Scenario, scene: &Scene, snapshots: &[(f64, Option<f64>, &State)]) -> Vec<u8> {
    let header = Header::new(scenario, scene, 0.06).expect("few sub-particles");
    let mut writer = Writer::new(Vec::new(), &header).expect("memory accepts all bytes");
    for &(simulated_s, belt_time_s, state) in snapshots {
        let packed = writer
            .pack(&snapshot_at(scene, state, &[], simulated_s, belt_time_s))
            .expect("memory accepts all bytes");
        writer.append(&packed).expect("memory accepts all bytes");
    }
    writer.finish().expect("memory accepts all bytes")
}

/// Three frames: all at rest, shaken, and without the first fillet and one sub-particle of the last.
fn three_frames() -> (Scene, [State; 3], Vec<u8>) {
    let (scenario, scene, at_rest) = hopper_with_fillets(3);
    let mut shaken = at_rest.clone();
    disturb(&mut shaken);
    let mut fewer = shaken.clone();
    let first = fewer.bodies.iter().filter(|&&body| body == 0).count() as u32;
    let last = *fewer.serials.last().expect("there are some");
    fewer.remove(&(0..first).chain([last - 3]).collect::<Vec<_>>());
    let snapshots = [(0.0, None, &at_rest), (0.5, Some(0.0), &shaken), (0.75, Some(0.25), &fewer)];
    let bytes = write(&scenario, &scene, &snapshots);
    (scene, [at_rest, shaken, fewer], bytes)
}

fn open(bytes: &[u8]) -> Result<Reader<Cursor<&[u8]>>, Error> {
    Reader::open(Cursor::new(bytes))
}

#[test]
fn decoded_frames_are_within_their_error() {
    let (scene, states, bytes) = three_frames();
    let mut reader = open(&bytes).expect("a stream");
    assert!(reader.is_complete());
    assert_eq!(reader.start_s(), Some(0.5));
    let times: Vec<_> = reader.index().iter().map(|entry| (entry.simulated_s, entry.belt_time_s)).collect();
    assert_eq!(times, [(0.0, None), (0.5, Some(0.0)), (0.75, Some(0.25))]);
    // The gate has a second form, in which it is closed.
    assert_eq!(reader.header().surfaces.len(), scene.surfaces.len() + 1);
    assert_eq!(reader.header().bodies, [0, 1, 2]);

    // In any order: each frame is decoded alone.
    for k in [2, 0, 1] {
        let (state, frame) = (&states[k], reader.frame(k).expect("a frame"));
        assert_eq!(frame.serials, state.serials);
        assert_eq!((frame.simulated_s, frame.belt_time_s), times[k]);
        let bound = (scene.high - scene.low) / 65535.0 / 2.0;
        assert!((frame.error_m - bound).abs().max_element() < 1e-12, "{} {bound}", frame.error_m);
        let top = state.max_speed() as f32;
        for i in 0..state.particles.len() {
            let off = (frame.positions[i] - state.position(i)).abs();
            assert!(off.cmple(frame.error_m * (1.0 + 1e-9)).all(), "{k} {i} {off}");
            let speed = state.particles[i].velocity.length();
            let bound = (speed * top).sqrt() / 255.0 + top / 260_100.0;
            assert!((frame.speeds[i] - speed).abs() <= bound * 1.001, "{k} {i} {speed}");
        }
    }
}

#[test]
fn removed_bodies_and_sub_particles_are_in_no_later_frame() {
    let (_, [_, shaken, fewer], bytes) = three_frames();
    let mut reader = open(&bytes).expect("a stream");
    let numbers = |frame: &Frame| frame.bodies.iter().map(|body| body.number).collect::<Vec<_>>();
    let (before, after) = (reader.frame(1).expect("a frame"), reader.frame(2).expect("a frame"));
    assert_eq!((numbers(&before), numbers(&after)), (vec![0, 1, 2], vec![1, 2]));
    assert_eq!(after.bodies[0], before.bodies[1]);
    assert_eq!(after.bodies[1].subparticles + 1, before.bodies[2].subparticles);
    assert_eq!(after.serials, fewer.serials);
    let broken: u32 =
        (0..shaken.bodies.len()).filter(|&i| shaken.bodies[i] == 1).map(|i| shaken.broken[i]).sum();
    assert_eq!(before.bodies[1].bonds_broken, broken);
}

#[test]
fn sub_particles_outside_the_domain_keep_their_position() {
    for far in [DVec3::new(0.3, 0.0, 1.0), DVec3::new(-0.2, -0.4, 0.0)] {
        let (scenario, scene, mut state) = hopper_with_fillets(1);
        let far = far + if far.x > 0.0 { scene.high } else { scene.low };
        state.particles[5].position = state.frame.encode(far);
        let bytes = write(&scenario, &scene, &[(0.0, None, &state)]);
        let frame = open(&bytes).expect("a stream").frame(0).expect("a frame");
        for i in [5, 9] {
            let off = (frame.positions[i] - state.position(i)).abs();
            assert!(off.cmple(frame.error_m * (1.0 + 1e-9)).all(), "{i} {off}");
        }
        assert!((frame.positions[5] - far).length() < 1e-4);
    }
}

#[test]
fn a_frame_may_be_empty() {
    let (scenario, scene, mut state) = hopper_with_fillets(1);
    state.remove(&state.serials.clone());
    let bytes = write(&scenario, &scene, &[(0.0, None, &state)]);
    let frame = open(&bytes).expect("a stream").frame(0).expect("a frame");
    assert!(frame.bodies.is_empty() && frame.positions.is_empty());
}

#[test]
fn a_truncated_stream_keeps_its_complete_frames() {
    let (_, states, bytes) = three_frames();
    let whole = open(&bytes).expect("a stream");
    let ends: Vec<u64> = whole.index().iter().skip(1).map(|entry| entry.offset).collect();
    let index = u64::from_le_bytes(bytes[bytes.len() - 8..].try_into().expect("eight bytes"));
    let (first, ends) = (whole.index()[0].offset, [ends.as_slice(), &[index]].concat());
    for cut in 0..bytes.len() {
        let there = ends.iter().filter(|&&end| end <= cut as u64).count();
        match open(&bytes[..cut]) {
            Err(error) => assert!((cut as u64) < first, "{cut}: {error}"),
            Ok(mut reader) => {
                assert!(cut as u64 >= first && !reader.is_complete(), "{cut}");
                assert_eq!(reader.index().len(), there, "{cut}");
                if let Some(last) = there.checked_sub(1).filter(|_| cut % 97 == 0) {
                    assert_eq!(reader.frame(last).expect("a frame").serials, states[last].serials, "{cut}");
                }
                assert!(matches!(reader.frame(there), Err(Error::NoFrame { .. })));
            }
        }
    }
}

/// Decodes by the tables of `docs/frames.md`, without the reader.
#[test]
fn bytes_are_as_documented() {
    let (scene, [_, shaken, fewer], bytes) = three_frames();
    let u32_at = |bytes: &[u8], at: usize| u32::from_le_bytes(bytes[at..][..4].try_into().expect("four"));
    let u64_at = |bytes: &[u8], at: usize| u64::from_le_bytes(bytes[at..][..8].try_into().expect("eight"));
    let f64_at = |bytes: &[u8], at: usize| f64::from_bits(u64_at(bytes, at));
    assert_eq!(&bytes[..12], b"ROOSTF\r\nHEAD");
    assert_eq!(bytes[16], b'{');
    let end = bytes.len();
    assert_eq!((&bytes[end - 16..end - 12], u32_at(&bytes, end - 12)), (&b"LAST"[..], 8));
    let index = u64_at(&bytes, end - 8) as usize;
    assert_eq!((&bytes[index..index + 4], u32_at(&bytes, index + 4)), (&b"INDX"[..], 72));
    assert_eq!(index + 8 + 72 + 16, end);
    assert_eq!(
        u64_at(&bytes, index + 8) as usize,
        16 + u32_at(&bytes, 12) as usize,
        "the first after the header"
    );
    assert!(f64_at(&bytes, index + 24).is_nan(), "before the start");

    let at = u64_at(&bytes, index + 8 + 48) as usize;
    let size = u32_at(&bytes, at + 4) as usize;
    assert_eq!((&bytes[at..at + 4], at + 8 + size), (&b"FRAM"[..], index));
    assert_eq!([f64_at(&bytes, at + 8), f64_at(&bytes, at + 16)], [0.75, 0.25]);
    let count = fewer.particles.len();
    assert_eq!(u32_at(&bytes, at + 24) as usize, count);
    let mut body = Vec::new();
    flate2::bufread::ZlibDecoder::new(&bytes[at + 32..index]).read_to_end(&mut body).expect("zlib");
    assert_eq!(body.len(), u32_at(&bytes, at + 28) as usize);
    let corners = [0, 24].map(|at| DVec3::from_array([0, 8, 16].map(|k| f64_at(&body, at + k))));
    assert_eq!(corners, [scene.low, scene.high]);
    let counts = [52, 56, 60, 64, 68].map(|at| u32_at(&body, at) as usize);
    assert_eq!(counts, [2, 1, count, 1, 2], "two bodies, one sub-particle lost; bodies 1 and 2");
    let of_1: u32 =
        (0..shaken.bodies.len()).filter(|&i| shaken.bodies[i] == 1).map(|i| shaken.broken[i]).sum();
    assert_eq!(u32_at(&body, 72), of_1, "bonds broken of the first");
    assert_eq!(u32_at(&body, 80), shaken.serials.last().expect("some") - 3);
    // z of the second sub-particle: from the place of the first.
    let places = &body[84 + 4 * count..84 + 6 * count];
    let d = |i: usize| i32::from(places[i]) + 256 * i32::from(places[count + i]);
    let step = |d: i32| if d % 2 == 0 { d / 2 } else { -(d + 1) / 2 };
    let place = (step(d(0)) + step(d(1))).rem_euclid(65536);
    let z = scene.low.z + f64::from(place) / 65535.0 * (scene.high.z - scene.low.z);
    assert!((z - fewer.position(1).z).abs() < (scene.high.z - scene.low.z) / 131_000.0);
    let (first, top) = (f32::from(body[84 + 6 * count]), fewer.max_speed() as f32);
    let speed = fewer.particles[0].velocity.length();
    assert!((top * (first / 255.0).powi(2) - speed).abs() < 0.005 * top, "{speed} of {top}");
}

/// A stream with another header and without its last chunk, since offsets have changed.
fn with_header(bytes: &[u8], change: impl Fn(&mut serde_json::Value)) -> Vec<u8> {
    let size = u32::from_le_bytes(bytes[12..16].try_into().expect("four bytes")) as usize;
    let mut document = serde_json::from_slice(&bytes[16..16 + size]).expect("JSON");
    change(&mut document);
    let text = serde_json::to_vec(&document).expect("JSON");
    let mut changed = bytes[..12].to_vec();
    changed.extend((text.len() as u32).to_le_bytes());
    changed.extend(text);
    changed.extend(&bytes[16 + size..bytes.len() - 16]);
    changed
}

#[test]
fn impossible_sizes_are_refused_before_allocation() {
    let (.., bytes) = three_frames();
    let offset = open(&bytes).expect("a stream").index()[1].offset as usize;
    let patched = |at: usize, with: &[u8]| {
        let mut bytes = bytes.clone();
        bytes[at..at + with.len()].copy_from_slice(with);
        bytes
    };
    let huge = u32::MAX.to_le_bytes();
    assert!(matches!(open(b""), Err(Error::NotFrames)));
    assert!(matches!(open(&patched(6, b"\n\n")), Err(Error::NotFrames)), "translated line ends");
    assert!(matches!(open(&patched(12, &huge)), Err(Error::Damaged(_))), "a header of 4 GiB");
    let frame = |bytes: &[u8]| open(bytes).expect("a header").frame(1);
    assert!(matches!(frame(&patched(offset + 4, &huge)), Err(Error::Damaged(_))), "a chunk of 4 GiB");
    assert!(matches!(frame(&patched(offset + 24, &huge)), Err(Error::Damaged(_))), "4 G sub-particles");
    assert!(matches!(frame(&patched(offset + 28, &huge)), Err(Error::Damaged(_))), "4 GiB when unpacked");
    let shorter = patched(offset + 28, &1000u32.to_le_bytes());
    assert!(matches!(frame(&shorter), Err(Error::Damaged(_))), "less than what is packed");
    let end = bytes.len() - 8;
    for at in [0u64, 3, u64::MAX, end as u64] {
        let bytes = patched(end, &at.to_le_bytes());
        let reader = open(&bytes).expect("found by walking");
        assert!(!reader.is_complete() && reader.index().len() == 3, "an index at {at}");
    }

    let many = with_header(&bytes, |header| header["kinds"][0]["subparticles"] = u32::MAX.into());
    assert!(matches!(open(&many), Err(Error::TooMany(_))));
    let none = with_header(&bytes, |header| header["bodies"] = serde_json::json!([0, 99]));
    assert!(matches!(open(&none), Err(Error::Damaged(_))));
    let other = with_header(&bytes, |header| header["schema"] = "roost.frames/2".into());
    assert!(matches!(open(&other), Err(Error::Schema(schema)) if schema == "roost.frames/2"));
    let fewer = with_header(&bytes, |header| header["bodies"] = serde_json::json!([0]));
    assert!(frame(&fewer).is_err(), "bodies that the header does not know");
}

/// Decompresses the last frame, changes it and compresses it again.
fn repacked(change: impl Fn(&mut Vec<u8>)) -> Result<Frame, Error> {
    let (.., bytes) = three_frames();
    let index = open(&bytes).expect("a stream").index().to_vec();
    let (first, last) = (index[0].offset as usize, index[2].offset as usize);
    let size = u32::from_le_bytes(bytes[last + 4..last + 8].try_into().expect("four bytes")) as usize;
    let mut body = Vec::new();
    flate2::bufread::ZlibDecoder::new(&bytes[last + 32..last + 8 + size])
        .read_to_end(&mut body)
        .expect("zlib");
    change(&mut body);
    let mut zlib = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::fast());
    zlib.write_all(&body).expect("memory accepts all bytes");
    let packed = zlib.finish().expect("memory accepts all bytes");
    let mut changed = bytes[..first].to_vec();
    changed.extend(FRAME);
    changed.extend((packed.len() as u32 + 24).to_le_bytes());
    changed.extend(&bytes[last + 8..last + 28]);
    changed.extend((body.len() as u32).to_le_bytes());
    changed.extend(packed);
    open(&changed).expect("a stream").frame(0)
}

#[test]
fn inconsistent_frame_bodies_are_refused() {
    let fault = |result: Result<Frame, Error>| match result {
        Err(Error::Damaged(what)) => what,
        other => panic!("{other:?}"),
    };
    assert!(repacked(|_| ()).is_ok_and(|frame| frame.bodies.len() == 2));
    let bomb = repacked(|body| body.resize(50_000_000, 0));
    assert!(fault(bomb).contains("longer than its bodies"), "50 MB of zeros in 50 kB");
    assert!(fault(repacked(|body| body.truncate(40))).contains("too short"));
    let mut cases: Vec<(usize, u32, &str)> =
        vec![(64, 3, "ascending"), (64, 2, "ascending"), (68, 9, "header")];
    cases.extend([(80, 0, "missing"), (52, 3, "length"), (60, 7, "length")]);
    for (at, value, expected) in cases {
        let text = fault(repacked(|body| body[at..at + 4].copy_from_slice(&value.to_le_bytes())));
        assert!(text.contains(expected), "{value} at {at}: {text}");
    }
    for (at, value) in [(0, f64::NAN), (24, f64::INFINITY), (24, -1e9)] {
        let text = fault(repacked(|body| body[at..at + 8].copy_from_slice(&value.to_le_bytes())));
        assert!(text.contains("box"), "{value} at {at}: {text}");
    }
}

#[test]
fn flipped_bytes_give_at_most_an_error() {
    let (.., bytes) = three_frames();
    let (mut opened, mut refused) = (0, 0);
    // A linear congruential generator: the same flips every time.
    let mut random = 12345u64;
    let mut next = |below: usize| {
        random = random.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (random >> 33) as usize % below
    };
    for _ in 0..3000 {
        let mut bytes = bytes.clone();
        for _ in 0..=next(3) {
            let at = next(bytes.len());
            bytes[at] = next(256) as u8;
        }
        match open(&bytes) {
            Ok(mut reader) => {
                opened += 1;
                for k in 0..reader.index().len() {
                    refused += u32::from(reader.frame(k).is_err());
                }
            }
            Err(_) => refused += 1,
        }
    }
    assert!(opened > 500 && refused > 500, "{opened} {refused}: both must have been seen");
}

#[test]
fn equal_snapshots_give_equal_bytes() {
    assert_eq!(three_frames().2, three_frames().2);
}

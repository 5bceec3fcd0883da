//! Reader of the frame stream: every frame of a stream that opens is valid or refused.
#![no_main]

use std::io::Cursor;

use libfuzzer_sys::fuzz_target;
use roost_frames::web::Reader;

/// Frames of a stream that are looked at: a file of any length can name the same one over and over.
const MOST_FRAMES: usize = 64;

fuzz_target!(|bytes: &[u8]| {
    let Ok(mut stream) = Reader::open(Cursor::new(bytes)) else { return };
    let _ = stream.start_s();
    for number in 0..stream.index().len().min(MOST_FRAMES) {
        let Ok(frame) = stream.frame(number) else { continue };
        let there: usize = frame.bodies.iter().map(|body| body.subparticles as usize).sum();
        assert_eq!(there, frame.serials.len());
        assert_eq!(there, frame.positions.len());
        assert_eq!(there, frame.speeds.len());
        assert!(frame.positions.iter().all(|position| position.is_finite()));
        assert!(frame.speeds.iter().all(|speed| speed.is_finite()));
    }
});

//! Compact encoding of positions and speeds: quantised, as differences, with low and high bytes apart.
//!
//! Sub-particles are in the order of their lattice, so that most are 2R from the one before, and the high bytes of differences compress well.
//! Zlib saves a quarter at rest and two thirds in free fall.

/// Steps across the box.
const STEPS: f64 = 65535.0;
/// Steps from rest to the maximum speed.
const SPEED_STEPS: f32 = 255.0;

/// The nearest of 65,536 steps from `low` to `high`; the error is at most half a step.
pub(super) fn quantise(x: f64, low: f64, high: f64) -> u16 {
    ((x - low) / (high - low) * STEPS).round() as u16
}

/// The coordinate of a step.
pub(super) fn restore(place: u16, low: f64, high: f64) -> f64 {
    low + f64::from(place) / STEPS * (high - low)
}

/// Maximum error of a quantised coordinate.
pub(super) fn error(low: f64, high: f64) -> f64 {
    (high - low) / STEPS / 2.0
}

/// A speed on a square-root scale, which resolves slow speeds beside fast ones.
pub(super) fn quantise_speed(speed: f32, top: f32) -> u8 {
    if top > 0.0 { (SPEED_STEPS * (speed / top).sqrt()).round() as u8 } else { 0 }
}

/// The speed of a step.
pub(super) fn restore_speed(step: u8, top: f32) -> f32 {
    top * (f32::from(step) / SPEED_STEPS).powi(2)
}

/// Appends an axis: differences in zigzag encoding, first all low bytes, then all high bytes.
pub(super) fn pack_places(places: &[u16], out: &mut Vec<u8>) {
    let mut last = 0u16;
    let differences: Vec<u16> = places
        .iter()
        .map(|&place| {
            let step = place.wrapping_sub(std::mem::replace(&mut last, place)).cast_signed();
            ((step << 1) ^ (step >> 15)).cast_unsigned()
        })
        .collect();
    out.extend(differences.iter().map(|d| d.to_le_bytes()[0]));
    out.extend(differences.iter().map(|d| d.to_le_bytes()[1]));
}

/// Decodes an axis.
pub(super) fn unpack_places(low: &[u8], high: &[u8]) -> Vec<u16> {
    let mut last = 0u16;
    let places = low.iter().zip(high).map(|(&low, &high)| {
        let d = u16::from_le_bytes([low, high]);
        last = last.wrapping_add((d >> 1) ^ (d & 1).wrapping_neg());
        last
    });
    places.collect()
}

/// Appends speeds: differences from one to the next.
pub(super) fn pack_speeds(speeds: &[u8], out: &mut Vec<u8>) {
    let mut last = 0u8;
    out.extend(speeds.iter().map(|&speed| speed.wrapping_sub(std::mem::replace(&mut last, speed))));
}

/// Decodes speeds.
pub(super) fn unpack_speeds(bytes: &[u8]) -> impl Iterator<Item = u8> + '_ {
    bytes.iter().scan(0u8, |last, &difference| {
        *last = last.wrapping_add(difference);
        Some(*last)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn encoded_places_and_speeds_decode_to_the_same() {
        let places = [0, 65535, 0, 32768, 32767, 1, 1, 40000, 65535, 65534];
        let mut bytes = Vec::new();
        pack_places(&places, &mut bytes);
        assert_eq!(unpack_places(&bytes[..10], &bytes[10..]), places);
        // 0 → 1 → 0: differences of +1 and -1 are written as 2 and 1.
        bytes.clear();
        pack_places(&[1, 0, 300], &mut bytes);
        assert_eq!(bytes, [2, 1, 88, 0, 0, 2], "low bytes, then high bytes; 300 is 600 = 2 · 256 + 88");
        bytes.clear();
        pack_speeds(&[3, 1, 255], &mut bytes);
        assert_eq!(bytes, [3, 254, 254]);
        assert!(unpack_speeds(&bytes).eq([3, 1, 255]));
    }

    #[test]
    fn quantisation_error_is_at_most_half_a_step() {
        let (low, high) = (-0.4, 1.7);
        for k in 0..=1000 {
            let x = low + (high - low) * f64::from(k) / 1000.0;
            let back = restore(quantise(x, low, high), low, high);
            assert!((back - x).abs() <= error(low, high) * (1.0 + 1e-9), "{x} {back}");
        }
        assert_eq!([quantise(low, low, high), quantise(high, low, high)], [0, 65535]);
    }

    #[test]
    fn slow_and_fast_speeds_are_resolved() {
        for (speed, top) in [(0.0, 4.0), (4.0, 4.0), (0.001, 4.0), (0.5, 4.0), (2e-5, 2e-5)] {
            let back = restore_speed(quantise_speed(speed, top), top);
            // Half a step of the root is (√speed ± √top / 510)².
            let bound = (speed * top).sqrt() / 255.0 + top / 260_100.0;
            assert!((back - speed).abs() <= bound * 1.001, "{speed} of {top}: {back}");
        }
        assert_eq!(quantise_speed(0.0, 0.0), 0);
    }
}

//! Arrays of [`WIDTH`] numbers in memory: the unit of work of every kernel.
//!
//! [`Lanes`] hold one number per element; [`Quads`] hold four numbers per element, element after element.

use glam::IVec3;
use pulp::bytemuck::Pod;
use pulp::cast;

/// Elements per array: a multiple of the lanes of every instruction set.
pub(crate) const WIDTH: usize = 16;

/// One number per element.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Lanes(pub(crate) [f32; WIDTH]);

impl Lanes {
    /// All zero.
    pub(crate) const ZERO: Self = Self([0.0; WIDTH]);

    /// Transposed position of each lane (see [`transposed_lane`]).
    pub(crate) const TRANSPOSED: Self = {
        let mut place = [0.0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            place[k] = transposed_lane(k) as f32;
            k += 1;
        }
        Self(place)
    };
}

/// One vector per element.
pub(crate) type Lanes3 = [Lanes; 3];

/// One integer per element.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(align(64))]
pub(crate) struct Ints(pub(crate) [i32; WIDTH]);

/// One index per element. As positions in a window of two blocks, indices below [`WIDTH`] are in the first
/// block.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct LaneIndices(pub(crate) [u32; WIDTH]);

impl LaneIndices {
    /// The identity permutation.
    pub(crate) const IDENTITY: Self = {
        let mut each = [0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            each[k] = k as u32;
            k += 1;
        }
        Self(each)
    };

    /// The permutation of [`transposed_lane`].
    pub(crate) const TRANSPOSED: Self = {
        let mut each = [0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            each[k] = transposed_lane(k) as u32;
            k += 1;
        }
        Self(each)
    };
}

/// [`WIDTH`] indices below 16, four bits each: even lanes in the lower half, odd lanes in the upper half.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PackedIndices(pub(crate) u64);

impl PackedIndices {
    fn shift(lane: usize) -> usize {
        32 * (lane % 2) + 4 * (lane / 2)
    }

    /// Index of a lane.
    pub(crate) fn of(self, lane: usize) -> u32 {
        (self.0 >> Self::shift(lane)) as u32 & 15
    }

    /// Sets the index of a lane that was 0.
    pub(crate) fn put(&mut self, lane: usize, number: u32) {
        self.0 |= u64::from(number) << Self::shift(lane);
    }
}

/// Four numbers per element, element after element.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Quads(pub(crate) [[f32; 4]; WIDTH]);

/// Position of a lane's numbers among [`Quads`], and its inverse. 4 × 4 positions are transposed: registers
/// of every width can do this without crossing 128-bit quarters.
#[inline(always)]
pub(crate) const fn transposed_lane(lane: usize) -> usize {
    lane % 4 * 4 + lane / 4
}

/// Bits of lanes, moved to the positions of [`transposed_lane`].
#[inline(always)]
pub(crate) const fn transposed_bits(lanes: u16) -> u16 {
    let swap = (lanes ^ lanes >> 3) & 0x0a0a;
    let half = lanes ^ swap ^ swap << 3;
    let swap = (half ^ half >> 6) & 0x00cc;
    half ^ swap ^ swap << 6
}

impl Quads {
    /// All zero.
    pub(crate) const ZERO: Self = Self([[0.0; 4]; WIDTH]);

    /// The `b`th group of [`WIDTH`] elements.
    #[inline(always)]
    pub(crate) fn of<T: Pod>(many: &[[T; 4]], b: usize) -> Self {
        let these: [[T; 4]; WIDTH] = many[b * WIDTH..][..WIDTH].try_into().expect("as many as asked for");
        // One wide copy. Narrow stores followed by wide loads would stall.
        Self(cast(these))
    }
}

/// Two vectors per element, each padded by one number, element after element.
pub(crate) type Octets = [[f32; 8]; WIDTH];

/// The `b`th group of [`WIDTH`] elements.
#[inline(always)]
pub(crate) fn octets(many: &[[f32; 8]], b: usize) -> &Octets {
    many[b * WIDTH..][..WIDTH].try_into().expect("as many as asked for")
}

/// The first `count` elements of a vector that only grows. Their content is arbitrary, which saves
/// initialization.
#[inline(always)]
pub(crate) fn grown<T: Copy + Default>(of: &mut Vec<T>, count: usize) -> &mut [T] {
    if of.len() < count {
        of.resize(count, T::default());
    }
    &mut of[..count]
}

/// Positions relative to `from`, in metres.
#[inline(always)]
pub(crate) fn in_metres(positions: &[Ints; 3], from: IVec3, unit_m: f32) -> Lanes3 {
    let mut metres = [Lanes::ZERO; 3];
    for axis in 0..3 {
        for k in 0..WIDTH {
            metres[axis].0[k] = positions[axis].0[k].wrapping_sub(from[axis]) as f32 * unit_m;
        }
    }
    metres
}

/// Reduction by halves, in the order of a register reduction.
#[inline(always)]
pub(crate) fn reduced<T: Copy>(mut of: [T; WIDTH], put: impl Fn(T, T) -> T) -> T {
    let mut half = WIDTH / 2;
    while half > 0 {
        for k in 0..half {
            of[k] = put(of[k], of[k + half]);
        }
        half /= 2;
    }
    of[0]
}

/// The larger number; the first one if either is NaN.
#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn transposed_bits_match_transposed_lanes() {
        for lane in 0..WIDTH {
            assert_eq!(transposed_bits(1 << lane), 1 << transposed_lane(lane), "{lane}");
            assert_eq!(transposed_lane(transposed_lane(lane)), lane);
        }
    }
}

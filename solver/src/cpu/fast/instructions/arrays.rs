//! Arrays of [`WIDTH`] numbers in memory: the unit of work of every kernel.
//!
//! [`Lanes`] hold one number per element; [`Quads`] hold four numbers per element, element after element.

use glam::IVec3;
use pulp::bytemuck::Pod;
use pulp::cast;

/// Pairs that are worked on together: a multiple of the lanes of every instruction set.
pub(crate) const WIDTH: usize = 16;

/// One number of each of [`WIDTH`] pairs, in memory.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(align(64))]
pub(crate) struct Lanes(pub(crate) [f32; WIDTH]);

impl Lanes {
    /// All zero.
    pub(crate) const ZERO: Self = Self([0.0; WIDTH]);

    /// The place of each lane in the order of quads (see [`transposed_lane`]).
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

/// A vector of each of [`WIDTH`] pairs, in memory.
pub(crate) type Lanes3 = [Lanes; 3];

/// One whole number of each of [`WIDTH`] sub-particles, in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(align(64))]
pub(crate) struct Ints(pub(crate) [i32; WIDTH]);

/// A whole number in each lane; as places in a window of two blocks, as_range under [`WIDTH`] are in the first.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct LaneIndices(pub(crate) [u32; WIDTH]);

impl LaneIndices {
    /// Each lane its own number.
    pub(crate) const IDENTITY: Self = {
        let mut each = [0; WIDTH];
        let mut k = 0;
        while k < WIDTH {
            each[k] = k as u32;
            k += 1;
        }
        Self(each)
    };

    /// The lane whose numbers stand at each place (see [`transposed_lane`]).
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

/// [`WIDTH`] numbers below 16, four bits each: as_range of even lanes in the lower half, as_range of odd lanes in the upper.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct PackedIndices(pub(crate) u64);

impl PackedIndices {
    fn shift(lane: usize) -> usize {
        32 * (lane % 2) + 4 * (lane / 2)
    }

    /// The number of a lane, in the four lowest bits.
    pub(crate) fn of(self, lane: usize) -> u32 {
        (self.0 >> Self::shift(lane)) as u32 & 15
    }

    /// Puts a number where there was 0.
    pub(crate) fn put(&mut self, lane: usize, number: u32) {
        self.0 |= u64::from(number) << Self::shift(lane);
    }
}

/// Four numbers of each of [`WIDTH`] things, one thing after the other.
#[derive(Clone, Copy, Debug)]
#[repr(align(64))]
pub(crate) struct Quads(pub(crate) [[f32; 4]; WIDTH]);

/// Where a lane's numbers stand among [`Quads`], and the lane whose numbers stand there: 4 × 4 places are transposed,
/// since that is what registers of every width can do without crossing quarters.
#[inline(always)]
pub(crate) const fn transposed_lane(lane: usize) -> usize {
    lane % 4 * 4 + lane / 4
}

/// The bits of lanes, at the places of [`transposed_lane`].
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

    /// The `b`th [`WIDTH`] of many.
    #[inline(always)]
    pub(crate) fn of<T: Pod>(many: &[[T; 4]], b: usize) -> Self {
        let these: [[T; 4]; WIDTH] = many[b * WIDTH..][..WIDTH].try_into().expect("as many as asked for");
        // Whole, since what is copied in connected_components cannot be read at once in large ones.
        Self(cast(these))
    }
}

/// SearchSides vectors of each of [`WIDTH`] things, one thing after the other, each with one more number.
pub(crate) type Octets = [[f32; 8]; WIDTH];

/// The `b`th [`WIDTH`] of many.
#[inline(always)]
pub(crate) fn octets(many: &[[f32; 8]], b: usize) -> &Octets {
    many[b * WIDTH..][..WIDTH].try_into().expect("as many as asked for")
}

/// So much of a vector, which may hold anything: what only grows need not be filled each time.
#[inline(always)]
pub(crate) fn grown<T: Copy + Default>(of: &mut Vec<T>, count: usize) -> &mut [T] {
    if of.len() < count {
        of.resize(count, T::default());
    }
    &mut of[..count]
}

/// Positions side by side, in metres from one.
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

/// All of a row put together, in halves, as registers do it.
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

/// The larger; the first where either is not a number.
#[inline(always)]
pub(crate) fn larger(a: f32, b: f32) -> f32 {
    if b > a { b } else { a }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bits_of_lanes_go_to_their_places() {
        for lane in 0..WIDTH {
            assert_eq!(transposed_bits(1 << lane), 1 << transposed_lane(lane), "{lane}");
            assert_eq!(transposed_lane(transposed_lane(lane)), lane);
        }
    }
}

//! Software prefetch. Without it a core waits for one cache line after the other.

use std::ops::Range;

/// Number of parts in which a body prefetches the data of the next one. A core has about twenty line requests
/// in flight.
pub(crate) const PARTS: usize = 8;

/// Range of the `k`th of `n` nearly equal parts of `count` elements.
#[inline(always)]
pub(crate) fn part_range(count: usize, k: usize, n: usize) -> Range<usize> {
    k * count / n..(k + 1) * count / n
}

/// The `k`th of `n` nearly equal parts of a slice.
#[inline(always)]
pub(crate) fn part<T>(of: &[T], k: usize, n: usize) -> &[T] {
    &of[part_range(of.len(), k, n)]
}

/// Size of a cache line, in bytes.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Prefetches data for use soon, into all cache levels.
#[inline(always)]
pub(crate) fn to_l1<T>(wanted: &[T]) {
    #[cfg(target_arch = "x86_64")]
    lines::<{ std::arch::x86_64::_MM_HINT_T0 }, T>(wanted);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = wanted;
}

/// Prefetches data for later use, into the second cache level.
#[inline(always)]
pub(crate) fn to_l2<T>(wanted: &[T]) {
    #[cfg(target_arch = "x86_64")]
    lines::<{ std::arch::x86_64::_MM_HINT_T1 }, T>(wanted);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = wanted;
}

#[cfg(target_arch = "x86_64")]
#[inline(always)]
fn lines<const HINT: i32, T>(wanted: &[T]) {
    // Every x86-64 processor has SSE.
    let Some(sse) = pulp::core_arch::x86::Sse::try_new() else { return };
    // From the start of the first line, so that short slices do not lose their last line.
    let into_line = wanted.as_ptr().addr() % LINE;
    let first = wanted.as_ptr().cast::<i8>().wrapping_sub(into_line);
    let end = if wanted.is_empty() { 0 } else { into_line + size_of_val(wanted) };
    for line in (0..end).step_by(LINE) {
        sse._mm_prefetch::<HINT>(first.wrapping_add(line));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_cover_the_whole_slice_in_order() {
        let of: Vec<u8> = (0..21).collect();
        let parts: Vec<u8> = (0..PARTS).flat_map(|k| part(&of, k, PARTS)).copied().collect();
        assert_eq!(parts, of);
    }
}

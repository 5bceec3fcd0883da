//! Software prefetch. Without it a core would wait for one cache line after the other.

use std::ops::Range;

/// Parts in which a body fetches what the next one needs, while it works: memory can be asked for some twenty lines at a time.
pub(crate) const PARTS: usize = 8;

/// The `k`th of `n` parts of so many, nearly equal.
#[inline(always)]
pub(crate) fn span(count: usize, k: usize, n: usize) -> Range<usize> {
    k * count / n..(k + 1) * count / n
}

/// The same of some.
#[inline(always)]
pub(crate) fn part<T>(of: &[T], k: usize, n: usize) -> &[T] {
    &of[span(of.len(), k, n)]
}

/// Bytes that come from memory together.
#[cfg(target_arch = "x86_64")]
const LINE: usize = 64;

/// Asks for what will be wanted soon.
#[inline(always)]
pub(crate) fn to_l1<T>(wanted: &[T]) {
    #[cfg(target_arch = "x86_64")]
    lines::<{ std::arch::x86_64::_MM_HINT_T0 }, T>(wanted);
    #[cfg(not(target_arch = "x86_64"))]
    let _ = wanted;
}

/// Asks for what will be wanted later: it comes no nearer than the second level of the cache.
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
    // Every processor of this kind has it.
    let Some(sse) = pulp::core_arch::x86::Sse::try_new() else { return };
    // From where its first line begins: short connected_components would else lose their last.
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
    fn parts_are_all() {
        let of: Vec<u8> = (0..21).collect();
        let parts: Vec<u8> = (0..PARTS).flat_map(|k| part(&of, k, PARTS)).copied().collect();
        assert_eq!(parts, of);
    }
}

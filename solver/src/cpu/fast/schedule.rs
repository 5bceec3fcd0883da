//! The order and the chunks in which threads take bodies.

use std::sync::{Mutex, MutexGuard};

use glam::IVec3;

use crate::cpu::fast::storage::bounds::FixedAabb;

/// Minimum and maximum number of bodies per task. Bodies differ in cost, which favours small tasks at the end
/// of a phase. Within a task a body prefetches data for the next one, which favours large tasks.
const BODIES_PER_TASK: [usize; 2] = [2, 16];

/// Number of tasks per thread and phase, given enough bodies.
const TASKS_PER_THREAD: usize = 64;

/// Minimum number of tasks per thread before a task takes several bodies.
const MIN_TASKS_PER_THREAD: usize = 4;

/// Number of bodies per task.
pub(crate) fn bodies_per_task(bodies: usize) -> usize {
    let [least, most] = BODIES_PER_TASK;
    let threads = rayon::current_num_threads();
    // With few bodies every thread should get some.
    (bodies / (TASKS_PER_THREAD * threads))
        .clamp(least.min(bodies / (MIN_TASKS_PER_THREAD * threads)).max(1), most)
}

/// Bits per coordinate of the Morton code.
const BITS: u32 = 10;

/// Scratch memory per thread, kept from step to step.
#[derive(Debug)]
pub(crate) struct PerThread<T>(Vec<Mutex<T>>);

impl<T> Default for PerThread<T> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<T: Default> PerThread<T> {
    /// Adds the elements that threads of this pool lack.
    pub(crate) fn resize_to_pool(&mut self) {
        self.0.resize_with(rayon::current_num_threads(), Mutex::default);
    }

    /// Element of the current thread, which must be in the pool. No other thread takes it.
    pub(crate) fn current(&self) -> MutexGuard<'_, T> {
        let thread = rayon::current_thread_index().expect("bodies are worked on in the pool");
        self.0[thread].lock().expect("whoever had it has finished")
    }
}

/// Bodies in Morton order of their centres, so that neighbours in space share the cache.
pub(crate) fn morton_order(aabbs: &[FixedAabb]) -> Vec<u32> {
    let middles: Vec<IVec3> = aabbs.iter().map(|aabb| (aabb.low >> 1) + (aabb.high >> 1)).collect();
    let low = middles.iter().copied().fold(IVec3::MAX, IVec3::min);
    let high = middles.iter().copied().fold(IVec3::MIN, IVec3::max);
    let widest = u64::from(high.wrapping_sub(low).as_uvec3().max_element()) + 1;
    let key = |middle: &IVec3| {
        let cell = middle.wrapping_sub(low).as_uvec3().to_array().map(|d| (u64::from(d) << BITS) / widest);
        let bits = (0..BITS).rev().flat_map(|bit| cell.map(|along| along >> bit & 1));
        bits.fold(0u32, |key, bit| key << 1 | bit as u32)
    };
    let mut order: Vec<u32> = (0..middles.len() as u32).collect();
    order.sort_by_cached_key(|&body| key(&middles[body as usize]));
    order
}

/// Elements of all bodies in the given order.
pub(crate) fn permuted<T>(order: &[u32], of_each: impl Iterator<Item = T>) -> Vec<T> {
    let mut of_each: Vec<Option<T>> = of_each.map(Some).collect();
    order.iter().map(|&body| of_each[body as usize].take().expect("each comes once")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn morton_order_puts_neighbouring_bodies_next_to_each_other() {
        let at = |x, y, z| FixedAabb { low: IVec3::new(x, y, z), high: IVec3::new(x + 2, y + 2, z + 2) };
        let far = 1 << 20;
        let bodies = [at(0, 0, 0), at(far, far, far), at(1, 0, 0), at(far, far, far - 1), at(0, 0, far)];
        let order = morton_order(&bodies);
        let place = |body: u32| order.iter().position(|&at| at == body).unwrap();
        assert_eq!(place(0).abs_diff(place(2)), 1, "{order:?}");
        assert_eq!(place(1).abs_diff(place(3)), 1, "{order:?}");
        assert_eq!(permuted(&[2, 0, 1], ["a", "b", "c"].into_iter()), ["c", "a", "b"]);
    }
}

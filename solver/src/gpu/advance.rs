//! Advances a batch by a chunk of steps. A chunk is repeated until its lists were long enough and never
//! stale.

use std::time::{Duration, Instant};

use super::arena::{Arena, BatchInputs, arena_bytes, largest_buffer};
use super::device::Device;
use super::layout::{MAX_NEIGHBOURS, NONE, Report, Scene};
use super::memory_budget::bytes_of;
use super::neighbour_list::RowCapacity;
use super::pipelines::Pipelines;
use super::run::Run;
use super::run_buffers::{ElementCounts, RunBuffers};
use crate::cpu::integrate::fault;
use crate::engine::{AdvanceReport, OutOfDeviceMemory};

/// Maximum steps of a chunk. Bounds the work that a repetition costs.
pub(super) const MAX_CHUNK_STEPS: u64 = 256;

/// Maximum steps between two rebuilds of the lists.
const MAX_INTERVAL: u32 = 64;

/// Share of half the skin that the next rebuild interval aims at.
const DRIFT_TARGET: f32 = 0.8;

/// A run with steps to do.
#[derive(Debug)]
pub(super) struct Task {
    pub(super) run: Box<Run>,
    /// Requested steps.
    pub(super) steps: u64,
    /// Maximum steps of its next chunk.
    pub(super) max_steps: u64,
    pub(super) done: AdvanceReport,
}

impl Task {
    pub(super) fn is_done(&self) -> bool {
        self.done.steps >= self.steps || self.run.fault.is_some()
    }

    /// Steps of the next chunk.
    pub(super) fn next(&self) -> u64 {
        (self.steps - self.done.steps).min(self.max_steps)
    }

    pub(super) fn particles(&self) -> u64 {
        u64::from(self.run.buffers.elements.particles)
    }

    /// Whether the next chunk is its last.
    fn is_last_chunk(&self) -> bool {
        self.done.steps + self.next() == self.steps
    }

    /// Where to send what observers read, after the last chunk.
    fn read_back(&self) -> Option<&wgpu::Buffer> {
        self.run.staging.as_ref().filter(|_| self.is_last_chunk())
    }

    /// Its element counts for a chunk.
    fn elements(&self) -> ElementCounts {
        let poses = if self.run.moves() { self.next() as u32 } else { 1 };
        ElementCounts { poses: poses * self.run.buffers.elements.surfaces, ..self.run.buffers.elements }
    }

    /// Records the result of a chunk.
    fn account(&mut self, device: &Device, report: &Report) {
        let (steps, run) = (self.next(), &mut self.run);
        let steps = if report.fault_step.0 == NONE { steps } else { u64::from(report.fault_step.0) + 1 };
        run.steps_done(steps);
        run.bonds_broken += u64::from(report.broken.0);
        self.done.passed_through += u64::from(report.passed.0);
        self.done.steps += steps;
        self.done.particle_steps += steps * u64::from(run.buffers.elements.particles);
        self.done.max_overlap_m = self.done.max_overlap_m.max(f32::from_bits(report.overlap.0));
        if report.fault_step.0 != NONE {
            let limit = run.speed_limit;
            run.fault = Some(fault(report.runaway.0 as usize, limit, run.state(device)));
        }
    }
}

/// Number of leading tasks that fit into one set of buffers, which replaces the last one; at least 1.
pub(super) fn runs_that_fit<'a>(
    device: &Device,
    last: Option<&Arena>,
    tasks: impl Iterator<Item = &'a Task>,
) -> usize {
    let left = device.memory.available().saturating_add(last.map_or(0, Arena::bytes));
    let (mut sum, mut row_capacity, mut all_buffers) = (ElementCounts::default(), RowCapacity::default(), 0);
    let fits = |task: &Task| {
        let buffers = &task.run.buffers;
        sum = sum.each(task.elements(), u32::saturating_add);
        row_capacity = row_capacity.max(buffers.row_capacity);
        all_buffers += bytes_of(buffers.elements.sizes(buffers.row_capacity));
        // The rows of all runs become as long as the longest.
        let longer = bytes_of(sum.sizes(row_capacity)).saturating_sub(all_buffers);
        largest_buffer(&sum, row_capacity) <= device.largest_buffer
            && longer + arena_bytes(&sum, row_capacity) <= left
    };
    tasks.map(fits).take_while(|fits| *fits).count().max(1)
}

/// Advances each task by a chunk, or by the rest of its steps. Returns the time on the device, of the last
/// attempt.
pub(super) fn chunk(
    device: &Device,
    pipelines: &Pipelines,
    arena: &mut Option<Arena>,
    tasks: &mut [&mut Task],
) -> Result<Duration, OutOfDeviceMemory> {
    let longest = tasks.iter().map(|task| task.next()).max().unwrap_or(0) as u32;
    let sum = tasks
        .iter()
        .map(|task| task.elements())
        .fold(ElementCounts::default(), |sum, elements| sum.each(elements, |a, b| a + b));
    let inputs = inputs(tasks);
    // Of an earlier chunk.
    tasks.iter_mut().for_each(|task| task.run.read_back = None);
    let mut row_capacity =
        tasks.iter().map(|task| task.run.buffers.row_capacity).fold(RowCapacity::default(), RowCapacity::max);
    loop {
        // Free the batch buffers before rows become longer. The run buffers hold all data.
        arena.take_if(|arena| !arena.has(row_capacity));
        tasks.iter_mut().try_for_each(|task| task.run.buffers.lengthen(device, row_capacity))?;
        let interval = tasks.iter().map(|task| task.run.interval.min(task.run.max_interval())).min();
        let interval = interval.unwrap_or(1).clamp(1, longest);
        let arena = ensure_arena(device, pipelines, arena, sum, row_capacity)?;
        let all_buffers: Vec<&RunBuffers> = tasks.iter().map(|task| &task.run.buffers).collect();
        let clock = Instant::now();
        let reports = arena.advance(device, pipelines, &all_buffers, &inputs, longest, interval);
        let took = clock.elapsed();
        let wanted = |of: fn(&Report) -> u32| reports.iter().map(of).max().unwrap_or(0);
        let (pairs, walls) = (wanted(|report| report.pairs.0), wanted(|report| report.walls.0));
        let held = row_capacity.max(RowCapacity::holding(pairs.min(MAX_NEIGHBOURS), walls));
        if held != row_capacity {
            row_capacity = held;
        } else if reports.iter().any(|report| report.stale.0 != 0) {
            tasks.iter_mut().for_each(|task| task.run.interval = (interval / 2).max(1));
        } else if refuse_crowded(tasks, &reports) {
            return Ok(took);
        } else {
            // Without, an observer reads by itself.
            let last = tasks.iter_mut().filter(|task| task.is_last_chunk());
            last.for_each(|task| drop(task.run.make_staging(device)));
            let runs: Vec<_> = tasks.iter().map(|task| (&task.run.buffers, task.read_back())).collect();
            let submitted = arena.unload(device, &runs, longest, interval);
            for (task, report) in tasks.iter_mut().zip(&reports) {
                task.run.read_back = task.read_back().map(|_| submitted.clone());
                let drift = f32::from_bits(report.drift.0);
                task.run.interval =
                    next_interval(interval, task.run.interval, drift, task.run.scene.half_skin);
                task.account(device, report);
            }
            return Ok(took);
        }
    }
}

/// Ends the runs in which a sub-particle has more neighbours than a row can hold, at their last valid chunk. Returns whether
/// there are any.
fn refuse_crowded(tasks: &mut [&mut Task], reports: &[Report]) -> bool {
    let crowded = tasks.iter_mut().zip(reports).filter(|(_, report)| report.pairs.0 > MAX_NEIGHBOURS);
    let refuse = |(task, _): (&mut &mut Task, &Report)| {
        task.run.fault = Some(format!(
            "a sub-particle has more than {MAX_NEIGHBOURS} neighbours, the limit of the GPU backend; use the CPU backend"
        ));
    };
    crowded.map(refuse).count() > 0
}

/// Removes sub-particles from a run: `map` holds the new index of each, or [`NONE`].
pub(super) fn remove(
    device: &Device,
    pipelines: &Pipelines,
    arena: &mut Option<Arena>,
    run: Box<Run>,
    map: &[u32],
) -> Result<Box<Run>, OutOfDeviceMemory> {
    let mut task = Task { run, steps: 0, max_steps: 0, done: AdvanceReport::default() };
    let (inputs, row_capacity) = (inputs(&mut [&mut task]), task.run.buffers.row_capacity);
    let elements = task.elements();
    // Longer rows do, too: the run is alone.
    let longer = arena.as_ref().map_or(row_capacity, |arena| arena.row_capacity().max(row_capacity));
    let fits = arena.as_ref().is_some_and(|arena| arena.holds(elements, longer));
    let row_capacity = if fits { longer } else { row_capacity };
    let arena = ensure_arena(device, pipelines, arena, elements, row_capacity)?;
    arena.remove(device, pipelines, &mut task.run.buffers, &inputs, map);
    Ok(task.run)
}

/// Rebuild interval after a `drift` within `interval` steps. It aims at most of half the skin. It is at most
/// twice as long, or `known`: an interval that held before a short chunk or another run shortened it.
fn next_interval(interval: u32, known: u32, drift: f32, half_skin: f32) -> u32 {
    let aim = DRIFT_TARGET * half_skin / drift.max(1e-12) * interval as f32;
    (aim as u32).clamp(1, (2 * interval).max(known).min(MAX_INTERVAL))
}

/// Collects the inputs of all tasks.
fn inputs(tasks: &mut [&mut Task]) -> BatchInputs {
    let (mut inputs, mut sum) = (BatchInputs::default(), ElementCounts::default());
    for (number, task) in (0u32..).zip(tasks) {
        let (elements, steps) = (task.elements(), task.next());
        let surfaces = elements.surfaces;
        inputs.scenes.push(Scene {
            first_cell: sum.cells,
            first: sum.particles,
            first_moments: sum.moments,
            count: elements.particles,
            steps: steps as u32,
            first_surface: sum.surfaces,
            surfaces,
            first_pose: sum.poses,
            pose_stride: if task.run.moves() { surfaces } else { 0 },
            first_facet: sum.facets,
            first_corner: sum.corners,
            first_node: sum.nodes,
            first_leaf: sum.leaves,
            ..task.run.scene
        });
        inputs.scene_of.resize(inputs.scene_of.len() + elements.particles as usize, number);
        inputs.poses.extend(task.run.poses(steps));
        sum = sum.each(elements, |a, b| a + b);
    }
    inputs
}

/// The arena, replaced if it is too small or its rows have another length.
fn ensure_arena<'a>(
    device: &Device,
    pipelines: &Pipelines,
    arena: &'a mut Option<Arena>,
    elements: ElementCounts,
    row_capacity: RowCapacity,
) -> Result<&'a Arena, OutOfDeviceMemory> {
    let known = arena.take();
    let capacity = known.as_ref().map_or(elements, |arena| arena.capacity().each(elements, u32::max));
    if let Some(holds) = known.filter(|arena| arena.holds(elements, row_capacity)) {
        return Ok(arena.insert(holds));
    }
    // Free the old arena first: both would not fit on a full device. Wait for the device's last use of it.
    device.wait();
    let fits = largest_buffer(&capacity, row_capacity) <= device.largest_buffer
        && arena_bytes(&capacity, row_capacity) <= device.memory.available();
    Ok(arena.insert(Arena::new(device, pipelines, if fits { capacity } else { elements }, row_capacity)?))
}

#[cfg(test)]
mod tests {
    use super::next_interval;

    #[test]
    fn next_interval_grows_again_after_a_short_chunk() {
        // A run that crosses half the skin in 100 steps.
        assert_eq!(next_interval(1, 40, 1e-5, 1e-3), 40);
        assert_eq!(next_interval(1, 100, 1e-9, 1e-3), 64);
        assert_eq!(next_interval(8, 8, 1e-5, 1e-3), 16);
        assert_eq!(next_interval(8, 40, 8e-4, 1e-3), 8);
        assert_eq!(next_interval(8, 8, 1.0, 1e-3), 1);
    }
}

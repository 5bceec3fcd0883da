//! Advances batches: chunk by chunk, each with as many runs as fit and still have steps to do.

use super::arena::{Arena, Cargo, largest_buffer};
use super::device::Device;
use super::layout::{NONE, Report, Scene};
use super::pipelines::Pipelines;
use super::rows::Slots;
use super::run::GpuRun;
use super::store::{Extent, Store};
use crate::cpu::integrate::fault;
use crate::engine::Advance;

/// Most steps in one submission: so that none takes long, and little is done twice.
const CHUNK: u64 = 256;

/// Most steps between two rebuilds of lists.
const LONGEST_INTERVAL: u32 = 64;

/// Share of half the skin that the next interval aims at.
const AIM: f32 = 0.8;

/// Advances each run by its number of steps.
pub(super) fn advance(
    device: &Device,
    pipelines: &Pipelines,
    arena: &mut Option<Arena>,
    runs: &mut [(&mut GpuRun, u64)],
) -> Vec<Advance> {
    let mut done = vec![Advance::default(); runs.len()];
    loop {
        let left = |k: &usize| done[*k].steps < runs[*k].1 && runs[*k].0.fault.is_none();
        let waiting: Vec<usize> = (0..runs.len()).filter(left).collect();
        let batch = fitting(device, runs, &waiting);
        if batch.is_empty() {
            break;
        }
        let mut members = Vec::new();
        for (k, (run, wanted)) in runs.iter_mut().enumerate() {
            if batch.contains(&k) {
                members.push((&mut **run, (*wanted - done[k].steps).min(CHUNK)));
            }
        }
        let reports = chunk(device, pipelines, arena, &mut members);
        for ((&k, (run, steps)), report) in batch.iter().zip(members).zip(reports) {
            account(device, run, steps, &report, &mut done[k]);
        }
    }
    for (done, (run, _)) in done.iter_mut().zip(runs) {
        done.fault.clone_from(&run.fault);
    }
    done
}

/// The first of these runs whose buffers, put together, the device allows; one at least.
fn fitting(device: &Device, runs: &[(&mut GpuRun, u64)], waiting: &[usize]) -> Vec<usize> {
    let limits = device.device.limits();
    let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
    let (mut sum, mut slots) = (Extent::default(), Slots::default());
    let mut fitting = Vec::new();
    for &k in waiting {
        let run = &runs[k].0;
        sum = sum.each(extent(run, CHUNK), |a, b| a.saturating_add(b));
        slots = slots.max(run.store.slots);
        if !fitting.is_empty() && largest_buffer(&sum, slots) > most {
            break;
        }
        fitting.push(k);
    }
    fitting
}

/// What a run needs for that many steps.
fn extent(run: &GpuRun, steps: u64) -> Extent {
    let poses = if run.moves() { steps as u32 } else { 1 };
    Extent { poses: poses * run.store.extent.surfaces, ..run.store.extent }
}

/// Carries out each run's steps, as often as it takes.
fn chunk(
    device: &Device,
    pipelines: &Pipelines,
    arena: &mut Option<Arena>,
    members: &mut [(&mut GpuRun, u64)],
) -> Vec<Report> {
    let longest = members.iter().map(|(_, steps)| *steps).max().unwrap_or(0) as u32;
    let (cargo, sum) = cargo(members);
    loop {
        let slots = members.iter().map(|(run, _)| run.store.slots).fold(Slots::default(), Slots::max);
        let interval = members.iter().map(|(run, _)| run.interval.min(run.longest_interval())).min();
        let interval = interval.unwrap_or(1).clamp(1, longest);
        members.iter_mut().for_each(|(run, _)| run.store.lengthen(device, slots));
        let arena = room(device, pipelines, arena, sum, slots);
        let stores: Vec<&Store> = members.iter().map(|(run, _)| &run.store).collect();
        let reports = arena.advance(device, pipelines, &stores, &cargo, longest, interval);
        let wanted = |of: fn(&Report) -> u32| reports.iter().map(of).max().unwrap_or(0);
        let (pairs, walls) = (wanted(|report| report.pairs.0), wanted(|report| report.walls.0));
        if pairs > 0 || walls > 0 {
            let longer = slots.max(Slots::holding(pairs, walls));
            members.iter_mut().for_each(|(run, _)| run.store.lengthen(device, longer));
        } else if reports.iter().any(|report| report.stale.0 != 0) {
            let shorter = |run: &mut GpuRun| run.interval = (interval / 2).max(1);
            members.iter_mut().for_each(|(run, _)| shorter(run));
        } else {
            arena.unload(device, &stores, longest, interval);
            for ((run, _), report) in members.iter_mut().zip(&reports) {
                run.interval = next_interval(interval, f32::from_bits(report.drift.0), run.scene.half_skin);
            }
            return reports;
        }
    }
}

/// The interval at which what moved by `drift` in `interval` steps would move most of half the skin; no more than twice as
/// long.
fn next_interval(interval: u32, drift: f32, half_skin: f32) -> u32 {
    let aim = AIM * half_skin / drift.max(1e-12) * interval as f32;
    (aim as u32).clamp(1, (2 * interval).min(LONGEST_INTERVAL))
}

/// Puts together what runs bring along, and how much room they take.
fn cargo(members: &mut [(&mut GpuRun, u64)]) -> (Cargo, Extent) {
    let (mut cargo, mut sum) = (Cargo::default(), Extent::default());
    for (number, (run, steps)) in members.iter_mut().enumerate() {
        let (extent, surfaces) = (extent(run, *steps), run.store.extent.surfaces);
        cargo.scenes.push(Scene {
            first_cell: sum.cells,
            first: sum.particles,
            count: extent.particles,
            steps: *steps as u32,
            first_surface: sum.surfaces,
            surfaces,
            first_pose: sum.poses,
            pose_stride: if run.moves() { surfaces } else { 0 },
            first_facet: sum.facets,
            first_corner: sum.corners,
            first_node: sum.nodes,
            first_leaf: sum.leaves,
            ..run.scene
        });
        cargo.scene_of.resize(cargo.scene_of.len() + extent.particles as usize, number as u32);
        cargo.poses.extend(run.poses(*steps));
        sum = sum.each(extent, |a, b| a + b);
    }
    (cargo, sum)
}

/// The arena, made anew if it is too small or its rows are of another length.
fn room<'a>(
    device: &Device,
    pipelines: &Pipelines,
    arena: &'a mut Option<Arena>,
    extent: Extent,
    slots: Slots,
) -> &'a Arena {
    let known = arena.take();
    let room = known.as_ref().map_or(extent, |arena| arena.room().each(extent, u32::max));
    // What is too small goes before the other is made: both would not fit on a full device.
    let fits = known.filter(|arena| arena.holds(extent, slots));
    arena.insert(fits.unwrap_or_else(|| Arena::new(device, pipelines, room, slots)))
}

/// Takes down how a run fared.
fn account(device: &Device, run: &mut GpuRun, steps: u64, report: &Report, done: &mut Advance) {
    let steps = if report.fault_step.0 == NONE { steps } else { u64::from(report.fault_step.0) + 1 };
    run.moved_on(steps);
    run.bonds_broken += u64::from(report.broken.0);
    done.steps += steps;
    done.particle_steps += steps * u64::from(run.store.extent.particles);
    done.max_overlap_m = done.max_overlap_m.max(f32::from_bits(report.overlap.0));
    if report.fault_step.0 != NONE {
        let limit = run.speed_limit;
        run.fault = Some(fault(report.runaway.0 as usize, limit, run.state(device)));
    }
}

//! Simulated futures of a farm: slots, running jobs, and the queue in its order.
//!
//! Up to [`MAX_EXPLICIT`] jobs of each part of the queue are simulated one by one. Of a longer part the first ones are work that fills all
//! slots evenly, with the mean and variance of their sum.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::SHARE;
use super::speed::{Random, Speed, quantile};

/// Jobs of a part of the queue that are simulated one by one.
const MAX_EXPLICIT: u64 = 400;
/// Simulated futures.
const FUTURES: usize = 200;
/// Slots that are simulated: more are taken together in groups.
const MAX_SLOTS: usize = 1024;
/// Spread of the logarithm of the time left of a running job that reports progress.
const PROGRESS_SPREAD: f64 = 0.2;
/// Share done from which on the progress of a job says more than the estimate.
const MIN_PROGRESS: f64 = 0.05;
/// Least time left of a running job, as a share of its whole time.
const MIN_LEFT: f64 = 0.05;

/// A running job.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Progressed {
    /// Wall time so far, in seconds.
    pub elapsed_s: f64,
    /// Share done, if it is known.
    pub done: Option<f64>,
    /// Wall time by the check, in seconds.
    pub estimate_s: f64,
    /// Whether the forecast is about this job or the sweep that it belongs to.
    pub is_own: bool,
}

/// The farm as seen by the jobs of the forecast.
#[derive(Clone, Debug, Default)]
pub(crate) struct Farm {
    /// Slots of the workers that can take the jobs.
    pub slots: usize,
    /// Jobs that run in these slots.
    pub running: Vec<Progressed>,
}

/// Jobs of the same kind.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Batch {
    /// Their number.
    pub jobs: u64,
    /// Mean wall time by the check, in seconds.
    pub estimate_s: f64,
}

impl Batch {
    /// Both together.
    pub(crate) fn with(self, other: Self) -> Self {
        let jobs = self.jobs + other.jobs;
        let sum_s = self.jobs as f64 * self.estimate_s + other.jobs as f64 * other.estimate_s;
        Self { jobs, estimate_s: if jobs == 0 { 0.0 } else { sum_s / jobs as f64 } }
    }
}

/// The queue as seen by the jobs of the forecast.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Queue {
    /// Other jobs before the first of them.
    pub ahead: Batch,
    /// Other jobs between the first and the last.
    pub between: Batch,
    /// The jobs themselves.
    pub own: Batch,
}

/// A range of seconds from now.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Span {
    pub low_s: f64,
    pub high_s: f64,
}

/// When the first job starts and the last one ends, and the time of all their runs together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Spans {
    /// None where no job of the forecast is queued.
    pub start: Option<Span>,
    pub end: Span,
    /// Slot time of the queued jobs of the forecast.
    pub work: Span,
}

/// One future: start of the first own job, end of the last, own work.
struct Future {
    start_s: Option<f64>,
    end_s: f64,
    work_s: f64,
}

/// Ranges of start and end; none without a slot.
pub(crate) fn forecast(farm: &Farm, queue: &Queue, speed: &Speed, seed: u64) -> Option<Spans> {
    if farm.slots == 0 {
        return None;
    }
    let mut random = Random(ChaCha8Rng::seed_from_u64(seed));
    let futures: Vec<Future> = (0..FUTURES).map(|_| future(farm, queue, speed, &mut random)).collect();
    let span = |values: Vec<f64>| {
        let mut values = values;
        values.sort_by(f64::total_cmp);
        let tail = 0.5 * (1.0 - SHARE);
        Span { low_s: quantile(&values, tail), high_s: quantile(&values, 1.0 - tail) }
    };
    let starts: Option<Vec<f64>> = futures.iter().map(|future| future.start_s).collect();
    Some(Spans {
        start: starts.map(span),
        end: span(futures.iter().map(|future| future.end_s).collect()),
        work: span(futures.iter().map(|future| future.work_s).collect()),
    })
}

/// Times at which slots are free, in seconds from now. They are not negative, so that their bits have their order.
struct Slots(BinaryHeap<Reverse<u64>>);

impl Slots {
    fn next(&mut self) -> f64 {
        self.0.pop().map_or(0.0, |Reverse(bits)| f64::from_bits(bits))
    }

    fn free_at(&mut self, time_s: f64) {
        self.0.push(Reverse(time_s.max(0.0).to_bits()));
    }

    /// Fills all slots evenly with this much work. Jobs of `each_s` then end one after the other.
    fn fill(&mut self, work_s: f64, each_s: f64, random: &mut Random) {
        let mut times: Vec<f64> = self.0.drain().map(|Reverse(bits)| f64::from_bits(bits)).collect();
        times.sort_by(f64::total_cmp);
        let (mut level_s, mut sum_s) = (0.0, 0.0);
        for (index, time_s) in times.iter().enumerate() {
            // The level up to which the first slots are filled, unless it reaches the next one.
            if index > 0 && level_s <= *time_s {
                break;
            }
            sum_s += time_s;
            level_s = (work_s + sum_s) / (index + 1) as f64;
        }
        for time_s in times {
            let end_s = if time_s < level_s { level_s + each_s * (random.unit() - 0.5) } else { time_s };
            self.free_at(end_s.max(time_s));
        }
    }
}

fn future(farm: &Farm, queue: &Queue, speed: &Speed, random: &mut Random) -> Future {
    let level = speed.level(random);
    let mut ends_s = 0.0_f64;
    let mut slots = Slots(BinaryHeap::new());
    // Slots beyond the limit are taken together: a job then stands for several of each part of the queue.
    let scale = farm.slots.div_ceil(MAX_SLOTS) as f64;
    let simulated = farm.slots.div_ceil(scale as usize);
    for (index, job) in farm.running.iter().enumerate() {
        let left_s = left(job, speed, level, random);
        if job.is_own {
            ends_s = ends_s.max(left_s);
        }
        if index as f64 % scale == 0.0 && slots.0.len() < simulated {
            slots.free_at(left_s);
        }
    }
    while slots.0.len() < simulated {
        slots.free_at(0.0);
    }
    let scaled = |batch: Batch| Batch { jobs: (batch.jobs as f64 / scale).ceil() as u64, ..batch };
    let run = |slots: &mut Slots, batch: Batch, random: &mut Random| {
        let (mut first_s, mut last_s, mut work_s) = (None, 0.0_f64, 0.0);
        let bulk = batch.jobs.saturating_sub(MAX_EXPLICIT);
        if bulk > 0 {
            let (mean, deviation) = speed.moments();
            let noise = deviation * (bulk as f64).sqrt() * random.normal();
            let bulk_s = level * batch.estimate_s * (mean * bulk as f64 + noise).max(0.0);
            let begin_s = slots.next();
            first_s = Some(begin_s);
            slots.free_at(begin_s);
            slots.fill(bulk_s, level * batch.estimate_s * mean, random);
            work_s += bulk_s;
        }
        for _ in bulk..batch.jobs {
            let (begin_s, took_s) = (slots.next(), level * batch.estimate_s * speed.draw(random));
            first_s = first_s.or(Some(begin_s));
            last_s = last_s.max(begin_s + took_s);
            work_s += took_s;
            slots.free_at(begin_s + took_s);
        }
        (first_s, last_s, work_s)
    };
    run(&mut slots, scaled(queue.ahead), random);
    let (start_s, last_s, work_s) = run(&mut slots, scaled(queue.own.with(queue.between)), random);
    let all = (queue.own.jobs + queue.between.jobs).max(1) as f64;
    Future { start_s, end_s: ends_s.max(last_s), work_s: work_s * scale * queue.own.jobs as f64 / all }
}

/// The time left of a running job.
fn left(job: &Progressed, speed: &Speed, level: f64, random: &mut Random) -> f64 {
    match job.done.filter(|done| *done >= MIN_PROGRESS && job.elapsed_s > 0.0) {
        Some(done) => {
            let whole_s = job.elapsed_s / done;
            whole_s * (1.0 - done).max(0.0) * (PROGRESS_SPREAD * random.normal()).exp()
        }
        None => {
            let whole_s = level * job.estimate_s * speed.draw(random);
            (whole_s - job.elapsed_s).max(MIN_LEFT * whole_s)
        }
    }
}

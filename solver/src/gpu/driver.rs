//! The thread that drives the device.
//!
//! A caller hands its run over and waits. All waiting runs form a batch; runs join and leave it between
//! chunks. Only this thread creates batches and runs on the device.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use super::advance::{MAX_CHUNK_STEPS, Task, chunk, remove, runs_that_fit};
use super::arena::Arena;
use super::device::Device;
use super::pipelines::Pipelines;
use super::run::{GpuRun, Run};
use super::run_buffers::{RunBuffers, RunContents};
use super::unwind;
use crate::engine::{AdvanceReport, OutOfDeviceMemory};

/// Target duration of a chunk, in seconds: an upper bound for each of its submissions. Operating systems reset an
/// adapter that is busy for about two seconds.
const MAX_SUBMISSION_S: f64 = 0.1;

/// Assumed throughput before the first measurement, in particle-steps per second: that of a slow adapter.
const INITIAL_THROUGHPUT: f64 = 1e6;

/// Panic message of a lost device.
const DEVICE_FAILED: &str = "the GPU has failed before";

/// Why a run is lost.
#[derive(Clone, Debug)]
enum Failure {
    /// The device has too little memory for this run. Other runs continue.
    OutOfDeviceMemory(OutOfDeviceMemory),
    /// The device is lost with all its runs, for this reason.
    Lost(String),
}

/// The run with its report, or the reason of its loss.
type Reply = Result<(Box<Run>, AdvanceReport), Failure>;

/// A run handed over to the thread.
#[derive(Debug)]
struct Request {
    task: Task,
    reply: Sender<Reply>,
}

/// A command to the thread.
#[derive(Debug)]
enum Command {
    /// Advance runs.
    Advance(Vec<Request>),
    /// Remove sub-particles from a run.
    Remove(Box<Run>, Vec<u32>, Sender<Result<Box<Run>, OutOfDeviceMemory>>),
    /// Create the buffers of a run.
    CreateBuffers(Box<RunContents>, Sender<Result<RunBuffers, OutOfDeviceMemory>>),
}

/// Handle of the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Driver {
    /// Both are present until the drop.
    commands: Option<Sender<Command>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Driver {
    /// Waits for the thread. Some drivers crash when a process exits while the device is being closed.
    fn drop(&mut self) {
        self.commands = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Driver {
    pub(super) fn start(device: Device, pipelines: Pipelines) -> Self {
        let (commands, incoming) = channel();
        let drive = move || {
            let (waiting, memory_limit, throughput) = (Vec::new(), None, INITIAL_THROUGHPUT);
            Batcher { device, pipelines, arena: None, waiting, memory_limit, throughput }.drive(&incoming)
        };
        let started = thread::Builder::new().name("gpu".to_owned()).spawn(drive);
        let thread = started.expect("the operating system gives a thread");
        Self { commands: Some(commands), thread: Some(thread) }
    }

    fn command(&self, command: Command) {
        self.commands.as_ref().and_then(|commands| commands.send(command).ok()).expect(DEVICE_FAILED);
    }

    /// Creates the buffers of a run.
    ///
    /// # Panics
    /// When the device has failed.
    pub(super) fn create_buffers(&self, contents: RunContents) -> Result<RunBuffers, OutOfDeviceMemory> {
        let (reply, answer) = channel();
        self.command(Command::CreateBuffers(Box::new(contents), reply));
        answer.recv().expect(DEVICE_FAILED)
    }

    /// Removes sub-particles from the rows of a run: `map` holds the new index of each, or
    /// [`super::layout::NONE`].
    ///
    /// # Panics
    /// When the device has failed.
    pub(super) fn remove(&self, run: &mut GpuRun, map: Vec<u32>) -> Result<(), OutOfDeviceMemory> {
        let (reply, answer) = channel();
        self.command(Command::Remove(run.0.take().expect("it was not lost"), map, reply));
        run.0 = Some(answer.recv().expect(DEVICE_FAILED)?);
        Ok(())
    }

    /// Advances each run by its number of steps. Unwinds with [`OutOfDeviceMemory`] after all runs that fit
    /// are done.
    ///
    /// # Panics
    /// When the device has failed.
    pub(super) fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<AdvanceReport> {
        let transfer_history = |(run, steps): &mut (&mut GpuRun, u64)| {
            let (reply, answer) = channel();
            let run = run.0.take().expect("it was not lost");
            (
                Request {
                    task: Task {
                        run,
                        steps: *steps,
                        max_steps: MAX_CHUNK_STEPS,
                        done: AdvanceReport::default(),
                    },
                    reply,
                },
                answer,
            )
        };
        let (requests, answers): (Vec<_>, Vec<_>) = runs.iter_mut().map(transfer_history).unzip();
        self.command(Command::Advance(requests));
        let take_back = |((run, _), answer): (&mut (&mut GpuRun, u64), Receiver<Reply>)| {
            let (back, done) = answer.recv().expect(DEVICE_FAILED)?;
            run.0 = Some(back);
            Ok(done)
        };
        let done: Vec<Result<AdvanceReport, Failure>> = runs.iter_mut().zip(answers).map(take_back).collect();
        done.into_iter().collect::<Result<_, _>>().unwrap_or_else(|failure| match failure {
            Failure::OutOfDeviceMemory(out_of_memory) => unwind(out_of_memory),
            Failure::Lost(reason) => panic!("the GPU failed: {reason}"),
        })
    }
}

/// The batcher: state of the thread.
struct Batcher {
    device: Device,
    pipelines: Pipelines,
    /// Buffers of the last chunk, for reuse.
    arena: Option<Arena>,
    waiting: Vec<Request>,
    /// Number of runs that fitted last, and the bytes of run buffers at that time. With fewer bytes, more
    /// runs may fit.
    memory_limit: Option<(usize, u64)>,
    /// Throughput of the last chunk, in particle-steps per second.
    throughput: f64,
}

impl Batcher {
    /// Executes commands until all senders are gone or the device fails.
    fn drive(mut self, incoming: &Receiver<Command>) {
        loop {
            let first = if self.waiting.is_empty() {
                let Ok(command) = incoming.recv() else { return };
                Some(command)
            } else {
                None
            };
            let commands = first.into_iter().chain(incoming.try_iter());
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.turn(commands))) {
                let lost = Failure::Lost(panic_text(&*panic));
                // Mark first: a caller that learns of the failure must not come back to this device.
                self.device.mark_failed();
                self.waiting.drain(..).for_each(|request| drop(request.reply.send(Err(lost.clone()))));
                return;
            }
        }
    }

    /// Takes commands and advances waiting runs by a chunk.
    fn turn(&mut self, commands: impl Iterator<Item = Command>) {
        for command in commands {
            match command {
                Command::Advance(requests) => self.waiting.extend(requests),
                Command::Remove(run, map, reply) => {
                    let removed = self.guarded(|batcher| {
                        remove(&batcher.device, &batcher.pipelines, &mut batcher.arena, run, &map)
                    });
                    // The caller may be gone.
                    let _ = reply.send(removed);
                }
                Command::CreateBuffers(contents, reply) => {
                    let made = self.guarded(|batcher| batcher.create_buffers(&contents));
                    // The caller may be gone.
                    let _ = reply.send(made);
                }
            }
        }
        self.reply();
        if !self.waiting.is_empty() {
            self.step();
        }
    }

    /// Does what a caller waits for. A panic marks the device before the caller learns of it.
    fn guarded<T>(&mut self, work: impl FnOnce(&mut Self) -> T) -> T {
        catch_unwind(AssertUnwindSafe(|| work(self))).unwrap_or_else(|panic| {
            self.device.mark_failed();
            resume_unwind(panic)
        })
    }

    /// Creates the buffers of a run, if necessary in the place of the arena.
    fn create_buffers(&mut self, contents: &RunContents) -> Result<RunBuffers, OutOfDeviceMemory> {
        let made = RunBuffers::new(&self.device, contents);
        if made.is_ok() || self.arena.is_none() {
            return made;
        }
        self.arena = None;
        self.device.wait();
        RunBuffers::new(&self.device, contents)
    }

    /// Bytes of all run buffers.
    fn run_buffer_bytes(&self) -> u64 {
        self.device.memory.used().saturating_sub(self.arena.as_ref().map_or(0, Arena::bytes))
    }

    /// Returns finished runs.
    fn reply(&mut self) {
        for Request { task, reply } in self.waiting.extract_if(.., |request| request.task.is_done()) {
            let done = AdvanceReport { fault: task.run.fault.clone(), ..task.done };
            // The caller may be gone.
            let _ = reply.send(Ok((task.run, done)));
        }
    }

    /// Advances as many runs as fit by a chunk. Halves the batch when memory runs out nevertheless.
    fn step(&mut self) {
        let particles = self.waiting.iter().map(|request| request.task.particles()).sum();
        let steps = steps_within(MAX_SUBMISSION_S, self.throughput, particles);
        self.waiting.iter_mut().for_each(|request| request.task.max_steps = steps);
        let tasks = self.waiting.iter().map(|request| &request.task);
        let runs_that_fit = runs_that_fit(&self.device, self.arena.as_ref(), tasks);
        let all_buffers = self.run_buffer_bytes();
        self.memory_limit = self.memory_limit.filter(|(_, then)| all_buffers >= *then);
        let runs_that_fit =
            self.memory_limit.map_or(runs_that_fit, |(memory_limit, _)| runs_that_fit.min(memory_limit));
        let mut tasks: Vec<&mut Task> =
            self.waiting[..runs_that_fit].iter_mut().map(|request| &mut request.task).collect();
        let longest = tasks.iter().map(|task| task.next()).max().unwrap_or(0);
        let done = longest * tasks.iter().map(|task| task.particles()).sum::<u64>();
        match chunk(&self.device, &self.pipelines, &mut self.arena, &mut tasks) {
            // Runs that did not fit go first next time.
            Ok(took) => {
                // Runs without sub-particles give no measurement.
                self.throughput = done.max(1) as f64 / took.as_secs_f64().max(1e-6);
                self.waiting.rotate_left(runs_that_fit);
            }
            Err(_) if runs_that_fit > 1 => {
                self.memory_limit = Some((runs_that_fit / 2, self.run_buffer_bytes()))
            }
            Err(out_of_memory) => {
                let Request { task, reply } = self.waiting.remove(0);
                // Free its memory before the caller learns of it.
                drop(task);
                let _ = reply.send(Err(Failure::OutOfDeviceMemory(out_of_memory)));
            }
        }
    }
}

/// Steps of so many sub-particles within `seconds` at this throughput: at least 1, at most a chunk.
fn steps_within(seconds: f64, throughput: f64, particles: u64) -> u64 {
    ((seconds * throughput / particles.max(1) as f64) as u64).clamp(1, MAX_CHUNK_STEPS)
}

fn panic_text(payload: &(dyn Any + Send)) -> String {
    let text = payload.downcast_ref::<&str>().map(ToString::to_string);
    text.or_else(|| payload.downcast_ref::<String>().cloned()).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_per_submission_follow_the_speed_of_the_device() {
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e9, 100_000), MAX_CHUNK_STEPS);
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e9, 10_000_000), 10);
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e6, 10_000_000), 1);
    }
}

//! The thread that drives the device. Whoever has steps to do hands its run over and waits; what is there at a time makes
//! a batch, which who comes later joins and who is done leaves, from chunk to chunk. MemoryBudget is taken on this thread alone.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use super::advance::{MAX_CHUNK_STEPS, Task, chunk, runs_that_fit};
use super::arena::Arena;
use super::device::Device;
use super::pipelines::Pipelines;
use super::run::{GpuRun, Run};
use super::run_buffers::{RunBuffers, RunContents};
use super::unwind;
use crate::engine::{AdvanceReport, OutOfDeviceMemory};

/// Seconds that one submission should take at memory_limit: operating systems reset an adapter that is busy for two or so.
const MAX_SUBMISSION_S: f64 = 0.1;

/// Particle-steps a second before any are known: of a slow adapter.
const INITIAL_THROUGHPUT: f64 = 1e6;

/// Said of a device that is of no use any more.
const DEVICE_FAILED: &str = "the GPU has failed before";

/// Why a run does not come back.
#[derive(Clone, Debug)]
enum Failure {
    /// There is none for this run; the others go on.
    OutOfDeviceMemory(OutOfDeviceMemory),
    /// The device is lost, and all runs with it; in words.
    Lost(String),
}

/// What comes back: the run and what was done, or why it is lost.
type Reply = Result<(Box<Run>, AdvanceReport), Failure>;

/// A run that is handed over.
#[derive(Debug)]
struct Request {
    task: Task,
    reply: Sender<Reply>,
}

/// What the thread is asked for.
#[derive(Debug)]
enum Command {
    /// To advance runs.
    Advance(Vec<Request>),
    /// To make the buffers of a new one.
    CreateBuffers(Box<RunContents>, Sender<Result<RunBuffers, OutOfDeviceMemory>>),
}

/// The other end of the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Driver {
    /// Both are there until it is dropped.
    commands: Option<Sender<Command>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Driver {
    /// Waits for the thread: a process that exits while the device is being closed crashes in some drivers.
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

    /// Makes the buffers of a run, or says why the device will not.
    ///
    /// # Panics
    /// When the device has failed.
    pub(super) fn store(&self, draft: RunContents) -> Result<RunBuffers, OutOfDeviceMemory> {
        let (reply, answer) = channel();
        self.command(Command::CreateBuffers(Box::new(draft), reply));
        answer.recv().expect(DEVICE_FAILED)
    }

    /// Advances each run by its number of steps. Unwinds with [`OutOfDeviceMemory`] once all that found room are done.
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

/// What the thread has in hand.
struct Batcher {
    device: Device,
    pipelines: Pipelines,
    /// The buffers of the last chunk, for the next.
    arena: Option<Arena>,
    waiting: Vec<Request>,
    /// DampingCap runs that there was memory for, and the bytes that the buffers of runs took then: with fewer, more may fit.
    memory_limit: Option<(usize, u64)>,
    /// Particle-steps a second in the last chunk.
    throughput: f64,
}

impl Batcher {
    /// Does what it is asked for until nobody can ask any more, or the device fails.
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
                // Whoever hears of it must not come back to this device.
                self.device.mark_failed();
                self.waiting.drain(..).for_each(|request| drop(request.reply.send(Err(lost.clone()))));
                return;
            }
        }
    }

    /// Takes commands, and advances what waits by a chunk.
    fn turn(&mut self, commands: impl Iterator<Item = Command>) {
        for command in commands {
            match command {
                Command::Advance(requests) => self.waiting.extend(requests),
                Command::CreateBuffers(draft, reply) => {
                    let made = catch_unwind(AssertUnwindSafe(|| self.store(&draft)));
                    let made = made.unwrap_or_else(|panic| {
                        // Before the other end of `reply` hears of it.
                        self.device.mark_failed();
                        resume_unwind(panic)
                    });
                    // Whoever waited may be gone.
                    let _ = reply.send(made);
                }
            }
        }
        self.reply();
        if !self.waiting.is_empty() {
            self.step();
        }
    }

    /// Makes the buffers of a run. Those of the last batch make way for them.
    fn store(&mut self, draft: &RunContents) -> Result<RunBuffers, OutOfDeviceMemory> {
        let made = RunBuffers::new(&self.device, draft);
        if made.is_ok() || self.arena.is_none() {
            return made;
        }
        self.arena = None;
        self.device.wait();
        RunBuffers::new(&self.device, draft)
    }

    /// What the buffers of runs take, in bytes.
    fn stores(&self) -> u64 {
        self.device.memory.used().saturating_sub(self.arena.as_ref().map_or(0, Arena::bytes))
    }

    /// Gives back the runs that are done.
    fn reply(&mut self) {
        for Request { task, reply } in self.waiting.extract_if(.., |request| request.task.is_done()) {
            let done = AdvanceReport { fault: task.run.fault.clone(), ..task.done };
            // Whoever waited may be gone.
            let _ = reply.send(Ok((task.run, done)));
        }
    }

    /// Advances as many runs as fit by a chunk. When memory runs out all the same the batch halves.
    fn step(&mut self) {
        let particles = self.waiting.iter().map(|request| request.task.particles()).sum();
        let steps = steps_within(MAX_SUBMISSION_S, self.throughput, particles);
        self.waiting.iter_mut().for_each(|request| request.task.max_steps = steps);
        let tasks = self.waiting.iter().map(|request| &request.task);
        let runs_that_fit = runs_that_fit(&self.device, self.arena.as_ref(), tasks);
        let stores = self.stores();
        self.memory_limit = self.memory_limit.filter(|(_, then)| stores >= *then);
        let runs_that_fit =
            self.memory_limit.map_or(runs_that_fit, |(memory_limit, _)| runs_that_fit.min(memory_limit));
        let mut tasks: Vec<&mut Task> =
            self.waiting[..runs_that_fit].iter_mut().map(|request| &mut request.task).collect();
        let longest = tasks.iter().map(|task| task.next()).max().unwrap_or(0);
        let done = longest * tasks.iter().map(|task| task.particles()).sum::<u64>();
        match chunk(&self.device, &self.pipelines, &mut self.arena, &mut tasks) {
            // Those that did not fit come first the next time.
            Ok(took) => {
                // Of runs without sub-particles zero_bits can be told.
                self.throughput = done.max(1) as f64 / took.as_secs_f64().max(1e-6);
                self.waiting.rotate_left(runs_that_fit);
            }
            Err(_) if runs_that_fit > 1 => self.memory_limit = Some((runs_that_fit / 2, self.stores())),
            Err(out_of_memory) => {
                let Request { task, reply } = self.waiting.remove(0);
                // Its memory is free when it hears of it.
                drop(task);
                let _ = reply.send(Err(Failure::OutOfDeviceMemory(out_of_memory)));
            }
        }
    }
}

/// Steps of so many sub-particles that take no longer than that at this throughput, within a chunk; one at least.
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
    fn a_submission_is_as_long_as_the_device_is_fast() {
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e9, 100_000), MAX_CHUNK_STEPS);
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e9, 10_000_000), 10);
        assert_eq!(steps_within(MAX_SUBMISSION_S, 1e6, 10_000_000), 1);
    }
}

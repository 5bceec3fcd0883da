//! The thread that drives the device. Whoever has steps to do hands its run over and waits; what is there at a time makes
//! a batch, which who comes later joins and who is done leaves, from chunk to chunk.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use super::advance::{CHUNK, Task, chunk, fitting};
use super::arena::Arena;
use super::device::Device;
use super::pipelines::Pipelines;
use super::run::{GpuRun, Run};
use crate::engine::Advance;

/// Seconds that one submission should take at most: operating systems reset an adapter that is busy for two or so.
const SUBMIT_S: f64 = 0.1;

/// Particle-steps a second before any are known: of a slow adapter.
const FIRST_PACE: f64 = 1e6;

/// What comes back: the run and what was done, or why it is lost.
type Reply = Result<(Box<Run>, Advance), String>;

/// A run that is handed over.
#[derive(Debug)]
struct Request {
    task: Task,
    reply: Sender<Reply>,
}

/// The other end of the thread, which ends with it.
#[derive(Debug)]
pub(super) struct Driver {
    /// Both are there until it is dropped.
    requests: Option<Sender<Vec<Request>>>,
    thread: Option<JoinHandle<()>>,
}

impl Drop for Driver {
    /// Waits for the thread: a process that exits while the device is being closed crashes in some drivers.
    fn drop(&mut self) {
        self.requests = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

impl Driver {
    pub(super) fn start(device: Device, pipelines: Pipelines) -> Self {
        let (requests, incoming) = channel();
        let drive = move || {
            let (waiting, most, pace) = (Vec::new(), usize::MAX, FIRST_PACE);
            Batch { device, pipelines, arena: None, waiting, most, pace }.drive(&incoming)
        };
        let started = thread::Builder::new().name("gpu".to_owned()).spawn(drive);
        let thread = started.expect("the operating system gives a thread");
        Self { requests: Some(requests), thread: Some(thread) }
    }

    /// Advances each run by its number of steps.
    ///
    /// # Panics
    /// When the device has failed.
    pub(super) fn advance(&self, runs: &mut [(&mut GpuRun, u64)]) -> Vec<Advance> {
        let hand_over = |(run, steps): &mut (&mut GpuRun, u64)| {
            let (reply, answer) = channel();
            let run = run.0.take().expect("it was not lost with the device");
            (
                Request { task: Task { run, steps: *steps, most: CHUNK, done: Advance::default() }, reply },
                answer,
            )
        };
        let (requests, answers): (Vec<_>, Vec<_>) = runs.iter_mut().map(hand_over).unzip();
        let gone = "the GPU has failed before";
        self.requests.as_ref().and_then(|driver| driver.send(requests).ok()).expect(gone);
        let take_back = |((run, _), answer): (&mut (&mut GpuRun, u64), Receiver<Reply>)| {
            let (back, done) =
                answer.recv().expect(gone).unwrap_or_else(|reason| panic!("the GPU failed: {reason}"));
            run.0 = Some(back);
            done
        };
        runs.iter_mut().zip(answers).map(take_back).collect()
    }
}

/// What the thread has in hand.
struct Batch {
    device: Device,
    pipelines: Pipelines,
    /// The buffers of the last chunk, for the next.
    arena: Option<Arena>,
    waiting: Vec<Request>,
    /// Most runs that there was memory for.
    most: usize,
    /// Particle-steps a second in the last chunk.
    pace: f64,
}

impl Batch {
    /// Advances what comes in until nobody can send any more, or the device fails.
    fn drive(mut self, incoming: &Receiver<Vec<Request>>) {
        loop {
            if self.waiting.is_empty() {
                // Others will come, which may be smaller.
                self.most = usize::MAX;
                let Ok(requests) = incoming.recv() else { return };
                self.waiting = requests;
            }
            self.waiting.extend(incoming.try_iter().flatten());
            self.reply();
            if self.waiting.is_empty() {
                continue;
            }
            if let Err(panic) = catch_unwind(AssertUnwindSafe(|| self.step())) {
                let reason = panic_text(&*panic);
                self.waiting.drain(..).for_each(|request| drop(request.reply.send(Err(reason.clone()))));
                return;
            }
        }
    }

    /// Gives back the runs that are done.
    fn reply(&mut self) {
        for Request { task, reply } in self.waiting.extract_if(.., |request| request.task.is_done()) {
            let done = Advance { fault: task.run.fault.clone(), ..task.done };
            // Whoever waited may be gone.
            let _ = reply.send(Ok((task.run, done)));
        }
    }

    /// Advances as many runs as fit by a chunk. When memory runs out the batch halves.
    fn step(&mut self) {
        let particles = self.waiting.iter().map(|request| request.task.particles()).sum();
        let steps = steps_within(SUBMIT_S, self.pace, particles);
        self.waiting.iter_mut().for_each(|request| request.task.most = steps);
        let fitting = fitting(&self.device, self.waiting.iter().map(|request| &request.task)).min(self.most);
        let mut tasks: Vec<&mut Task> =
            self.waiting[..fitting].iter_mut().map(|request| &mut request.task).collect();
        let longest = tasks.iter().map(|task| task.next()).max().unwrap_or(0);
        let done = longest * tasks.iter().map(|task| task.particles()).sum::<u64>();
        match chunk(&self.device, &self.pipelines, &mut self.arena, &mut tasks) {
            // Those that did not fit come first the next time.
            Ok(took) => {
                // Of runs without sub-particles nothing can be told.
                self.pace = done.max(1) as f64 / took.as_secs_f64().max(1e-6);
                self.waiting.rotate_left(fitting);
            }
            Err(_) if fitting > 1 => self.most = fitting / 2,
            Err(error) => {
                let _ = self.waiting.remove(0).reply.send(Err(error.0));
            }
        }
    }
}

/// Steps of so many sub-particles that take no longer than that at this pace, within a chunk; one at least.
fn steps_within(seconds: f64, pace: f64, particles: u64) -> u64 {
    ((seconds * pace / particles.max(1) as f64) as u64).clamp(1, CHUNK)
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
        assert_eq!(steps_within(SUBMIT_S, 1e9, 100_000), CHUNK);
        assert_eq!(steps_within(SUBMIT_S, 1e9, 10_000_000), 10);
        assert_eq!(steps_within(SUBMIT_S, 1e6, 10_000_000), 1);
    }
}

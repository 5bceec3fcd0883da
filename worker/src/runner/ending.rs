//! How a run ended: from the outcome of the solver and the reason to stop.

use std::any::Any;

use roost_api::RunResult;
use roost_api::job::AttemptOutcome;
use roost_solver::SimulateError;
use roost_solver::result::{EndReason, Instability};
use roost_solver::scenario::Fault;
use tokio::task::JoinError;

use super::RunEnd;
use crate::stop::Stop;

const WORKER_STOPS: &str = "handed back: the worker is stopping";

const JOB_PAUSED: &str = "handed back: the job was paused";

/// The end of a run whose thread panicked or was dropped.
pub(super) fn thread_ended(error: JoinError) -> RunEnd {
    if !error.is_panic() {
        return RunEnd::failed(AttemptOutcome::Worker, "the run's thread was dropped");
    }
    let message = format!("the solver panicked: {}", panic_text(&*error.into_panic()));
    RunEnd::failed(AttemptOutcome::Worker, message)
}

/// The end of a run that was stopped before it began.
pub(super) fn stopped_early(why: Stop) -> RunEnd {
    match why {
        Stop::Abandon => RunEnd::Abandoned,
        Stop::Release => RunEnd::failed(AttemptOutcome::Released, WORKER_STOPS),
        Stop::Preempt => RunEnd::failed(AttemptOutcome::Released, JOB_PAUSED),
        Stop::Cancel | Stop::Timeout => {
            RunEnd::failed(AttemptOutcome::Cancelled, "cancelled before it began")
        }
    }
}

/// The end of a run with an invalid scenario.
pub(super) fn invalid(faults: &[Fault]) -> RunEnd {
    let faults: Vec<_> = faults.iter().map(Fault::to_string).collect();
    RunEnd::failed(AttemptOutcome::Invalid, faults.join("; "))
}

/// Classifies the end of a run by its result and the reason to stop. A run that ended before it saw the flag has a normal result.
pub(super) fn classify(
    outcome: Result<RunResult, SimulateError>,
    stop: Option<Stop>,
    max_wall_s: Option<f64>,
) -> RunEnd {
    let result = match outcome {
        Ok(result) => result,
        Err(error) => return RunEnd::failed(AttemptOutcome::Worker, error.to_string()),
    };
    let (outcome, message) = match (result.end_reason, stop) {
        (_, Some(Stop::Abandon)) => return RunEnd::Abandoned,
        (EndReason::Unstable, _) => {
            let message = match &result.instability {
                Some(instability) => {
                    let Instability { reason, step, time_s } = instability;
                    format!("{reason} at step {step}, belt time {time_s:.4} s")
                }
                None => "the physics diverged".to_owned(),
            };
            (AttemptOutcome::Unstable, message)
        }
        (EndReason::Cancelled, Some(Stop::Release)) => {
            return RunEnd::failed(AttemptOutcome::Released, WORKER_STOPS);
        }
        (EndReason::Cancelled, Some(Stop::Preempt)) => {
            return RunEnd::failed(AttemptOutcome::Released, JOB_PAUSED);
        }
        (EndReason::Cancelled, Some(Stop::Timeout)) => {
            let limit = max_wall_s.unwrap_or_default();
            (AttemptOutcome::Timeout, format!("stopped after max_wall_s = {limit} s"))
        }
        (EndReason::Cancelled, _) => (AttemptOutcome::Cancelled, "cancelled while running".to_owned()),
        _ => return RunEnd::Finished(result),
    };
    RunEnd::Failed { outcome, message, result: Some(result) }
}

fn panic_text(payload: &(dyn Any + Send)) -> &str {
    let text = payload.downcast_ref::<&str>().copied();
    text.or_else(|| payload.downcast_ref::<String>().map(String::as_str)).unwrap_or("no message")
}

//! Tests of every branch of the decisions.

use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FailureClass, JobState};
use roost_api::time::Timestamp;

use super::*;

/// The usual number of attempts, without pauses.
const POLICY: RetryPolicy = RetryPolicy {
    worker: RetryLimit { attempts: 3, first_pause: Duration::ZERO, max_pause: Duration::ZERO },
    lost: RetryLimit { attempts: 5, first_pause: Duration::ZERO, max_pause: Duration::ZERO },
};
const NOW: Timestamp = Timestamp(0);
const AT_ONCE: JobChange = JobChange::Requeue { not_before: None, alone: false };

fn job(state: JobState) -> JobSnapshot {
    let id = JobId::new();
    let (cancelling, paused, failure_class) = (false, false, None);
    JobSnapshot { id, state, cancelling, paused, attempt: 2, worker_failures: 0, lost: 0, failure_class }
}

fn attempt(worker_id: WorkerId, number: u32, outcome: Option<AttemptOutcome>) -> AttemptSnapshot {
    AttemptSnapshot { number, worker_id, outcome }
}

#[test]
fn an_attempt_is_stale_only_when_superseded_or_the_job_ended() {
    let me = WorkerId::new();
    let newest = attempt(me, 2, None);
    let lost = attempt(me, 2, Some(AttemptOutcome::Lost));
    assert_eq!(fence(&job(JobState::Running), &newest, me), FenceState::Current);
    assert_eq!(fence(&job(JobState::Queued), &lost, me), FenceState::Current, "expired but unclaimed");

    let older = attempt(me, 1, Some(AttemptOutcome::Lost));
    let superseded = FenceState::Stale(Refusal::Superseded { newest: 2 });
    assert_eq!(fence(&job(JobState::Running), &older, me), superseded);
    assert_eq!(fence(&job(JobState::Queued), &older, me), superseded);
    for state in [JobState::Succeeded, JobState::Failed, JobState::Cancelled] {
        let ended = FenceState::Stale(Refusal::JobEnded { state });
        assert_eq!(fence(&job(state), &lost, me), ended);
    }
}

#[test]
fn an_attempt_belongs_to_its_worker() {
    let mine = attempt(WorkerId::new(), 2, None);
    let stranger = fence(&job(JobState::Running), &mine, WorkerId::new());
    assert_eq!(stranger, FenceState::Stale(Refusal::OtherWorker));
}

#[test]
fn an_ended_attempt_accepts_only_a_repeat_of_its_report() {
    let me = WorkerId::new();
    let done = fence(&job(JobState::Succeeded), &attempt(me, 2, Some(AttemptOutcome::Succeeded)), me);
    assert_eq!(on_result(done.clone()), Ok(Verdict::Repeat));
    let outcome = AttemptOutcome::Succeeded;
    let late = on_failure(&job(JobState::Succeeded), done, AttemptOutcome::Worker, POLICY, NOW);
    assert_eq!(late, Err(Refusal::AttemptEnded { outcome }));

    let released = fence(&job(JobState::Queued), &attempt(me, 2, Some(AttemptOutcome::Released)), me);
    assert_eq!(on_result(released.clone()), Err(Refusal::AttemptEnded { outcome: AttemptOutcome::Released }));
    let again = on_failure(&job(JobState::Queued), released, AttemptOutcome::Released, POLICY, NOW);
    assert_eq!(again, Ok(Verdict::Repeat));
}

#[test]
fn a_failure_ends_or_requeues_the_job_by_class() {
    let running = job(JobState::Running);
    let fail = |outcome| on_failure(&running, FenceState::Current, outcome, POLICY, NOW);
    for (outcome, class) in [
        (AttemptOutcome::Invalid, FailureClass::Invalid),
        (AttemptOutcome::Unstable, FailureClass::Unstable),
        (AttemptOutcome::Timeout, FailureClass::Timeout),
    ] {
        assert_eq!(fail(outcome), Ok(Verdict::Record(JobChange::Fail(class))));
    }
    assert_eq!(fail(AttemptOutcome::Worker), Ok(Verdict::Record(AT_ONCE)));
    assert_eq!(fail(AttemptOutcome::Released), Ok(Verdict::Record(AT_ONCE)));
    for outcome in [AttemptOutcome::Succeeded, AttemptOutcome::Lost, AttemptOutcome::Cancelled] {
        assert_eq!(fail(outcome), Err(Refusal::NotReportable { outcome }));
    }
}

#[test]
fn the_third_worker_failure_ends_the_job_and_a_release_requeues_it() {
    let tried = JobSnapshot { worker_failures: 2, ..job(JobState::Running) };
    let third = on_failure(&tried, FenceState::Current, AttemptOutcome::Worker, POLICY, NOW);
    assert_eq!(third, Ok(Verdict::Record(JobChange::Fail(FailureClass::Worker))));
    for outcome in [AttemptOutcome::Released, AttemptOutcome::Preempted] {
        let back = on_failure(&tried, FenceState::Current, outcome, POLICY, NOW);
        assert_eq!(back, Ok(Verdict::Record(AT_ONCE)), "{outcome}");
    }
}

#[test]
fn an_attempt_without_a_checkpoint_is_released() {
    use AttemptOutcome::{Preempted, Released, Worker};
    assert_eq!(recorded_outcome(Preempted, true), Preempted);
    assert_eq!(recorded_outcome(Preempted, false), Released);
    assert_eq!(recorded_outcome(Worker, false), Worker);
    let repeat = on_failure(&job(JobState::Queued), FenceState::Ended(Released), Preempted, POLICY, NOW);
    assert_eq!(repeat, Ok(Verdict::Repeat));
}

#[test]
fn a_job_with_a_requested_cancel_keeps_a_reported_end() {
    let cancelling = JobSnapshot { cancelling: true, worker_failures: 2, ..job(JobState::Running) };
    use AttemptOutcome::{Cancelled, Preempted, Released, Worker};
    for outcome in [Cancelled, Released, Preempted, Worker] {
        let verdict = on_failure(&cancelling, FenceState::Current, outcome, POLICY, NOW);
        assert_eq!(verdict, Ok(Verdict::Record(JobChange::Cancel)), "{outcome}");
    }
    assert_eq!(on_result(FenceState::Current), Ok(Verdict::Record(JobChange::Succeed)));
    let expired = on_lease_expired(&cancelling, Timestamp(10), false, POLICY, Timestamp(10));
    assert_eq!(expired, Some(JobChange::Cancel));
}

#[test]
fn an_expired_lease_requeues_the_job_until_the_fifth_loss() {
    let running = job(JobState::Running);
    let end = lease_end(Timestamp(1_000), Duration::from_secs(15));
    assert_eq!(end, Timestamp(16_000));
    assert_eq!(on_lease_expired(&running, end, false, POLICY, Timestamp(15_999)), None);
    assert_eq!(on_lease_expired(&running, end, false, POLICY, end), Some(AT_ONCE));
    let unlucky = JobSnapshot { lost: 4, ..running };
    let fifth = on_lease_expired(&unlucky, end, false, POLICY, end);
    assert_eq!(fifth, Some(JobChange::Fail(FailureClass::Lost)));
    assert_eq!(on_lease_expired(&job(JobState::Queued), end, false, POLICY, end), None);
}

#[test]
fn jobs_lost_together_run_alone_and_failed_jobs_pause() {
    let second = Duration::from_secs(1);
    let tries = RetryLimit { first_pause: second, max_pause: second, ..POLICY.lost };
    let policy = RetryPolicy { worker: tries, lost: tries };
    let (running, now) = (job(JobState::Running), Timestamp(10_000));
    let pause = |change: JobChange| match change {
        JobChange::Requeue { not_before: Some(then), alone } => (then.0 - now.0, alone),
        other => panic!("{other:?}"),
    };
    let (waits, alone) = pause(on_lease_expired(&running, now, true, policy, now).unwrap());
    assert!((500..=1000).contains(&waits) && alone, "{waits}");
    let (_, alone) = pause(on_lease_expired(&running, now, false, policy, now).unwrap());
    assert!(!alone, "lost by itself");
    let failed = on_failure(&running, FenceState::Current, AttemptOutcome::Worker, policy, now);
    let Ok(Verdict::Record(change)) = failed else { panic!("{failed:?}") };
    let (waits, alone) = pause(change);
    assert!((500..=1000).contains(&waits) && !alone, "{waits}");
    let released = on_failure(&running, FenceState::Current, AttemptOutcome::Released, policy, now);
    assert_eq!(released, Ok(Verdict::Record(AT_ONCE)), "handed back unharmed");
}

#[test]
fn a_job_past_its_deadline_times_out() {
    let (running, deadline) = (job(JobState::Running), Timestamp(100));
    assert_eq!(on_deadline(&running, deadline, Timestamp(99)), None);
    assert_eq!(on_deadline(&running, deadline, deadline), Some(JobChange::Fail(FailureClass::Timeout)));
    let cancelling = JobSnapshot { cancelling: true, ..running };
    assert_eq!(on_deadline(&cancelling, deadline, deadline), Some(JobChange::Cancel));
    assert_eq!(on_deadline(&job(JobState::Queued), deadline, deadline), None);
}

#[test]
fn a_heartbeat_renews_the_lease_or_abandons_a_stale_attempt() {
    let until = Timestamp(5);
    let running = job(JobState::Running);
    let renewed = on_beat(&running, FenceState::Current, until);
    assert_eq!(renewed, BeatEffect::Renew { until, stop: None });
    let cancelling = JobSnapshot { cancelling: true, ..running };
    let stop = |job: &JobSnapshot| on_beat(job, FenceState::Current, until);
    let cancel = BeatEffect::Renew { until, stop: Some(StopRequest::Cancel) };
    assert_eq!(stop(&cancelling), cancel);
    let preempt = BeatEffect::Renew { until, stop: Some(StopRequest::Preempt) };
    assert_eq!(stop(&JobSnapshot { paused: true, ..running }), preempt);
    assert_eq!(stop(&JobSnapshot { paused: true, ..cancelling }), cancel, "a cancel comes first");
    let stale = FenceState::Stale(Refusal::Superseded { newest: 3 });
    assert_eq!(on_beat(&running, stale, until), BeatEffect::Abandon);
    let released = FenceState::Ended(AttemptOutcome::Released);
    assert_eq!(on_beat(&running, released, until), BeatEffect::Abandon);
}

#[test]
fn cancel_and_retry_depend_on_the_state() {
    let cancels = JobState::ALL.iter().map(|state| on_cancel(*state)).collect::<Vec<_>>();
    use CancelEffect::{Cancel, Nothing, Request};
    assert_eq!(cancels, [Cancel, Request, Nothing, Nothing, Nothing]);

    let lost = Some(FailureClass::Lost);
    assert_eq!(on_retry(JobState::Failed, lost, None), Ok(()));
    assert_eq!(on_retry(JobState::Failed, lost, lost), Ok(()));
    assert_eq!(on_retry(JobState::Cancelled, None, None), Ok(()));
    let wanted = FailureClass::Unstable;
    assert_eq!(on_retry(JobState::Failed, lost, Some(wanted)), Err(Refusal::OtherClass { wanted }));
    assert_eq!(on_retry(JobState::Cancelled, None, Some(wanted)), Err(Refusal::OtherClass { wanted }));
    for state in [JobState::Queued, JobState::Running, JobState::Succeeded] {
        assert_eq!(on_retry(state, None, None), Err(Refusal::NotRetryable { state }));
    }
}

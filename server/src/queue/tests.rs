//! Every branch of the decisions, with the clock as an argument.

use std::time::Duration;

use roost_api::ids::{JobId, WorkerId};
use roost_api::job::{AttemptOutcome, FailureClass, JobState};
use roost_api::time::Timestamp;

use super::*;

/// The usual number of attempts, without pauses.
const POLICY: RetryPolicy = RetryPolicy {
    worker: Tries { attempts: 3, first_pause: Duration::ZERO, longest_pause: Duration::ZERO },
    lost: Tries { attempts: 5, first_pause: Duration::ZERO, longest_pause: Duration::ZERO },
};
const NOW: Timestamp = Timestamp(0);
const AT_ONCE: JobChange = JobChange::Requeue { not_before: None, alone: false };

fn job(state: JobState) -> JobFacts {
    let id = JobId::new();
    JobFacts { id, state, cancelling: false, attempt: 2, worker_failures: 0, lost: 0, failure_class: None }
}

fn attempt(worker_id: WorkerId, number: u32, outcome: Option<AttemptOutcome>) -> AttemptFacts {
    AttemptFacts { number, worker_id, outcome }
}

#[test]
fn an_attempt_is_stale_only_when_superseded_or_the_job_ended() {
    let me = WorkerId::new();
    let newest = attempt(me, 2, None);
    let lost = attempt(me, 2, Some(AttemptOutcome::Lost));
    assert_eq!(standing(&job(JobState::Running), &newest, me), Standing::Holds);
    assert_eq!(standing(&job(JobState::Queued), &lost, me), Standing::Holds, "expired but unclaimed");

    let older = attempt(me, 1, Some(AttemptOutcome::Lost));
    let superseded = Standing::Stale(Refusal::Superseded { newest: 2 });
    assert_eq!(standing(&job(JobState::Running), &older, me), superseded);
    assert_eq!(standing(&job(JobState::Queued), &older, me), superseded);
    for state in [JobState::Succeeded, JobState::Failed, JobState::Cancelled] {
        let ended = Standing::Stale(Refusal::JobEnded { state });
        assert_eq!(standing(&job(state), &lost, me), ended);
    }
}

#[test]
fn an_attempt_belongs_to_its_worker() {
    let mine = attempt(WorkerId::new(), 2, None);
    let stranger = standing(&job(JobState::Running), &mine, WorkerId::new());
    assert_eq!(stranger, Standing::Stale(Refusal::OtherWorker));
}

#[test]
fn an_attempt_that_reported_answers_only_the_same_report() {
    let me = WorkerId::new();
    let done = standing(&job(JobState::Succeeded), &attempt(me, 2, Some(AttemptOutcome::Succeeded)), me);
    assert_eq!(on_result(done.clone()), Ok(Verdict::Repeat));
    let outcome = AttemptOutcome::Succeeded;
    let late = on_failure(&job(JobState::Succeeded), done, AttemptOutcome::Worker, POLICY, NOW);
    assert_eq!(late, Err(Refusal::AttemptEnded { outcome }));

    let released = standing(&job(JobState::Queued), &attempt(me, 2, Some(AttemptOutcome::Released)), me);
    assert_eq!(on_result(released.clone()), Err(Refusal::AttemptEnded { outcome: AttemptOutcome::Released }));
    let again = on_failure(&job(JobState::Queued), released, AttemptOutcome::Released, POLICY, NOW);
    assert_eq!(again, Ok(Verdict::Repeat));
}

#[test]
fn a_failure_ends_or_requeues_by_class() {
    let running = job(JobState::Running);
    let fail = |outcome| on_failure(&running, Standing::Holds, outcome, POLICY, NOW);
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
fn the_third_worker_failure_is_the_last_and_a_release_never_is() {
    let tried = JobFacts { worker_failures: 2, ..job(JobState::Running) };
    let third = on_failure(&tried, Standing::Holds, AttemptOutcome::Worker, POLICY, NOW);
    assert_eq!(third, Ok(Verdict::Record(JobChange::Fail(FailureClass::Worker))));
    let released = on_failure(&tried, Standing::Holds, AttemptOutcome::Released, POLICY, NOW);
    assert_eq!(released, Ok(Verdict::Record(AT_ONCE)));
}

#[test]
fn a_cancelling_job_ends_cancelled_unless_it_had_an_end_of_its_own() {
    let cancelling = JobFacts { cancelling: true, worker_failures: 2, ..job(JobState::Running) };
    for outcome in [AttemptOutcome::Cancelled, AttemptOutcome::Released, AttemptOutcome::Worker] {
        let verdict = on_failure(&cancelling, Standing::Holds, outcome, POLICY, NOW);
        assert_eq!(verdict, Ok(Verdict::Record(JobChange::Cancel)), "{outcome}");
    }
    assert_eq!(on_result(Standing::Holds), Ok(Verdict::Record(JobChange::Succeed)));
    let expired = on_lease_expired(&cancelling, Timestamp(10), false, POLICY, Timestamp(10));
    assert_eq!(expired, Some(JobChange::Cancel));
}

#[test]
fn a_lease_lasts_until_its_moment_and_the_fifth_loss_is_the_last() {
    let running = job(JobState::Running);
    let end = lease_end(Timestamp(1_000), Duration::from_secs(15));
    assert_eq!(end, Timestamp(16_000));
    assert_eq!(on_lease_expired(&running, end, false, POLICY, Timestamp(15_999)), None);
    assert_eq!(on_lease_expired(&running, end, false, POLICY, end), Some(AT_ONCE));
    let unlucky = JobFacts { lost: 4, ..running };
    let fifth = on_lease_expired(&unlucky, end, false, POLICY, end);
    assert_eq!(fifth, Some(JobChange::Fail(FailureClass::Lost)));
    assert_eq!(on_lease_expired(&job(JobState::Queued), end, false, POLICY, end), None);
}

#[test]
fn what_was_lost_in_company_runs_alone_and_what_fails_waits() {
    let second = Duration::from_secs(1);
    let tries = Tries { first_pause: second, longest_pause: second, ..POLICY.lost };
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
    let failed = on_failure(&running, Standing::Holds, AttemptOutcome::Worker, policy, now);
    let Ok(Verdict::Record(change)) = failed else { panic!("{failed:?}") };
    let (waits, alone) = pause(change);
    assert!((500..=1000).contains(&waits) && !alone, "{waits}");
    let released = on_failure(&running, Standing::Holds, AttemptOutcome::Released, policy, now);
    assert_eq!(released, Ok(Verdict::Record(AT_ONCE)), "handed back unharmed");
}

#[test]
fn what_its_worker_does_not_stop_in_time_has_timed_out() {
    let (running, deadline) = (job(JobState::Running), Timestamp(100));
    assert_eq!(on_deadline(&running, deadline, Timestamp(99)), None);
    assert_eq!(on_deadline(&running, deadline, deadline), Some(JobChange::Fail(FailureClass::Timeout)));
    let cancelling = JobFacts { cancelling: true, ..running };
    assert_eq!(on_deadline(&cancelling, deadline, deadline), Some(JobChange::Cancel));
    assert_eq!(on_deadline(&job(JobState::Queued), deadline, deadline), None);
}

#[test]
fn a_beat_renews_carries_the_cancel_and_sends_the_stale_home() {
    let until = Timestamp(5);
    let running = job(JobState::Running);
    let renewed = on_beat(&running, Standing::Holds, until);
    assert_eq!(renewed, BeatEffect::Renew { until, cancel: false });
    let cancelling = JobFacts { cancelling: true, ..running };
    assert_eq!(on_beat(&cancelling, Standing::Holds, until), BeatEffect::Renew { until, cancel: true });
    let stale = Standing::Stale(Refusal::Superseded { newest: 3 });
    assert_eq!(on_beat(&running, stale, until), BeatEffect::Abandon);
    let released = Standing::Ended(AttemptOutcome::Released);
    assert_eq!(on_beat(&running, released, until), BeatEffect::Abandon);
}

#[test]
fn cancel_and_retry_by_state() {
    let cancels = JobState::ALL.iter().map(|state| on_cancel(*state)).collect::<Vec<_>>();
    use CancelEffect::{Ask, Cancel, Nothing};
    assert_eq!(cancels, [Cancel, Ask, Nothing, Nothing, Nothing]);

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

//! Every way in which a run ends.

use std::sync::atomic::{AtomicU32, Ordering};

use roost_api::Phase;
use roost_solver::mesh::Meshes;
use roost_solver::result::EndReason;
use serde_json::json;

use super::*;

/// One fillet of coarse sub-particles in a small hopper, which runs for less than a second.
fn small_scenario() -> Value {
    json!({
        "experiment": "hopper",
        "product": {"count": 1, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": 0.2},
    })
}

/// The same on a slow belt, which runs for minutes.
fn long_scenario() -> Value {
    let mut document = small_scenario();
    document["equipment"]["belt_speed_m_s"] = json!(0.001);
    document["numerics"] = json!({"timestep_s": 1e-4, "duration_s": 600, "stop": {"when_empty": false}});
    document
}

fn start(document: Value, max_wall_s: Option<f64>) -> Run {
    Run::start(document, MeshSource::Given(Meshes::default()), Resources::new(Device::cpu(), 1), max_wall_s)
}

async fn end_of(document: Value, max_wall_s: Option<f64>) -> RunEnd {
    start(document, max_wall_s).end().await
}

#[tokio::test]
async fn a_run_reports_progress_and_ends_with_a_result() {
    let mut run = start(small_scenario(), None);
    run.progress.changed().await.unwrap();
    assert!(run.progress.borrow().is_some());
    let RunEnd::Finished(result) = run.end().await else { panic!("no result") };
    assert!(result.series("discharged_mass").is_some_and(|series| series.t_s.len() > 5));
}

/// Requests every other frame, and counts.
#[derive(Default)]
struct Camera {
    asked: AtomicU32,
    taken: Vec<f64>,
}

impl Observer for Camera {
    fn progress(&mut self, _progress: &Progress) -> Flow {
        panic!("progress goes to the run alone")
    }

    fn wants_snapshot(&self, _simulated_s: f64) -> bool {
        self.asked.fetch_add(1, Ordering::Relaxed).is_multiple_of(2)
    }

    fn snapshot(&mut self, snapshot: &Snapshot<'_>) {
        assert_eq!(snapshot.scene.bodies.len(), 1);
        self.taken.push(snapshot.simulated_s);
    }
}

#[tokio::test]
async fn requested_frames_are_recorded() {
    let camera = Arc::new(Mutex::new(Camera::default()));
    let end = Run::start_observed(
        small_scenario(),
        MeshSource::Given(Meshes::default()),
        Resources::new(Device::cpu(), 1),
        None,
        Extras::from(Some(camera.clone() as FrameObserver)),
    )
    .end()
    .await;
    let RunEnd::Finished(_) = end else { panic!("no result") };
    let camera = camera.lock().unwrap();
    // At the start of the belt it is asked twice; the second answer counts.
    let wanted = camera.asked.load(Ordering::Relaxed).div_ceil(2);
    assert!([0, 1].contains(&(wanted - camera.taken.len() as u32)), "{wanted}, {:?}", camera.taken);
    assert!(camera.taken.len() > 5 && camera.taken.is_sorted_by(|a, b| a < b), "{:?}", camera.taken);
}

#[tokio::test]
async fn an_invalid_scenario_fails_with_every_fault() {
    let mut document = small_scenario();
    document["product"]["count"] = json!(-1);
    document["equipment"]["gate_opening_m"] = json!("wide");
    let RunEnd::Failed { outcome, message, result } = end_of(document, None).await else { panic!("it ran") };
    assert_eq!((outcome, result), (AttemptOutcome::Invalid, None));
    assert!(message.contains("/product/count") && message.contains("/equipment/gate_opening_m"), "{message}");
}

#[tokio::test]
async fn a_timeout_keeps_the_partial_result() {
    let RunEnd::Failed { outcome, message, result } = end_of(long_scenario(), Some(0.3)).await else {
        panic!("no limit")
    };
    assert_eq!(outcome, AttemptOutcome::Timeout);
    assert_eq!(message, "stopped after max_wall_s = 0.3 s");
    assert_eq!(result.unwrap().end_reason, EndReason::Cancelled);
}

#[tokio::test]
async fn each_stop_reason_has_its_own_outcome() {
    for (why, expected) in [
        (Stop::Cancel, Some((AttemptOutcome::Cancelled, true))),
        (Stop::Release, Some((AttemptOutcome::Released, false))),
        (Stop::Preempt, Some((AttemptOutcome::Released, false))),
        (Stop::Abandon, None),
    ] {
        let mut run = start(long_scenario(), None);
        run.progress.changed().await.unwrap();
        run.stop.set(why);
        let actual = match run.end().await {
            RunEnd::Failed { outcome, result, .. } => Some((outcome, result.is_some())),
            RunEnd::Abandoned => None,
            RunEnd::Finished(_) => panic!("{why:?} did not stop it"),
        };
        assert_eq!(actual, expected, "{why:?}");
    }
}

#[tokio::test]
async fn a_diverging_run_is_unstable_with_its_partial_result() {
    let mut document = small_scenario();
    document["numerics"]["timestep_s"] = json!(0.02);
    document["numerics"]["allow_unstable"] = json!(true);
    let RunEnd::Failed { outcome, message, result } = end_of(document, None).await else { panic!("stable?") };
    assert_eq!(outcome, AttemptOutcome::Unstable);
    assert!(message.contains("at step"), "{message}");
    assert_eq!(result.unwrap().end_reason, EndReason::Unstable);
}

#[tokio::test]
async fn a_panic_fails_the_attempt_with_its_message() {
    let progress = Progress {
        phase: Phase::Fill,
        time_s: 0.0,
        simulated_s: 0.0,
        fraction: 0.0,
        subparticles: 1,
        particle_steps: 1,
        wall_s: 0.0,
        discharged_kg: 0.0,
    };
    let solve = move |observer: &mut dyn Observer| -> Result<RunResult, SimulateError> {
        observer.progress(&progress);
        panic!("index {} out of range", 7)
    };
    let run = Run::start_plain(async { Ok(solve) });
    let RunEnd::Failed { outcome, message, result } = run.end().await else { panic!("no failure") };
    assert_eq!((outcome, result), (AttemptOutcome::Worker, None));
    assert_eq!(message, "the solver panicked: index 7 out of range");
}

#[test]
fn the_first_reason_to_stop_stays_unless_abandoned() {
    let flag = StopFlag::default();
    assert_eq!(flag.get(), None);
    flag.set(Stop::Release);
    flag.set(Stop::Cancel);
    assert_eq!(flag.get(), Some(Stop::Release));
    flag.set(Stop::Abandon);
    flag.set(Stop::Timeout);
    assert_eq!(flag.get(), Some(Stop::Abandon));
}

#[tokio::test]
async fn a_run_that_waits_for_meshes_can_be_stopped() {
    type Solve = fn(&mut dyn Observer) -> Result<RunResult, SimulateError>;
    for (why, expected) in [
        (Stop::Cancel, Some(AttemptOutcome::Cancelled)),
        (Stop::Release, Some(AttemptOutcome::Released)),
        (Stop::Preempt, Some(AttemptOutcome::Released)),
        (Stop::Abandon, None),
    ] {
        let run = Run::start_plain(std::future::pending::<Result<Solve, RunEnd>>());
        run.stop.set(why);
        let end = tokio::time::timeout(Duration::from_secs(20), run.end()).await.expect("an end");
        let actual = match end {
            RunEnd::Failed { outcome, result: None, .. } => Some(outcome),
            RunEnd::Abandoned => None,
            other => panic!("{other:?}"),
        };
        assert_eq!(actual, expected, "{why:?}");
    }
}

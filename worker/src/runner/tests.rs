//! Every way a run can end, told apart.

use std::sync::atomic::AtomicU32;

use roost_api::Phase;
use roost_solver::mesh::Meshes;
use serde_json::json;

use super::*;

/// One fillet of coarse sub-particles in a small hopper: a real run of well under a second.
fn small() -> Value {
    json!({
        "experiment": "hopper",
        "product": {"count": 1, "subparticle_radius_m": 0.009},
        "equipment": {"hopper_width_m": 0.2, "side_walls": "frictionless"},
        "numerics": {"timestep_s": "auto", "duration_s": 0.2},
    })
}

/// The same on a belt so slow that the fillets stay: there is work for minutes.
fn long() -> Value {
    let mut document = small();
    document["equipment"]["belt_speed_m_s"] = json!(0.001);
    document["numerics"] = json!({"timestep_s": 1e-4, "duration_s": 600, "stop": {"when_empty": false}});
    document
}

fn start(document: Value, max_wall_s: Option<f64>) -> Run {
    Run::start(document, MeshSource::Given(Meshes::default()), Place::new(Device::cpu(), 1), max_wall_s)
}

async fn end_of(document: Value, max_wall_s: Option<f64>) -> RunEnd {
    start(document, max_wall_s).end().await
}

#[tokio::test]
async fn a_scenario_runs_to_its_result_and_reports_progress() {
    let mut run = start(small(), None);
    run.progress.changed().await.unwrap();
    assert!(run.progress.borrow().is_some());
    let RunEnd::Finished(result) = run.end().await else { panic!("no result") };
    assert!(result.series("discharged_mass").is_some_and(|series| series.t_s.len() > 5));
}

/// Asks for every other picture, and counts.
#[derive(Default)]
struct Camera {
    asked: AtomicU32,
    taken: Vec<f64>,
}

impl Observer for Camera {
    fn progress(&mut self, _progress: &Progress) -> Flow {
        panic!("progress is told to the run alone")
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
async fn pictures_are_taken_where_they_are_wanted() {
    let camera = Arc::new(Mutex::new(Camera::default()));
    let end = Run::start_pictured(
        small(),
        MeshSource::Given(Meshes::default()),
        Place::new(Device::cpu(), 1),
        None,
        Some(camera.clone()),
    )
    .end()
    .await;
    let RunEnd::Finished(_) = end else { panic!("no result") };
    let camera = camera.lock().unwrap();
    // Where the belt starts it is asked twice, of which the second counts.
    let wanted = camera.asked.load(Ordering::Relaxed).div_ceil(2);
    assert!([0, 1].contains(&(wanted - camera.taken.len() as u32)), "{wanted}, {:?}", camera.taken);
    assert!(camera.taken.len() > 5 && camera.taken.is_sorted_by(|a, b| a < b), "{:?}", camera.taken);
}

#[tokio::test]
async fn a_bad_scenario_is_invalid_and_names_every_fault() {
    let mut document = small();
    document["product"]["count"] = json!(-1);
    document["equipment"]["gate_opening_m"] = json!("wide");
    let RunEnd::Failed { outcome, message, result } = end_of(document, None).await else { panic!("it ran") };
    assert_eq!((outcome, result), (AttemptOutcome::Invalid, None));
    assert!(message.contains("/product/count") && message.contains("/equipment/gate_opening_m"), "{message}");
}

#[tokio::test]
async fn past_its_wall_time_a_run_keeps_what_it_has() {
    let RunEnd::Failed { outcome, message, result } = end_of(long(), Some(0.3)).await else {
        panic!("no limit")
    };
    assert_eq!(outcome, AttemptOutcome::Timeout);
    assert_eq!(message, "stopped after max_wall_s = 0.3 s");
    assert_eq!(result.unwrap().end_reason, EndReason::Cancelled);
}

#[tokio::test]
async fn each_reason_to_stop_has_its_own_end() {
    for (why, expected) in [
        (Stop::Cancel, Some((AttemptOutcome::Cancelled, true))),
        (Stop::Release, Some((AttemptOutcome::Released, false))),
        (Stop::Abandon, None),
    ] {
        let mut run = start(long(), None);
        run.progress.changed().await.unwrap();
        run.stop.set(why);
        let seen = match run.end().await {
            RunEnd::Failed { outcome, result, .. } => Some((outcome, result.is_some())),
            RunEnd::Abandoned => None,
            RunEnd::Finished(_) => panic!("{why:?} did not stop it"),
        };
        assert_eq!(seen, expected, "{why:?}");
    }
}

#[tokio::test]
async fn a_diverging_run_is_unstable_with_its_partial_result() {
    let mut document = small();
    document["numerics"]["timestep_s"] = json!(0.02);
    document["numerics"]["allow_unstable"] = json!(true);
    let RunEnd::Failed { outcome, message, result } = end_of(document, None).await else { panic!("stable?") };
    assert_eq!(outcome, AttemptOutcome::Unstable);
    assert!(message.contains("at step"), "{message}");
    assert_eq!(result.unwrap().end_reason, EndReason::Unstable);
}

#[tokio::test]
async fn a_panic_is_the_workers_failure_and_says_what_happened() {
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
    let solve = move |observer: &mut dyn Observer| -> Result<RunResult, OutOfDeviceMemory> {
        observer.progress(&progress);
        panic!("index {} out of range", 7)
    };
    let run = Run::start_with(None, None, async { Ok(solve) });
    let RunEnd::Failed { outcome, message, result } = run.end().await else { panic!("no failure") };
    assert_eq!((outcome, result), (AttemptOutcome::Worker, None));
    assert_eq!(message, "the solver panicked: index 7 out of range");
}

#[test]
fn the_first_reason_stays_but_abandon_beats_all() {
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
async fn what_waits_for_its_meshes_can_be_stopped() {
    type Solve = fn(&mut dyn Observer) -> Result<RunResult, OutOfDeviceMemory>;
    for (why, expected) in [
        (Stop::Cancel, Some(AttemptOutcome::Cancelled)),
        (Stop::Release, Some(AttemptOutcome::Released)),
        (Stop::Abandon, None),
    ] {
        let run = Run::start_with(None, None, std::future::pending::<Result<Solve, RunEnd>>());
        run.stop.set(why);
        let end = tokio::time::timeout(Duration::from_secs(20), run.end()).await.expect("an end");
        let seen = match end {
            RunEnd::Failed { outcome, result: None, .. } => Some(outcome),
            RunEnd::Abandoned => None,
            other => panic!("{other:?}"),
        };
        assert_eq!(seen, expected, "{why:?}");
    }
}

//! The cache of filled states.

use roost_solver::mesh::Meshes;
use roost_solver::scenario::from_value;
use roost_solver::{Checked, Computer, CpuOptions, Flow, Limits, Observer, Progress, check};
use serde_json::json;

use super::*;

/// Takes the filled state of a run and stops it there.
#[derive(Default)]
struct Filling(Option<Checkpoint>);

impl Observer for Filling {
    fn progress(&mut self, _: &Progress) -> Flow {
        if self.0.is_some() { Flow::Cancel } else { Flow::Continue }
    }

    fn wants_checkpoint(&mut self, moment: Moment) -> bool {
        moment == Moment::Start
    }

    fn checkpoint(&mut self, checkpoint: Checkpoint) {
        self.0 = Some(checkpoint);
    }
}

fn hopper(seed: u64, gate_m: f64) -> Checked {
    let scenario = from_value(&json!({
        "experiment": "hopper", "seed": seed,
        "product": {"count": 2, "subparticle_radius_m": 0.01},
        "equipment": {"hopper_width_m": 0.2, "gate_opening_m": gate_m},
        "numerics": {"timestep_s": "auto", "duration_s": 0.1, "rest_speed_m_s": 0.2},
    }));
    check(&scenario.unwrap(), &Meshes::default(), &Limits::NONE).unwrap()
}

fn computer() -> Computer {
    Computer::Cpu(CpuOptions { threads: 1 })
}

fn filled(checked: &Checked) -> Checkpoint {
    let mut filling = Filling::default();
    computer().simulate(checked, &mut filling).unwrap();
    filling.0.expect("it was filled")
}

#[test]
fn fill_is_found_by_the_fields_that_act_before_belt_start() {
    let folder = tempfile::tempdir().unwrap();
    let cache = FillCache::open(folder.path(), u64::MAX).unwrap();
    let (low, high, other_seed) = (hopper(1, 0.04), hopper(1, 0.08), hopper(2, 0.04));
    let stamp = |checked: &Checked| computer().stamp(checked);
    assert!(cache.load(&stamp(&low)).is_none());
    cache.store(&filled(&low)).unwrap();
    assert!(cache.load(&stamp(&high)).is_some());
    assert!(cache.load(&stamp(&other_seed)).is_none());
}

#[test]
fn damaged_fill_is_deleted_and_least_recently_used_fills_are_evicted() {
    let folder = tempfile::tempdir().unwrap();
    let all = [hopper(1, 0.04), hopper(2, 0.04), hopper(3, 0.04)];
    let stamps = all.each_ref().map(|checked| computer().stamp(checked));
    let states = all.each_ref().map(filled);
    let size = states.iter().map(|state| state.to_bytes().len() as u64).max().unwrap();
    let cache = FillCache::open(folder.path(), 2 * size).unwrap();
    for (state, stamp) in states.iter().zip(&stamps).take(2) {
        cache.store(state).unwrap();
        let path = cache.path(stamp).unwrap();
        let older = SystemTime::now() - Duration::from_secs(3600);
        fs::File::options().append(true).open(path).unwrap().set_modified(older).unwrap();
    }
    assert!(cache.load(&stamps[0]).is_some(), "used again");
    cache.store(&states[2]).unwrap();
    assert_eq!(stamps.each_ref().map(|stamp| cache.path(stamp).unwrap().exists()), [true, false, true]);
    fs::write(cache.path(&stamps[0]).unwrap(), b"ROOSTCKP").unwrap();
    assert!(cache.load(&stamps[0]).is_none() && !cache.path(&stamps[0]).unwrap().exists());
}

#[tokio::test]
async fn runs_with_the_same_fill_take_turns() {
    let folder = tempfile::tempdir().unwrap();
    let cache = FillCache::open(folder.path(), u64::MAX).unwrap();
    let [low, high, other] =
        [hopper(1, 0.04), hopper(1, 0.08), hopper(2, 0.04)].map(|it| computer().stamp(&it));
    let first = cache.turn(&low).await.expect("it shares a fill");
    let soon = Duration::from_millis(50);
    let clone = cache.clone();
    assert!(tokio::time::timeout(soon, clone.turn(&high)).await.is_err(), "the first has its turn");
    assert!(tokio::time::timeout(soon, cache.turn(&other)).await.is_ok(), "another fill");
    let waiting = clone.turn(&high);
    drop(first);
    assert!(tokio::time::timeout(Duration::from_secs(20), waiting).await.is_ok());
    let none = Stamp { fill_digest: None, ..low };
    assert!(cache.turn(&none).await.is_none());
}

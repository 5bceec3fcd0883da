//! A seeded simulation of the queue: the real store against a model that predicts every step.
//!
//! `world` simulates users, workers, the network and the clock: lost replies to claims; lost, repeated and late deliveries; workers that
//! die or lose their connection; restarts; clocks that are set. `model` has the rules of the API and knows no SQL. After every step, or every
//! fourth with PostgreSQL, both must agree on every job, and at the end every job must have ended.
//!
//! `ROOST_SEED=17 cargo test -p roost-server simulation -- --nocapture` repeats the run of one seed and prints its steps.
//! `ROOST_SEEDS=100000` runs more seeds, from `ROOST_FIRST_SEED` on.

mod fills;
mod model;
mod turns;
mod world;

use std::panic::AssertUnwindSafe;
use std::time::Instant;

use futures_util::FutureExt;

use super::Store;
use super::testing::Place;
use world::World;

/// Seeds of the usual test with PostgreSQL.
const SEEDS: u64 = 1000;
/// Seeds of the usual test with SQLite, where the model is compared after every step.
const SEEDS_ON_SQLITE: u64 = 250;
/// Later seeds that have shown a fault.
const FAULTS: [u64; 2] = [641, 682];
/// Steps of one run.
const STEPS: u32 = 50;

fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a number"))
}

/// Runs one seed. Prints its steps if asked, or if it fails.
pub(super) async fn run_seed(store: &Store, seed: u64, is_verbose: bool) {
    let mut world = World::new(store, seed).await;
    let outcome = AssertUnwindSafe(world.run(STEPS, is_verbose)).catch_unwind().await;
    if is_verbose || outcome.is_err() {
        eprintln!("seed {seed}\n  {}", world.steps.join("\n  "));
    }
    if outcome.is_err() {
        panic!("seed {seed} failed; ROOST_SEED={seed} repeats it");
    }
}

/// Runs seeds one after the other, on one store.
fn run_seeds(place: &Place, seeds: impl Iterator<Item = u64>, is_verbose: bool) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        let store = place.open().await;
        for seed in seeds {
            run_seed(&store, seed, is_verbose).await;
        }
        store.close().await;
    });
}

#[test]
fn no_seed_loses_a_job_or_records_a_result_twice() {
    simulate(Place::sqlite, SEEDS_ON_SQLITE);
}

#[test]
fn no_seed_loses_a_job_or_records_a_result_twice_in_postgresql() {
    simulate(Place::postgres, SEEDS);
}

fn simulate(place: fn() -> Place, usual_seeds: u64) {
    if let Some(seed) = from_environment("ROOST_SEED") {
        return run_seeds(&place(), std::iter::once(seed), true);
    }
    let (seeds, first, started) = (
        from_environment("ROOST_SEEDS").unwrap_or(usual_seeds),
        from_environment("ROOST_FIRST_SEED").unwrap_or(0),
        Instant::now(),
    );
    let faults = FAULTS.into_iter().filter(|seed| !(first..first + seeds).contains(seed));
    let all: Vec<u64> = (first..first + seeds).chain(faults).collect();
    std::thread::scope(|scope| {
        for half in 0..2 {
            let half = all.iter().copied().skip(half).step_by(2);
            scope.spawn(move || run_seeds(&place(), half, false));
        }
    });
    eprintln!("{seeds} seeds of {STEPS} steps in {:.0} s", started.elapsed().as_secs_f64());
}

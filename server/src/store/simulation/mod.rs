//! A simulation of the queue: seeded, on the real store, against a model that says what must come of every step.
//!
//! `world` plays users, workers, the network and the clock: claims whose reply is lost, deliveries that are lost, repeated or
//! come late, workers that die or fall silent, restarts, clocks that are set. `model` knows the promises and nothing of SQL.
//! After every step the two must agree on every job, and at the end every job must have come to one.
//!
//! One seed is one story. `ROOST_SEED=17 cargo test -p roost-server simulation -- --nocapture` tells it again;
//! `ROOST_SEEDS=100000` tries more of them, from `ROOST_FIRST_SEED` on.

mod model;
mod world;

use std::panic::AssertUnwindSafe;
use std::time::Instant;

use futures_util::FutureExt;

use super::Store;
use world::World;

/// Stories of the usual test.
const SEEDS: u64 = 1000;
/// Steps of a story.
const STEPS: u32 = 50;

fn from_environment(name: &str) -> Option<u64> {
    std::env::var(name).ok().map(|text| text.parse().expect("a number"))
}

/// Tells one story; on a failure, its steps.
async fn tell(store: &Store, seed: u64, aloud: bool) {
    let mut world = World::new(store, seed).await;
    let told = AssertUnwindSafe(world.run(STEPS)).catch_unwind().await;
    if aloud || told.is_err() {
        eprintln!("seed {seed}\n  {}", world.story.join("\n  "));
    }
    if told.is_err() {
        panic!("seed {seed} went wrong; ROOST_SEED={seed} tells it again");
    }
}

/// Tells stories one after the other, on one store.
fn tell_all(seeds: impl Iterator<Item = u64>, aloud: bool) {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
    runtime.block_on(async {
        // In memory where that can be: nothing here is about the disk.
        let dir = tempfile::tempdir_in("/dev/shm").or_else(|_| tempfile::tempdir()).unwrap();
        let store = Store::open(&dir.path().join("roost.db"), None).await.unwrap();
        for seed in seeds {
            tell(&store, seed, aloud).await;
        }
        store.close().await;
    });
}

#[test]
fn no_story_loses_a_job_or_records_one_twice() {
    if let Some(seed) = from_environment("ROOST_SEED") {
        return tell_all(std::iter::once(seed), true);
    }
    let (seeds, first, started) = (
        from_environment("ROOST_SEEDS").unwrap_or(SEEDS),
        from_environment("ROOST_FIRST_SEED").unwrap_or(0),
        Instant::now(),
    );
    std::thread::scope(|scope| {
        for half in 0..2 {
            scope.spawn(move || tell_all((first..first + seeds).skip(half).step_by(2), false));
        }
    });
    eprintln!("{seeds} stories of {STEPS} steps in {:.0} s", started.elapsed().as_secs_f64());
}

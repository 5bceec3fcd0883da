//! Checkpoints change no bit: runs that are killed and go on end like undisturbed ones. What is no checkpoint is refused.

mod common;
#[path = "common/experiments.rs"]
mod experiments;
#[path = "common/resuming.rs"]
mod resuming;

use std::cell::RefCell;
use std::collections::HashMap;

use common::checked;
use experiments::{experiments, fragments};
use resuming::{Killer, RandomSteps, bits, with_kills};
use roost_solver::cpu::Cpu;
use roost_solver::engine::checkpoint::CheckpointError;
use roost_solver::scenario::Scenario;
use roost_solver::{Checkpoint, Flow, Moment, Observer, Progress, simulate_on};
use serde_json::json;

/// Cases of the property below in the test command; `ROOST_CASES` sets another number.
const CASES: u64 = 50;

/// Backends of one, two and three threads: on the fast path, and on the plain one.
fn backends() -> [[Cpu; 3]; 2] {
    [[1, 2, 3].map(Cpu::new), [1, 2, 3].map(Cpu::plain)]
}

#[test]
fn runs_that_are_killed_at_random_steps_end_with_the_same_bits() {
    let cases = std::env::var("ROOST_CASES").map_or(CASES, |cases| cases.parse().expect("a number"));
    let scenarios: Vec<Scenario> = experiments().into_iter().chain(fragments()).collect();
    let backends = backends();
    let mut undisturbed: HashMap<(usize, usize), String> = HashMap::new();
    let mut killed = 0;
    for case in 0..cases {
        let mut random = fastrand::Rng::with_seed(case);
        // Every scenario on both paths in turn.
        let (number, path) = (case as usize / 2 % scenarios.len(), case as usize % 2);
        let checked = checked(&scenarios[number]);
        let expected = undisturbed.entry((number, path)).or_insert_with(|| {
            let mut keep_on = |_: &Progress| Flow::Continue;
            bits(&simulate_on(&backends[path][0], &checked, None, &mut keep_on).expect("no checkpoint"))
        });
        let mut shares: Vec<f64> = (0..random.usize(1..4)).map(|_| random.f64()).collect();
        shares.sort_unstable_by(f64::total_cmp);
        let (result, kills) = with_kills(&checked, &shares, || {
            let steps = RefCell::new(random.fork());
            RandomSteps(&backends[path][random.usize(0..3)], steps)
        });
        killed += kills;
        assert!(
            *expected == bits(&result),
            "case {case}: scenario {number}, path {path}, killed at {shares:?}"
        );
    }
    assert!(killed as u64 > cases / 2, "{killed} kills in {cases} cases");
    println!("{cases} cases, {killed} kills");
}

/// Takes the filled state of a run.
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

#[test]
fn filled_state_is_reused_for_fields_that_act_only_from_belt_start() {
    let base = json!({
        "experiment": "hopper", "product": {"count": 8, "subparticle_radius_m": 0.01},
        "equipment": {"hopper_width_m": 0.15, "hopper_length_m": 0.2, "gate_opening_m": 0.1, "surface_loads": true},
        "numerics": {"timestep_s": "auto", "duration_s": 0.2, "rest_speed_m_s": 0.1},
    });
    let others = [
        ("/equipment/gate_opening_m", json!(0.04)),
        ("/equipment/belt_speed_m_s", json!(0.6)),
        ("/numerics/duration_s", json!(0.3)),
        ("/numerics/jam_after_s", json!(0.05)),
        ("/numerics/stop/when_empty", json!(false)),
        ("/numerics/stop/when_jammed_s", json!(0.05)),
    ];
    let marked: Vec<&str> = roost_solver::scenario::fields::FIELDS
        .iter()
        .filter(|field| field.from_start && field.pointer != "/numerics/stop/when_done")
        .map(|field| field.pointer)
        .filter(|pointer| !pointer.contains("/opening_"))
        .collect();
    assert!(marked.iter().all(|pointer| others.iter().any(|(other, _)| other == pointer)), "{marked:?}");
    for cpu in [Cpu::new(1), Cpu::plain(1)] {
        let mut filling = Filling(None);
        simulate_on(&cpu, &checked(&common::scenario(base.clone(), &[])), None, &mut filling)
            .expect("no checkpoint");
        let filled =
            Checkpoint::from_bytes(&filling.0.expect("it was filled").to_bytes()).expect("its own bytes");
        for other in &others {
            let scenario = checked(&common::scenario(base.clone(), std::slice::from_ref(other)));
            let run = |from| {
                simulate_on(&cpu, &scenario, from, &mut |_: &Progress| Flow::Continue).expect("it fits")
            };
            assert!(bits(&run(Some(&filled))) == bits(&run(None)), "{other:?}");
        }
        let fill = [("/equipment/hopper_length_m", json!(0.25))];
        assert!(go_on(&cpu, &common::scenario(base.clone(), &fill), &filled).is_err(), "another fill");
    }
}

/// The checkpoint of a run at half its progress.
fn half_way(scenario: &Scenario) -> Checkpoint {
    let mut killer = Killer::at(0.5);
    simulate_on(&Cpu::new(1), &checked(scenario), None, &mut killer).expect("no checkpoint");
    killer.saved.expect("it was killed")
}

fn go_on(cpu: &Cpu, scenario: &Scenario, from: &Checkpoint) -> Result<(), CheckpointError> {
    simulate_on(cpu, &checked(scenario), Some(from), &mut |_: &Progress| Flow::Cancel).map(drop)
}

#[test]
fn checkpoint_of_another_run_is_refused_with_the_difference() {
    let scenario = &experiments()[0];
    let saved = half_way(scenario);
    assert_eq!(go_on(&Cpu::new(2), scenario, &saved), Ok(()));
    let mut document = json!(scenario);
    document["seed"] = json!(77);
    let other_seed = common::scenario(document, &[]);
    let refused = |result: Result<(), CheckpointError>| result.expect_err("another run").to_string();
    let text = refused(go_on(&Cpu::new(1), &other_seed, &saved));
    assert!(text.starts_with("the checkpoint is of another scenario: "), "{text}");
    let text = refused(go_on(&Cpu::plain(1), scenario, &saved));
    assert!(
        text.contains("another device: cpu ") && text.contains(", not cpu ") && text.contains("plain"),
        "{text}"
    );
    let mut older = saved.clone();
    older.head.stamp.solver_revision -= 1;
    let text = refused(go_on(&Cpu::new(1), scenario, &older));
    let now = roost_solver::SOLVER_REVISION;
    assert_eq!(text, format!("the checkpoint is of another solver revision: {}, not {now}", now - 1));
}

#[test]
fn invalid_checkpoint_bytes_are_refused_with_the_reason() {
    let bytes = half_way(&experiments()[0]).to_bytes();
    let refused = |bytes: &[u8]| Checkpoint::from_bytes(bytes).expect_err("no checkpoint").to_string();
    assert_eq!(refused(b"PK\x03\x04"), "this is not a checkpoint of Roost");
    assert_eq!(refused(&[]), "this is not a checkpoint of Roost");
    let mut newer = bytes.clone();
    newer[8] = 9;
    assert_eq!(refused(&newer), "the checkpoint has format 9; this version of Roost reads format 1");
    for length in (8..bytes.len()).step_by(bytes.len() / 50) {
        assert!(refused(&bytes[..length]).starts_with("the checkpoint is damaged: "), "{length} bytes");
    }
    for at in (12..bytes.len()).step_by(bytes.len() / 50) {
        let mut changed = bytes.clone();
        changed[at] ^= 1;
        assert!(refused(&changed).starts_with("the checkpoint is damaged: "), "byte {at}");
    }
}

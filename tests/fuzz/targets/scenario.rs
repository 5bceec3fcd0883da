//! Scenarios: a valid one is the same after writing and reading, and a refusal has its reasons.
#![no_main]

use libfuzzer_sys::fuzz_target;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::{ScenarioError, parse};
use roost_solver::{Limits, check};

/// Small, so that what is slow stands out.
const LIMITS: Limits = Limits { max_subparticles: 20_000, max_steps: 1_000_000 };

fuzz_target!(|text: &str| {
    let scenario = match parse(text) {
        Ok(scenario) => scenario,
        Err(error) => {
            assert!(!error.to_string().is_empty());
            if let ScenarioError::Faults(faults) = error {
                assert!(!faults.is_empty(), "refused without a reason");
                assert!(faults.iter().all(|fault| fault.pointer.is_empty() || fault.pointer.starts_with('/')));
            }
            return;
        }
    };
    let written = serde_json::to_string(&scenario).expect("a scenario is JSON");
    let again = parse(&written).expect("what was read reads again");
    assert_eq!(again, scenario);
    assert_eq!(again.digest(), scenario.digest());
    if let Err(faults) = check(&scenario, &Meshes::default(), &LIMITS) {
        assert!(!faults.is_empty(), "refused without a reason");
    }
});

//! Documents of `POST /v1/validate`: sweeps, jobs and scenarios. Never more jobs than allowed, and every refusal has its reasons.
#![no_main]

use libfuzzer_sys::fuzz_target;
use roost_server::{Limits, validate};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::read_json;

/// Small, so that what is slow stands out.
const LIMITS: Limits = Limits { max_subparticles: 20_000, max_steps: 1_000_000 };
const MOST_JOBS: u64 = 200;

fuzz_target!(|text: &str| {
    let Ok(document) = read_json(text) else { return };
    match validate(document, &Meshes::default(), &LIMITS, MOST_JOBS) {
        Ok(report) => assert!((1..=MOST_JOBS).contains(&report.jobs), "{} jobs", report.jobs),
        Err(faults) => {
            assert!(!faults.is_empty(), "refused without a reason");
            for fault in faults {
                assert!(fault.pointer.is_empty() || fault.pointer.starts_with('/'), "{fault}");
                assert!(!fault.detail.is_empty(), "{fault}");
            }
        }
    }
});

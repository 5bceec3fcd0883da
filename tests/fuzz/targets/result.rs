//! Result documents: a document that can be read is the same after writing and reading.
#![no_main]

use libfuzzer_sys::fuzz_target;
use roost_solver::result::RunResult;

fuzz_target!(|bytes: &[u8]| {
    let Ok(result) = serde_json::from_slice::<RunResult>(bytes) else { return };
    let written = serde_json::to_vec(&result).expect("a result is JSON");
    let again: RunResult = serde_json::from_slice(&written).expect("what was read reads again");
    assert_eq!(again, result);
    assert_eq!(again.scenario.digest(), result.scenario.digest());
});

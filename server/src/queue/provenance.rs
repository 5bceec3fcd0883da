//! The provenance of a result: the job's scenario, and the solver that its worker registered.
//!
//! A worker registers its solver under an id that is new for each process, and an attempt belongs to the id that claimed it. A
//! result from the outbox of an upgraded worker names the process that ran it, and is checked against that registration.

use roost_api::Fault;
use serde_json::{Value, json};

use super::Refusal;

/// Scenario and solver of a result: as the result states them, or as they are registered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Provenance {
    /// Digest of the scenario.
    pub scenario: String,
    /// `SOLVER_REVISION` of the solver.
    pub revision: u32,
    /// Backend that computed it.
    pub backend: String,
    /// Device that computed it.
    pub device: String,
}

impl Provenance {
    /// Refuses a result whose provenance differs from the registered one.
    pub(crate) fn check(&self, registered: &Self) -> Result<(), Refusal> {
        if self.scenario != registered.scenario {
            return Err(Refusal::OtherScenario);
        }
        let faults: Vec<_> = [
            ("revision", json!(self.revision), json!(registered.revision)),
            ("backend", json!(self.backend), json!(registered.backend)),
            ("device", json!(self.device), json!(registered.device)),
        ]
        .into_iter()
        .filter(|(_, stated, registered)| stated != registered)
        .map(|(name, stated, registered)| fault(name, &stated, &registered))
        .collect();
        if faults.is_empty() { Ok(()) } else { Err(Refusal::OtherSolver(faults)) }
    }
}

fn fault(name: &str, stated: &Value, registered: &Value) -> Fault {
    let allowed = registered.as_str().map_or_else(|| registered.to_string(), str::to_owned);
    let detail = format!("differs from the {name} that its worker registered");
    Fault::new(&format!("/result/solver/{name}"), stated, detail, Some(allowed))
}

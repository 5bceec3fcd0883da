//! The origin of a result: it must be of the job's scenario, and computed by what its worker registered.
//!
//! A worker registers its solver under an id that is fresh for each process, and an attempt belongs to the id that claimed it. A result that
//! waited in an outbox while its worker was upgraded still names the process that ran it, and is held to that registration.

use roost_api::Fault;
use serde_json::{Value, json};

use super::Refusal;

/// What a result says of itself, or what it has to say.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Origin {
    /// Digest of the scenario.
    pub scenario: String,
    /// `SOLVER_REVISION` of the solver.
    pub revision: u32,
    /// Backend that computed it.
    pub backend: String,
    /// Device that computed it.
    pub device: String,
}

impl Origin {
    /// Refuses what a result says of itself where it differs from what is known.
    pub(crate) fn check(&self, known: &Self) -> Result<(), Refusal> {
        if self.scenario != known.scenario {
            return Err(Refusal::OtherScenario);
        }
        let faults: Vec<_> = [
            ("revision", json!(self.revision), json!(known.revision)),
            ("backend", json!(self.backend), json!(known.backend)),
            ("device", json!(self.device), json!(known.device)),
        ]
        .into_iter()
        .filter(|(_, says, registered)| says != registered)
        .map(|(name, says, registered)| fault(name, &says, &registered))
        .collect();
        if faults.is_empty() { Ok(()) } else { Err(Refusal::OtherSolver(faults)) }
    }
}

fn fault(name: &str, says: &Value, registered: &Value) -> Fault {
    let allowed = registered.as_str().map_or_else(|| registered.to_string(), str::to_owned);
    let detail = format!("not the {name} that its worker registered");
    Fault::new(&format!("/result/solver/{name}"), says, detail, Some(allowed))
}

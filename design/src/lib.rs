//! Decisions of studies: which runs come next, whether the study is finished, and its answer so far.
//!
//! [`decide`] is a pure function of the question, the results, the runs in flight and a seed. It knows no SQL, no HTTP, no
//! solver and no clock. The order of results does not matter: [`Evidence::new`] puts them into canonical order.
//!
//! | module | content |
//! |---|---|
//! | `factor`, `measure`, `budget` | the fields that all goals share |
//! | `evidence`, `proposal` | points in the unit cube, the runs at them, and runs that come next |
//! | `goals` | a file or folder per goal: its fields, its decision, its answer |
//! | `question` | the user's document: factors, goal, budget; its faults |
//! | `decision` | the decision: its proposals, the reason to stop, the answer as data |
//! | `forecast` | the number of runs before there are any |
//! | `intervals` | intervals of probabilities and means |
//! | `usable` | responses that a measure cannot use |

mod budget;
mod decision;
mod evidence;
mod factor;
mod fault;
pub mod forecast;
pub mod goals;
pub mod intervals;
mod measure;
pub mod model;
mod proposal;
mod question;
mod space;
#[cfg(test)]
mod tests;
mod usable;

pub use budget::Budget;
pub use decision::{Answer, Decision, ExcludedPoint, Finished, RunCounts};
pub use evidence::{Evidence, Outcome, Point, PointRuns, Run};
pub use factor::{Factor, Scale};
pub use fault::Fault;
pub use goals::{Finding, Goal};
pub use measure::Measure;
pub use proposal::Proposal;
pub use question::Question;
pub use usable::UnusableResponses;

/// Decides about a study: up to `wanted` runs that come next, whether it is finished, and the answer so far.
///
/// Runs in flight are part of the evidence ([`Outcome::Pending`]); nothing is proposed twice. The same arguments give the
/// same decision. The question must be without faults ([`Question::faults`]).
pub fn decide(question: &Question, evidence: &Evidence, wanted: usize, seed: u64) -> Decision {
    decision::decide(question, evidence, wanted, seed)
}

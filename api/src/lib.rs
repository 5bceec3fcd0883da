//! Wire types of the HTTP API, without IO: a file for each resource.
//!
//! Every type serialises to the JSON that `api.md` and `/openapi.json` describe. Clients ignore unknown fields of responses; the server refuses
//! unknown fields of requests.

pub mod ask;
pub mod checkpoint;
pub mod design;
pub mod event;
pub mod fill;
pub mod forecast;
pub mod frames;
pub mod ids;
pub mod job;
pub mod lease;
pub mod measurements;
pub mod mesh;
pub mod outputs;
pub mod page;
pub mod parameters;
pub mod printable;
pub mod problem;
pub mod project;
pub mod prune;
pub mod quantity;
pub mod queue;
pub mod short_names;
#[expect(dead_code, reason = "the types exist for their schemas alone")]
mod solver_documents;
pub mod study;
pub mod sweep;
pub mod table;
pub mod time;
pub mod token;
pub mod validate;
pub mod version;
mod words;
pub mod worker;

pub use roost_solver::result::{Estimate, Phase, Progress, RunResult, Series};
pub use roost_solver::scenario::Fault;

/// Version of the API, the first segment of every path.
pub const API_VERSION: &str = "v1";

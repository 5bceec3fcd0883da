//! The worker: claims jobs from a Roost server, runs the solver, delivers results.
//!
//! [`work`] runs a worker. Its parts:
//!
//! - [`client`]: the HTTP API, also for the `roost` command
//! - [`runner`]: one simulation in a thread of its own, on a [`device`]
//! - [`meshes`]: cache of STL files
//! - [`stop`]: requests to stop a run
//! - [`checkpoints`]: from a run to its upload
//! - [`fills`]: cache of filled states
//! - [`outbox`]: finished results on disk until the server has confirmed them
//! - `lease`: claims, heartbeats and deliveries
//!
//! The server alone decides which attempt of a job is valid: it fences every write by job and attempt number.

pub mod backoff;
pub mod checkpoints;
pub mod client;
mod config;
pub mod device;
pub mod fills;
mod lease;
mod memory;
mod memory_budget;
pub mod meshes;
pub mod outbox;
pub mod runner;
mod slots;
pub mod stop;

pub use config::{WorkerConfig, threads};
pub use lease::{WorkerError, work};
pub use slots::Slots;

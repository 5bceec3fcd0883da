//! The worker: claims jobs from a Roost server, runs the solver, delivers results.
//!
//! [`work`] is the whole of it. The pieces: [`client`] speaks the HTTP API (the `roost` command uses it too),
//! [`runner`] runs one scenario on a thread of its own, on a [`device`], [`meshes`] keeps the files that scenarios name, [`outbox`] keeps finished work on disk until
//! the server has it, and the private `lease` modules hold the leases in between. The worker decides nothing
//! about the queue: which attempt is valid is the server's word, fenced by job + attempt.

pub mod backoff;
pub mod client;
mod config;
pub mod device;
mod lease;
mod memory;
pub mod meshes;
pub mod outbox;
mod room;
pub mod runner;

pub use config::{WorkerConfig, threads};
pub use lease::{WorkerError, work};

//! The Roost server: a durable queue of jobs, sweeps, and the HTTP API to both.
//!
//! `http` answers requests; `document`, `mesh` and `validation` read what was submitted, `queue` decides, `sweep`
//! expands designs and sums results up with `stats` (all pure, the clock an argument); `store` keeps everything in one SQLite file, `kept` what was read of it for as long as it holds. axum is
//! used in `http` only, sqlx in `store` only: a test looks.

mod app;
mod clock;
mod config;
mod data;
mod document;
mod http;
mod kept;
mod mesh;
mod process;
mod queue;
mod reaper;
mod samples;
mod server;
pub mod stats;
mod store;
mod sweep;
mod validation;

pub use config::ServerConfig;
pub use data::{DataError, backup, restore, tokens_in};
pub use queue::{RetryPolicy, Tries};
pub use roost_solver::Limits;
pub use server::{Server, ServerError};
pub use store::{Bucket, Copied, NoBucket, StoreError, TokenFile};
pub use validation::{is_sweep, validate};

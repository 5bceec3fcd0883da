//! The Roost server: a durable queue of jobs, sweeps, and the HTTP API to both.
//!
//! | module | task |
//! |---|---|
//! | `http` | answers requests; the only module with axum |
//! | `state` | shared state of a running server: access, connections, caches, metrics, progress |
//! | `document`, `mesh`, `validation` | read and check submissions, pure |
//! | `queue`, `sweep` | decide on attempts; expand designs and summarize results with `roost_stats`, pure |
//! | `forecast` | says when jobs start and end, pure |
//! | `measurements` | reads what a laboratory measured, pure |
//! | `study` | reads studies, and states their answers, pure |
//! | `workbook` | writes tables for Excel |
//! | `sign_in` | signs users in with an identity provider; knows neither axum nor sqlx |
//! | `decider` | grows studies: a background task |
//! | `store` | the database, SQLite or PostgreSQL, and the objects; the only module with sqlx |
//! | `reaper` | background tasks |
//! | `repeated_failure` | logs an outage in a few lines |
//!
//! `server/tests/server/layout.rs` and `tests/dependencies/modules.rs` check these rules, and that modules have no import cycle.

mod clock;
mod config;
mod data;
mod decider;
mod document;
mod forecast;
mod http;
mod measurements;
mod mesh;
mod process;
mod queue;
mod reaper;
mod repeated_failure;
mod server;
mod sign_in;
mod state;
mod store;
mod study;
mod sweep;
mod validation;
mod workbook;

pub use config::ServerConfig;
pub use data::{DataError, backup, copy_database, database_in, restore, tokens_at, tokens_in};
pub use forecast::on_this_machine;
pub use http::openapi;
pub use measurements::{Lab, Target, TestTargets, read as read_measurements};
pub use queue::{RetryLimit, RetryPolicy};
pub use roost_solver::Limits;
pub use server::{Server, ServerError};
pub use sign_in::{SignInOptions, SignInSettings};
pub use store::{
    BackupReport, Bucket, BucketError, CopiedTable, Location, LocationError, NewToken, ProjectChange,
    ProjectError, StoreError, TokenFile,
};
pub use sweep::posterior_columns;
pub use validation::{is_measurements, is_study, is_sweep, validate};

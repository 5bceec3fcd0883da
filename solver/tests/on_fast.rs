//! The suites of closed forms once more, on the fast path (see `common::backend`).
#![allow(clippy::duplicate_mod, reason = "each suite brings what they have in common along")]

#[path = "bonds.rs"]
mod bonds;
#[path = "conservation.rs"]
mod conservation;
#[path = "contact.rs"]
mod contact;
#[path = "crossing.rs"]
mod crossing;
#[path = "determinism.rs"]
mod determinism;
#[path = "equipment.rs"]
mod equipment;
#[path = "film.rs"]
mod film;
#[path = "friction.rs"]
mod friction;
#[path = "moments.rs"]
mod moments;
#[path = "moving.rs"]
mod moving;
#[path = "periodic.rs"]
mod periodic;
#[path = "common/stl.rs"]
mod stl;
#[path = "timestep.rs"]
mod timestep;

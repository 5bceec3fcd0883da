//! Faults of real processes: kills, stops, a faulty network, changed clocks, a full disk. No job may be lost, no result recorded
//! twice, no stale write accepted.

mod clock;
#[path = "../../server/src/store/testing/cluster.rs"]
mod cluster;
mod disk;
mod dump;
mod handover;
mod kills;
mod postgres;
mod recovery;
mod requests;
mod servers;
#[path = "../support/mod.rs"]
mod support;
mod upgrades;

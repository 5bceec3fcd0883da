//! What goes wrong in a farm, done to real processes: kills, stops, a bad network, a clock that is set, a disk that is full. No job
//! may be lost, no result recorded twice, no stale write accepted.

mod clock;
mod disk;
mod kills;
#[path = "../support/mod.rs"]
mod support;

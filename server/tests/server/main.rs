//! Black-box tests of the server: HTTP on loopback, a SQLite file in a temporary directory.

mod access;
mod bad_input;
mod cancel;
mod checkpoints;
mod claims;
mod connections;
mod contract;
mod dashboard;
mod designs;
mod docs;
mod etags;
mod events;
mod fences;
mod frames;
mod imports;
mod layout;
mod leases;
mod lifecycle;
mod limits;
mod meshes;
mod metrics;
mod origins;
mod pages;
mod pauses;
mod retries;
mod safety;
mod series;
mod start_stop;
#[path = "../../../tests/support/stl.rs"]
mod stl;
mod submissions;
mod sweeps;
mod tables;
mod test_server;
mod turns;
mod upgrade;

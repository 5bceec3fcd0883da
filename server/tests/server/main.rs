//! The server from outside: real HTTP on loopback, a real SQLite file in a directory of its own.

mod access;
mod bad_input;
mod cancel;
mod claims;
mod connections;
mod contract;
mod dashboard;
mod designs;
mod docs;
mod events;
mod farm;
mod fences;
mod frames;
mod imports;
mod layout;
mod leases;
mod lifecycle;
mod limits;
mod meshes;
mod origins;
mod pages;
mod readers;
mod retries;
mod safety;
mod series;
mod start_stop;
#[path = "../../../tests/support/stl.rs"]
mod stl;
mod submissions;
mod sweeps;
mod tables;
mod tags;
mod turns;
mod upgrade;

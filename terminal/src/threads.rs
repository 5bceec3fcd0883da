//! The option `--threads`.

use clap::builder::RangedI64ValueParser;

use crate::message;

/// The values that `--threads` accepts.
pub fn value_parser() -> RangedI64ValueParser<u16> {
    clap::value_parser!(u16).range(0..=1024)
}

/// Number of threads that compute: one per processor for 0, and never more than there are processors.
pub fn count(requested: u16) -> usize {
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    if requested == 0 { processors } else { processors.min(requested.into()) }
}

/// Warns on stderr if more threads are requested than compute.
pub fn warn_if_too_many(requested: u16) {
    let count = count(requested);
    if count < requested.into() {
        message!("warning: --threads {requested} is more than there are processors; {count} compute");
    }
}

//! What people see: progress bars on stderr, tables on stdout, plots in files.

pub(crate) mod format;
pub(crate) mod meter;
pub(crate) mod plot;
pub(crate) mod table;

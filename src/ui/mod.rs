//! What people see: progress bars on stderr, tables on stdout, plots in files.

pub(crate) mod format;
pub(crate) mod meter;
pub(crate) mod plot;
pub(crate) mod table;

use std::fmt::Display;
use std::io::{self, Write};

/// A line on stderr. A reader that has seen enough (`2>&1 | head`) ends nothing: what is computed is still written.
macro_rules! say {
    ($($text:tt)*) => {{
        use std::io::Write as _;
        // To whom should it be told?
        let _ = writeln!(std::io::stderr(), $($text)*);
    }};
}
pub(crate) use say;

/// Prints to stdout. A reader that has seen enough (`| head`) is an error to pass up, not a panic.
pub(crate) fn print(text: impl Display) -> io::Result<()> {
    write(text.to_string().as_bytes())
}

/// Writes bytes to stdout, likewise.
pub(crate) fn write(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}

/// The same, with the end of the line.
pub(crate) fn println(text: impl Display) -> io::Result<()> {
    print(format_args!("{text}\n"))
}

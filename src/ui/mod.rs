//! What people see: progress bars on stderr, tables on stdout, plots in files.
//!
//! All output to a terminal goes through here, and nothing that a document or a server holds can drive it: [`say!`] and
//! [`println`] take one line and escape line ends within, [`print`] takes lines of our own, cells of tables and words of
//! meters are escaped one by one.

pub(crate) mod format;
pub(crate) mod log;
pub(crate) mod meter;
pub(crate) mod plot;
pub(crate) mod table;

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

use roost_api::printable;
use serde_json::Value;

/// A line on stderr. A reader that has seen enough (`2>&1 | head`) ends nothing: what is computed is still written.
macro_rules! say {
    ($($text:tt)*) => {
        $crate::ui::tell(&roost_api::printable::one_line(&format!($($text)*)))
    };
}
pub(crate) use say;

/// Lines of our own on stderr, such as an error with a list of faults.
pub(crate) fn say_lines(text: impl Display) {
    tell(&printable::lines(&text.to_string()));
}

/// For [`say!`]: the text is safe.
pub(crate) fn tell(text: &str) {
    // To whom should a failure be told?
    let _ = writeln!(io::stderr(), "{text}");
}

/// Prints lines of our own to stdout. A reader that has seen enough (`| head`) is an error to pass up, not a panic.
pub(crate) fn print(text: impl Display) -> io::Result<()> {
    send(printable::lines(&text.to_string()).as_bytes())
}

/// Prints one line, likewise.
pub(crate) fn println(text: impl Display) -> io::Result<()> {
    send(format!("{}\n", printable::one_line(&text.to_string())).as_bytes())
}

/// Prints a JSON document, likewise; it stays the same document.
pub(crate) fn json(document: &Value) -> io::Result<()> {
    print(format_args!("{document:#}\n"))
}

/// Writes the content of a file to stdout: as it is, but for text on a terminal.
pub(crate) fn write(content: &[u8]) -> io::Result<()> {
    match std::str::from_utf8(content) {
        Ok(text) if io::stdout().is_terminal() => print(text),
        _ => send(content),
    }
}

fn send(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}

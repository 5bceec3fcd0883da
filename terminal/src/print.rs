//! Text on stdout and stderr, escaped so that it cannot control the terminal.

use std::fmt::Display;
use std::io::{self, IsTerminal, Write};

use roost_api::printable;
use serde_json::Value;

/// Prints one line on stderr. A closed pipe (`2>&1 | head`) is no error: results are still written.
#[macro_export]
macro_rules! message {
    ($($text:tt)*) => {
        $crate::message_line(&format!($($text)*))
    };
}

/// Prints one line on stderr, for [`crate::message!`].
pub fn message_line(text: &str) {
    write_to_stderr(&printable::one_line(text));
}

/// Prints lines that the command itself has made on stderr, such as an error with a list of faults.
pub fn message_lines(text: impl Display) {
    write_to_stderr(&printable::lines(&text.to_string()));
}

fn write_to_stderr(text: &str) {
    // There is no other place to report a failure of stderr.
    let _ = writeln!(io::stderr(), "{text}");
}

/// Prints lines that the command itself has made on stdout.
///
/// # Errors
/// If stdout cannot be written, such as a closed pipe (`| head`).
pub fn print_lines(text: impl Display) -> io::Result<()> {
    write_to_stdout(printable::lines(&text.to_string()).as_bytes())
}

/// Prints one line on stdout.
///
/// # Errors
/// If stdout cannot be written.
pub fn print_line(text: impl Display) -> io::Result<()> {
    write_to_stdout(format!("{}\n", printable::one_line(&text.to_string())).as_bytes())
}

/// Prints a JSON document on stdout. Escapes keep it the same document.
///
/// # Errors
/// If stdout cannot be written.
pub fn print_json(document: &Value) -> io::Result<()> {
    print_lines(format_args!("{document:#}\n"))
}

/// Writes the content of a file to stdout. Text is escaped on a terminal; everything else is written unchanged.
///
/// # Errors
/// If stdout cannot be written.
pub fn print_content(content: &[u8]) -> io::Result<()> {
    match std::str::from_utf8(content) {
        Ok(text) if io::stdout().is_terminal() => print_lines(text),
        _ => write_to_stdout(content),
    }
}

fn write_to_stdout(bytes: &[u8]) -> io::Result<()> {
    let mut stdout = io::stdout().lock();
    stdout.write_all(bytes)?;
    stdout.flush()
}

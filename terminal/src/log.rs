//! The log on stderr: one line per event, whatever names and messages it contains.

use std::io::{self, IsTerminal, Write};

use roost_api::printable::one_line;

/// A writer of log events to stderr. It expects each event in one call, as `tracing-subscriber` writes them.
pub fn log_writer() -> impl Write {
    LogWriter { has_colours: io::stderr().is_terminal() }
}

struct LogWriter {
    has_colours: bool,
}

impl Write for LogWriter {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(event);
        let line = escape(text.strip_suffix('\n').unwrap_or(&text), self.has_colours);
        io::stderr().write_all(format!("{line}\n").as_bytes())?;
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The event as one line. Colours (`ESC [ … m`) stay: `tracing-subscriber` has escaped those in the data.
fn escape(event: &str, has_colours: bool) -> String {
    let mut parts = event.split("\x1b[");
    let mut line = one_line(parts.next().unwrap_or_default()).into_owned();
    for part in parts {
        let parameters = part.find(|c: char| !c.is_ascii_digit() && c != ';').unwrap_or(part.len());
        if has_colours && part[parameters..].starts_with('m') {
            line.push_str("\x1b[");
        } else {
            line.push_str(&one_line("\x1b["));
        }
        line.push_str(&one_line(part));
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn event_is_one_line_and_keeps_only_its_colours() {
        let event = "\x1b[32m INFO\x1b[0m name=a\nb\x1b[2J\x1b]0;x\u{7}\u{202e}";
        assert_eq!(escape(event, true), "\x1b[32m INFO\x1b[0m name=a\\nb\\u001b[2J\\u001b]0;x\\u0007\\u202e");
        assert_eq!(escape("\x1b[32mgreen", false), "\\u001b[32mgreen");
    }
}

//! The log on stderr: one line an event, whatever names and messages are in it.

use std::io::{self, IsTerminal, Write};

use roost_api::printable::one_line;

/// Where the log goes.
pub(crate) fn log() -> impl Write {
    Log { has_colours: io::stderr().is_terminal() }
}

/// Takes each event in one call, as `tracing-subscriber` writes them.
struct Log {
    has_colours: bool,
}

impl Write for Log {
    fn write(&mut self, event: &[u8]) -> io::Result<usize> {
        let text = String::from_utf8_lossy(event);
        let line = safe(text.strip_suffix('\n').unwrap_or(&text), self.has_colours);
        io::stderr().write_all(format!("{line}\n").as_bytes())?;
        Ok(event.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The event in one line. Colours (`ESC [ … m`) stay: `tracing-subscriber` has escaped those in the data.
fn safe(event: &str, has_colours: bool) -> String {
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
    fn an_event_is_one_line_and_keeps_its_colours_alone() {
        let event = "\x1b[32m INFO\x1b[0m name=a\nb\x1b[2J\x1b]0;x\u{7}\u{202e}";
        assert_eq!(safe(event, true), "\x1b[32m INFO\x1b[0m name=a\\nb\\u001b[2J\\u001b]0;x\\u0007\\u202e");
        assert_eq!(safe("\x1b[32mgreen", false), "\\u001b[32mgreen");
    }
}

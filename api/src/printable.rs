//! Escapes untrusted text (names, labels, messages) for a terminal: control characters would control it, and direction marks would disguise the
//! text.
//!
//! Escapes are those of JSON, so that a JSON document keeps its meaning.

use std::borrow::Cow;
use std::fmt::Write;

use crate::Fault;

/// The text as one line: line ends and tabs are escaped as well.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_unsafe)
}

/// The text with its line ends and tabs, which must come from Roost: untrusted ones could imitate a line of output.
pub fn lines(text: &str) -> Cow<'_, str> {
    escaped(text, |c| is_unsafe(c) && !matches!(c, '\n' | '\t'))
}

/// A fault as one line: its JSON pointer, the detail and the allowed values. An empty pointer is the document itself.
pub fn fault_line(fault: &Fault) -> String {
    let text = if fault.pointer.is_empty() { format!("the document{fault}") } else { fault.to_string() };
    one_line(&text).into_owned()
}

/// Control characters (C0, DEL, C1), invisible characters, line separators and direction marks.
fn is_unsafe(c: char) -> bool {
    c.is_control()
        || matches!(c,
            '\u{ad}' | '\u{61c}' | '\u{180e}' | '\u{feff}'
            | '\u{200b}'..='\u{200f}' // zero width, direction marks
            | '\u{2028}'..='\u{202e}' // line and paragraph separators, direction embeddings and overrides
            | '\u{2060}'..='\u{206f}' // invisible operators, direction isolates
            | '\u{fff9}'..='\u{fffb}' // annotations
            | '\u{e0000}'..='\u{e007f}' // tags
        )
}

fn escaped(text: &str, is_escaped: impl Fn(char) -> bool) -> Cow<'_, str> {
    if !text.contains(&is_escaped) {
        return Cow::Borrowed(text);
    }
    let mut safe = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match c {
            c if !is_escaped(c) => safe.push(c),
            '\n' => safe.push_str("\\n"),
            '\r' => safe.push_str("\\r"),
            '\t' => safe.push_str("\\t"),
            c => {
                for unit in c.encode_utf16(&mut [0; 2]) {
                    write!(safe, "\\u{unit:04x}").expect("a string accepts all text");
                }
            }
        }
    }
    Cow::Owned(safe)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_and_direction_marks_are_escaped() {
        assert_eq!(one_line("a\u{1b}]0;owned\u{7}b"), "a\\u001b]0;owned\\u0007b");
        assert_eq!(one_line("a\r\n\tb\u{7f}\u{9b}31m"), "a\\r\\n\\tb\\u007f\\u009b31m");
        assert_eq!(one_line("\u{202e}gpj.exe\u{2066}\u{200b}"), "\\u202egpj.exe\\u2066\\u200b");
        assert_eq!(one_line("\u{e0041}"), "\\udb40\\udc41");
        assert_eq!(lines("a\n\tb\r\u{1b}[2J"), "a\n\tb\\r\\u001b[2J");
        let plain = "Größe 4.21 ± 0.2 · 日本 🍗 عربي e\u{301}";
        assert!(matches!(one_line(plain), Cow::Borrowed(text) if text == plain));
    }

    #[test]
    fn escaped_json_document_parses_to_the_same_value() {
        let document = serde_json::json!({"name": "\u{1b}[31m\u{7f}\u{202e}\n\u{e0041}\\ \""});
        let shown = format!("{document:#}\n");
        let safe = lines(&shown);
        assert!(!safe.chars().any(|c| is_unsafe(c) && c != '\n'), "{safe:?}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&safe).expect("JSON"), document);
    }
}

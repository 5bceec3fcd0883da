//! Progress on stderr: a bar on a terminal, otherwise a line now and then.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use roost_api::printable::one_line;

use crate::message;

/// Without a terminal, a line is printed at most this often.
const LINE_INTERVAL: Duration = Duration::from_secs(10);
const RESOLUTION: u64 = 1000;

/// Several bars, one below the other.
#[derive(Debug, Default)]
pub struct Bars(MultiProgress);

impl Bars {
    /// Adds a bar below the others.
    pub fn add(&self, name: impl Into<String>) -> Bar {
        let name = one_line(&name.into()).into_owned();
        let bar = self.0.add(ProgressBar::new(RESOLUTION));
        let style = ProgressStyle::with_template("{prefix} {bar:20.cyan/dim} {percent:>3} %  {wide_msg}");
        bar.set_style(style.expect("the template is well formed").progress_chars("━╸─"));
        bar.set_prefix(name.clone());
        Bar { bar, name, last_line: None, is_terminal: std::io::stderr().is_terminal() }
    }
}

/// The progress of one activity.
#[derive(Debug)]
pub struct Bar {
    bar: ProgressBar,
    name: String,
    last_line: Option<Instant>,
    is_terminal: bool,
}

impl Bar {
    /// A single bar.
    pub fn new(name: impl Into<String>) -> Self {
        Bars::default().add(name)
    }

    /// Shows the fraction done (0 to 1) and a text.
    pub fn update(&mut self, fraction: f64, text: &str) {
        if self.is_terminal {
            self.bar.set_message(one_line(text).into_owned());
            self.bar.set_position(position(fraction));
        } else if self.last_line.is_none_or(|last| last.elapsed() >= LINE_INTERVAL) {
            self.print_line(fraction, text);
        }
    }

    /// Prints a line above the bar, which stays there.
    pub fn message(&self, line: &str) {
        self.bar.suspend(|| message!("{line}"));
    }

    /// Shows the last fraction and text; the bar stays.
    pub fn finish(mut self, fraction: f64, text: &str) {
        if self.is_terminal {
            self.bar.set_position(position(fraction));
            self.bar.abandon_with_message(one_line(text).into_owned());
        } else {
            self.print_line(fraction, text);
        }
    }

    /// Removes the bar.
    pub fn clear(self) {
        self.bar.finish_and_clear();
    }

    fn print_line(&mut self, fraction: f64, text: &str) {
        message!("{} {:.0} %  {text}", self.name, fraction * 100.0);
        self.last_line = Some(Instant::now());
    }
}

fn position(fraction: f64) -> u64 {
    (fraction.clamp(0.0, 1.0) * RESOLUTION as f64) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_texts_of_a_bar_are_escaped() {
        let mut bar = Bar { is_terminal: true, ..Bar::new("a\u{1b}[2J\nb") };
        bar.update(0.5, "c\u{7}\u{202e}d");
        assert_eq!((bar.name.as_str(), bar.bar.prefix().as_str()), ("a\\u001b[2J\\nb", "a\\u001b[2J\\nb"));
        assert_eq!(bar.bar.message(), "c\\u0007\\u202ed");
        let shown = bar.bar.clone();
        bar.finish(1.0, "e\u{9b}31m");
        assert_eq!(shown.message(), "e\\u009b31m");
    }
}

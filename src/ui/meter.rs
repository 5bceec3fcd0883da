//! Progress on stderr: a bar on a terminal, now and then a line in a log.

use std::io::IsTerminal;
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use roost_api::printable::one_line;

use super::say;

/// In a log a line at most this often.
const LINE_EVERY: Duration = Duration::from_secs(10);
const RESOLUTION: u64 = 1000;

/// Several meters above each other.
#[derive(Debug, Default)]
pub(crate) struct Meters(MultiProgress);

impl Meters {
    /// A meter below the others.
    pub(crate) fn add(&self, name: impl Into<String>) -> Meter {
        let name = one_line(&name.into()).into_owned();
        let bar = self.0.add(ProgressBar::new(RESOLUTION));
        let style = ProgressStyle::with_template("{prefix} {bar:20.cyan/dim} {percent:>3} %  {wide_msg}");
        bar.set_style(style.expect("the template is well formed").progress_chars("━╸─"));
        bar.set_prefix(name.clone());
        Meter { bar, name, last_line: None, is_terminal: std::io::stderr().is_terminal() }
    }
}

/// The progress of one thing.
#[derive(Debug)]
pub(crate) struct Meter {
    bar: ProgressBar,
    name: String,
    last_line: Option<Instant>,
    is_terminal: bool,
}

impl Meter {
    /// A meter that stands alone.
    pub(crate) fn new(name: impl Into<String>) -> Self {
        Meters::default().add(name)
    }

    /// Shows how far it has come (0 to 1), and words to go with it.
    pub(crate) fn show(&mut self, fraction: f64, words: String) {
        if self.is_terminal {
            self.bar.set_message(one_line(&words).into_owned());
            self.bar.set_position((fraction.clamp(0.0, 1.0) * RESOLUTION as f64) as u64);
        } else if self.last_line.is_none_or(|last| last.elapsed() >= LINE_EVERY) {
            self.line(fraction, &words);
        }
    }

    /// A line that stays, above the bar.
    pub(crate) fn tell(&self, line: &str) {
        self.bar.suspend(|| say!("{line}"));
    }

    /// The last word; the bar stays.
    pub(crate) fn finish(self, fraction: f64, words: String) {
        if self.is_terminal {
            self.bar.set_position((fraction.clamp(0.0, 1.0) * RESOLUTION as f64) as u64);
            self.bar.abandon_with_message(one_line(&words).into_owned());
        } else {
            let mut meter = self;
            meter.line(fraction, &words);
        }
    }

    /// Takes the bar away without a word.
    pub(crate) fn clear(self) {
        self.bar.finish_and_clear();
    }

    fn line(&mut self, fraction: f64, words: &str) {
        say!("{} {:.0} %  {words}", self.name, fraction * 100.0);
        self.last_line = Some(Instant::now());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_and_words_are_escaped_on_a_bar() {
        let mut meter = Meter { is_terminal: true, ..Meter::new("a\u{1b}[2J\nb") };
        meter.show(0.5, "c\u{7}\u{202e}d".to_owned());
        assert_eq!(
            (meter.name.as_str(), meter.bar.prefix().as_str()),
            ("a\\u001b[2J\\nb", "a\\u001b[2J\\nb")
        );
        assert_eq!(meter.bar.message(), "c\\u0007\\u202ed");
        let bar = meter.bar.clone();
        meter.finish(1.0, "e\u{9b}31m".to_owned());
        assert_eq!(bar.message(), "e\\u009b31m");
    }
}

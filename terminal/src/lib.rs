//! Shared parts of the commands of `roost`: messages and progress bars on stderr, tables on stdout, plots in files, documents from
//! files, exit codes and signals.
//!
//! All output to a terminal goes through this crate, and nothing in a document or from a server can control the terminal:
//! [`message!`] and [`print_line`] escape line ends within their text, [`print_lines`] takes lines that the command itself has
//! made, and tables and progress bars escape every cell and every text.

pub mod exit;
pub mod format;
pub mod input;
mod log;
pub mod plot;
mod print;
pub mod progress;
pub mod signals;
mod table;
pub mod threads;

pub use exit::{BadInput, Exit};
pub use log::log_writer;
pub use print::{message_line, message_lines, print_content, print_json, print_line, print_lines};
pub use table::Table;

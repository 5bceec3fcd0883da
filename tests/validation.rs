//! The validation page: its data are a complete standard report of the current solver, and its tables are those of the data.
//!
//! `make validation` simulates the report and writes both; docs/reproduce.md states how long it takes.

#[path = "../solver/tests/common/generated.rs"]
mod generated;

use std::path::PathBuf;

use generated::assert_generated;
use roost_reproduce::Document;

const DATA: &str = "docs/data/validation.json";

fn path(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join(name)
}

fn data() -> Document {
    let text = std::fs::read_to_string(path(DATA)).unwrap_or_else(|error| panic!("{DATA}: {error}"));
    Document::from_json(&text).unwrap_or_else(|error| panic!("{DATA}: {error}"))
}

#[test]
fn data_are_a_complete_standard_report_of_this_solver() {
    let faults = data().faults("standard");
    assert!(faults.is_empty(), "{DATA} is stale: run `make validation`\n{}", faults.join("\n"));
}

#[test]
fn tables_of_the_page_are_those_of_the_data() {
    let (page, data) = (path("docs/validation.md"), data());
    assert_generated(&page, &format!("{DATA}, summary:"), &data.summary_markdown());
    let figures = data.figures();
    assert!(figures.len() > 10, "{figures:?}");
    for figure in figures {
        assert_generated(&page, &format!("{DATA}, {figure}:"), &data.figure_markdown(figure));
    }
}

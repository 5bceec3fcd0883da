//! The pages of the experiments in `docs/reference/`: generated tables, valid examples, and links to every page.

#[path = "common/generated.rs"]
mod generated;

use std::path::{Path, PathBuf};

use generated::{assert_generated, assert_text};
use roost_solver::experiments::{output_tables_markdown, overview_markdown, warnings_markdown};
use roost_solver::mesh::Meshes;
use roost_solver::scenario::fields::EXPERIMENTS;
use roost_solver::{Limits, check, scenario};

fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name)
}

fn read(name: &str) -> String {
    std::fs::read_to_string(docs(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Begins the page of a new experiment, with `ROOST_WRITE=1`.
fn begin_missing(page: &Path, experiment: &str) {
    if page.exists() || std::env::var_os("ROOST_WRITE").is_none() {
        return;
    }
    let generated = |source| {
        let command = "ROOST_WRITE=1 cargo test -p roost-solver --test pages";
        format!("<!-- Generated from {source}: {command} -->\n<!-- end of the generated part -->\n")
    };
    let head = format!("# Experiment: {experiment}\n\n```json\n{{\"experiment\": \"{experiment}\"}}\n```\n");
    let (results, fields) = (generated("the table of results"), generated("the field table"));
    std::fs::write(page, format!("{head}\n## Results\n\n{results}\n## Fields\n\n{fields}"))
        .expect("a new page");
}

#[test]
fn every_experiment_has_a_page_with_its_fields_results_and_an_example() {
    for experiment in EXPERIMENTS {
        let page = docs(&format!("reference/{experiment}.md"));
        begin_missing(&page, experiment);
        let table = scenario::field_tables_markdown(experiment);
        assert_generated(&page, "the field table", table.trim_end());
        assert_generated(&page, "the table of results", output_tables_markdown(experiment).trim_end());
        assert_valid_example(experiment);
    }
}

#[test]
fn the_page_of_responses_has_every_warning() {
    assert_generated(&docs("responses.md"), "the table of warnings", warnings_markdown().trim_end());
}

#[test]
fn overview_pages_list_every_experiment() {
    let mark = "the declarations of experiments";
    assert_generated(&docs("start.md"), mark, overview_markdown("reference/").trim_end());
    let links: Vec<String> = EXPERIMENTS.iter().map(|name| format!("[{name}]({name}.md)")).collect();
    assert_generated(&docs("reference/scenario.md"), mark, &links.join(", "));
}

/// The book's contents list the pages of experiments below the page of scenarios; mdBook allows no comment there.
#[test]
fn contents_list_every_experiment() {
    let contents = read("SUMMARY.md");
    let (head, rest) = contents.split_once("(reference/scenario.md)\n").expect("the page of scenarios");
    let others = rest.lines().skip_while(|line| line.starts_with("  - ["));
    let ours = EXPERIMENTS.iter().map(|name| format!("  - [{name}](reference/{name}.md)"));
    let lines: Vec<String> = ours.chain(others.map(str::to_owned)).collect();
    let expected = format!("{head}(reference/scenario.md)\n{}\n", lines.join("\n"));
    assert_text(&docs("SUMMARY.md"), &contents, &expected);
}

/// Asserts that the example on the page of an experiment can run.
fn assert_valid_example(experiment: &str) {
    let page = read(&format!("reference/{experiment}.md"));
    let document =
        page.split("```json\n").nth(1).and_then(|rest| rest.split("\n```").next()).expect("a scenario");
    let scenario = scenario::from_value(&serde_json::from_str(document).expect("JSON"))
        .unwrap_or_else(|faults| panic!("{experiment}: {faults:?}"));
    check(&scenario, &Meshes::default(), &Limits::default()).expect("a scenario that can run");
}

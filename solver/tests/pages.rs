//! The pages of the experiments in `docs/reference/`: generated tables, valid examples, and links to every page.

#[path = "common/generated.rs"]
mod generated;

use std::path::{Path, PathBuf};

use generated::assert_generated;
use roost_solver::experiments::output_tables_markdown;
use roost_solver::mesh::Meshes;
use roost_solver::scenario::fields::EXPERIMENTS;
use roost_solver::{Limits, check, scenario};

fn docs(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs").join(name)
}

fn read(name: &str) -> String {
    std::fs::read_to_string(docs(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

#[test]
fn every_experiment_has_a_page_with_its_fields_and_results() {
    for experiment in EXPERIMENTS {
        let table = scenario::field_tables_markdown(experiment);
        assert_generated(&docs(&format!("reference/{experiment}.md")), "the field table", table.trim_end());
        let tables = output_tables_markdown(experiment);
        assert_generated(
            &docs(&format!("reference/{experiment}.md")),
            "the table of results",
            tables.trim_end(),
        );
    }
}

#[test]
fn overview_pages_link_every_experiment() {
    for experiment in EXPERIMENTS {
        assert!(
            read("start.md").contains(&format!("[{experiment}](reference/{experiment}.md)")),
            "{experiment}"
        );
        assert!(
            read("reference/scenario.md").contains(&format!("[{experiment}]({experiment}.md)")),
            "{experiment}"
        );
    }
}

#[test]
fn scenarios_on_the_experiment_pages_are_valid() {
    for experiment in EXPERIMENTS {
        let page = read(&format!("reference/{experiment}.md"));
        let document =
            page.split("```json\n").nth(1).and_then(|rest| rest.split("\n```").next()).expect("a scenario");
        let scenario = scenario::from_value(&serde_json::from_str(document).expect("JSON"))
            .unwrap_or_else(|faults| panic!("{experiment}: {faults:?}"));
        let (meshes, limits) = (Meshes::default(), Limits::default());
        check(&scenario, &meshes, &limits).expect("a scenario that can run");
    }
}

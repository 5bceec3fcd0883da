//! Checks of the dependencies between crates.

use std::path::Path;
use std::process::Command;

/// Names and versions of a crate and all its dependencies, without optional ones of features that are off.
fn dependencies(package: &str) -> String {
    let cargo = Command::new(env!("CARGO"))
        .args(["tree", "--offline", "--prefix", "none", "--edges", "normal", "--package", package])
        .current_dir(Path::new(env!("CARGO_MANIFEST_DIR")))
        .output();
    let tree = String::from_utf8(cargo.expect("cargo runs").stdout).expect("text");
    assert!(tree.starts_with(&format!("{package} v")), "no tree of {package}");
    tree
}

#[test]
fn default_build_has_the_gpu_backend_and_no_optional_crates() {
    let command = dependencies("roost");
    assert!(command.contains("wgpu v"), "the command has the GPU backend");
    for optional in ["opentelemetry", "h2 v", "crc-fast v"] {
        assert!(!command.contains(optional), "{optional} comes with a feature that is off");
    }
}

#[test]
fn server_has_no_wgpu() {
    let server = dependencies("roost-server");
    assert!(server.contains("roost-solver v") && !server.contains("wgpu"), "{server}");
}

#[test]
fn crates_import_only_what_the_architecture_allows() {
    for (package, forbidden) in [
        ("roost-server", ["roost-worker v"].as_slice()),
        ("roost-worker", &["roost-server v"]),
        ("roost-reproduce", &["roost-server v", "roost-worker v"]),
        ("roost-bench", &["roost-server v"]),
        ("roost-terminal", &["roost-server v", "roost-worker v"]),
        ("roost-python", &["roost-api v", "roost-worker v", "tokio v", "hyper v", "reqwest v"]),
        ("roost-stats", &["roost-solver v", "roost-api v"]),
        (
            "roost-design",
            &["roost-solver v", "roost-api v", "roost-server v", "sqlx v", "hyper v", "tokio v"],
        ),
    ] {
        let tree = dependencies(package);
        let found: Vec<_> = forbidden.iter().filter(|name| tree.contains(**name)).collect();
        assert!(found.is_empty(), "{package} imports {found:?}");
    }
}

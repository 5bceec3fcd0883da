//! Checks of the dependencies between crates, and between the modules of each crate.

#[path = "dependencies/modules.rs"]
mod modules;

use std::path::{Path, PathBuf};
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
        (
            "roost-python",
            &[
                "roost-api v",
                "roost-bench v",
                "roost-design v",
                "roost-reproduce v",
                "roost-server v",
                "roost-stats v",
                "roost-terminal v",
                "roost-worker v",
                "tokio v",
                "hyper v",
                "reqwest v",
            ],
        ),
        ("roost-stats", &["roost-solver v", "roost-api v"]),
        (
            "roost-design",
            &[
                "roost-api v",
                "roost-bench v",
                "roost-frames v",
                "roost-python v",
                "roost-reproduce v",
                "roost-server v",
                "roost-solver v",
                "roost-terminal v",
                "roost-worker v",
                "sqlx v",
                "hyper v",
                "tokio v",
            ],
        ),
    ] {
        let tree = dependencies(package);
        let found: Vec<_> = forbidden.iter().filter(|name| tree.contains(**name)).collect();
        assert!(found.is_empty(), "{package} imports {found:?}");
    }
}

/// The Rust files below `src` of all crates.
fn sources() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let crates =
        std::fs::read_dir(root).expect("the repository").map(|entry| entry.expect("an entry").path());
    let mut folders: Vec<PathBuf> = crates
        .map(|folder| folder.join("src"))
        .chain([root.join("src")])
        .filter(|folder| folder.is_dir())
        .collect();
    let mut files = Vec::new();
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            match path.is_dir() {
                true => folders.push(path),
                false => files.extend(path.extension().is_some_and(|it| it == "rs").then_some(path.clone())),
            }
        }
    }
    files
}

#[test]
fn base64_is_imported_by_frames_and_sign_in_alone() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let allowed = ["frames/src", "server/src/sign_in"].map(|folder| root.join(folder));
    let imports = |path: &PathBuf| std::fs::read_to_string(path).expect("a source").contains("base64::");
    let (kept, wrong): (Vec<_>, Vec<_>) = sources()
        .into_iter()
        .filter(imports)
        .partition(|path| allowed.iter().any(|folder| path.starts_with(folder)));
    assert!(kept.len() > 2 && wrong.is_empty(), "{wrong:?}");
}

//! The layers: axum in `http` only, sqlx in `store` only, neither IO nor clock in pure modules.

use std::path::{Path, PathBuf};

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            sources(&path, found);
        } else {
            found.push(path);
        }
    }
}

/// Lines with one of these words in the files for which `here` is true.
fn uses(words: &[&str], here: impl Fn(&str) -> bool) -> Vec<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    let mut found = Vec::new();
    for file in files {
        let name = file.strip_prefix(&root).unwrap().to_str().unwrap().to_owned();
        let text = std::fs::read_to_string(&file).unwrap();
        assert!(text.starts_with("//!"), "{name} does not say what it is");
        let code = text.lines().filter(|line| !line.trim_start().starts_with("//"));
        let using = code.filter(|line| words.iter().any(|word| line.contains(word)));
        if here(&name) {
            found.extend(using.map(|line| format!("{name}: {}", line.trim())));
        }
    }
    found
}

#[test]
fn axum_is_used_in_http_only_and_sqlx_in_store_only() {
    assert_eq!(uses(&["axum", "tower_http"], |file| !file.starts_with("http/")), [""; 0]);
    assert_eq!(uses(&["sqlx"], |file| !file.starts_with("store/")), [""; 0]);
    assert!(!uses(&["axum"], |file| file.starts_with("http/")).is_empty(), "what the check looks for");
}

#[test]
fn pure_modules_use_neither_io_nor_clock() {
    let pure = |file: &str| {
        ["queue/", "sweep/", "study/", "document/", "forecast/", "measurements/", "mesh.rs", "validation.rs"]
            .iter()
            .any(|at| file.starts_with(at))
    };
    let io = [
        "tokio",
        "Timestamp::now",
        "Instant::now",
        "SystemTime",
        "std::fs",
        "std::net",
        "crate::store",
        "crate::http",
    ];
    assert_eq!(uses(&io, pure), [""; 0]);
    assert_eq!(uses(&["crate::http"], |file| file.starts_with("store/")), [""; 0]);
}

//! The layers keep apart: axum in `http` only, sqlx in `store` only, no IO and no clock in what decides.

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

/// Lines of files for which `here` is true that use one of these words, with their file.
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
fn axum_and_sqlx_stay_where_they_belong() {
    assert_eq!(uses(&["axum", "tower_http"], |file| !file.starts_with("http/")), [""; 0]);
    assert_eq!(uses(&["sqlx"], |file| !file.starts_with("store/")), [""; 0]);
    assert!(!uses(&["axum"], |file| file.starts_with("http/")).is_empty(), "what the check looks for");
}

#[test]
fn what_decides_has_neither_io_nor_a_clock() {
    let pure = |file: &str| {
        ["queue/", "sweep/", "document/", "mesh.rs", "validation.rs"].iter().any(|at| file.starts_with(at))
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

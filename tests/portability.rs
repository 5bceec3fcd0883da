//! Calls that only some systems have are behind a condition, and functions that need them have a twin for all other systems.
//!
//! Other systems have no tests yet, and their standard libraries are not at hand everywhere: this reads the sources. Unit tests may be
//! for Unix alone.

use std::path::{Path, PathBuf};

/// Conditions on the system.
const GUARDS: &[&str] = &["#[cfg(unix)]", "#[cfg(target_os = \"linux\")]"];

/// Parts of paths and calls that not every system has. Files below /proc need no condition: a read that fails has a fallback.
const UNIX_ONLY: &[&str] = &[
    "std::os::unix",
    "std::os::linux",
    "std::os::fd",
    "rustix::",
    "libc::",
    "tokio::signal::unix",
    "tokio::net::Unix",
    ".process_group(",
    "set_tcp_notsent_lowat",
];

const FOLDERS: &[&str] = &[
    "api",
    "bench",
    "design",
    "frames",
    "python",
    "reproduce",
    "server",
    "solver",
    "stats",
    "terminal",
    "worker",
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

/// Rust files below a folder, without those of unit tests.
fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_name().unwrap().to_str().unwrap();
        if ["tests", "tests.rs", "simulation", "testing"].contains(&name) || name.ends_with("_tests.rs") {
            continue;
        }
        if path.is_dir() {
            sources(&path, found);
        } else if name.ends_with(".rs") {
            found.push(path);
        }
    }
}

/// The indentation of a line.
fn indent(line: &str) -> usize {
    line.len() - line.trim_start().len()
}

/// Lines without a condition that not every system compiles. As the formatter leaves them, an item or statement ends at its own
/// indentation.
fn unguarded(text: &str) -> Vec<&str> {
    let code = text.split("#[cfg(test)]\nmod tests").next().unwrap_or_default();
    let (mut guarded_at, mut found) = (None, Vec::new());
    for line in code.lines() {
        let trimmed = line.trim();
        if GUARDS.contains(&trimmed) {
            guarded_at = Some(indent(line));
        } else if let Some(at) = guarded_at {
            let is_end = indent(line) == at && (trimmed.ends_with(';') || trimmed.starts_with('}'));
            guarded_at = guarded_at.filter(|_| !is_end);
        } else if !trimmed.starts_with("//") && UNIX_ONLY.iter().any(|part| line.contains(part)) {
            found.push(trimmed);
        }
    }
    found
}

/// Names of functions under a condition on the system that have no twin, or one without a sentence on the other systems.
fn without_twin(text: &str) -> Vec<String> {
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let name_at = |at: usize| {
        let words: Vec<&str> = lines.get(at + 1)?.split([' ', '(', '<']).collect();
        let place = words.iter().position(|word| *word == "fn")?;
        words.get(place + 1).map(|name| (*name).to_owned())
    };
    let of = |guard: &str, documented: bool| -> Vec<String> {
        let places = (0..lines.len()).filter(|at| lines[*at] == guard);
        let places = places.filter(|at| !documented || (*at > 0 && lines[at - 1].starts_with("///")));
        places.filter_map(name_at).collect()
    };
    let lacking = |guard: &&str| {
        let twins = of(&guard.replace("#[cfg(", "#[cfg(not(").replace(")]", "))]"), true);
        of(guard, false).into_iter().filter(move |name| !twins.contains(name)).collect::<Vec<_>>()
    };
    GUARDS.iter().flat_map(lacking).collect()
}

#[test]
fn calls_of_some_systems_have_conditions_and_twins() {
    let mut files = Vec::new();
    sources(&root().join("src"), &mut files);
    FOLDERS.iter().for_each(|folder| sources(&root().join(folder).join("src"), &mut files));
    assert!(files.len() > 300, "{} files", files.len());
    let (mut faults, mut guards) = (Vec::new(), 0);
    for file in &files {
        let text = std::fs::read_to_string(file).unwrap();
        guards += text.lines().filter(|line| GUARDS.contains(&line.trim())).count();
        let name = file.strip_prefix(root()).unwrap().display();
        faults.extend(unguarded(&text).iter().map(|line| format!("{name}: no condition: {line}")));
        faults.extend(without_twin(&text).iter().map(|function| format!("{name}: no twin: {function}")));
    }
    assert!(faults.is_empty(), "{faults:#?}");
    assert!(guards >= 8, "{guards} conditions: the check finds them");
}

#[test]
fn crates_of_one_system_are_dependencies_there_only() {
    for folder in [&["."], FOLDERS].concat() {
        let manifest = std::fs::read_to_string(root().join(folder).join("Cargo.toml")).unwrap();
        for section in manifest.split("\n[").filter(|section| section.starts_with("dependencies]")) {
            let wrong = section.lines().any(|line| line.starts_with("rustix"));
            assert!(!wrong, "{folder}: rustix belongs to [target.'cfg(unix)'.dependencies]");
        }
    }
}

#[test]
fn calls_without_conditions_and_functions_without_twins_are_found() {
    let text = "\
#[cfg(unix)]
use std::os::unix::fs::PermissionsExt;

/// Frees.
#[cfg(unix)]
fn free() -> u64 {
    rustix::fs::statvfs(\"/\");
}

/// On other systems nothing is measured.
#[cfg(not(unix))]
fn free() -> u64 {
    0
}

#[cfg(target_os = \"linux\")]
pub(crate) fn boot() {}

fn run() {
    #[cfg(unix)]
    command.process_group(0);
    rustix::process::umask(0);
}
// std::os::unix in words
#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
}
";
    assert_eq!(unguarded(text), ["rustix::process::umask(0);"]);
    assert_eq!(without_twin(text), ["boot"]);
    let undocumented = text.replace("/// On other systems nothing is measured.\n", "");
    assert_eq!(without_twin(&undocumented), ["free", "boot"]);
}

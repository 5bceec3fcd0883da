//! Calls, paths and programs that only some systems have are behind a condition, and functions that need them have a twin for all other
//! systems.
//!
//! Other systems have no tests yet, and their standard libraries are not at hand everywhere: this reads the sources. No compiler for
//! another system reads them, so a call that is missing from the lists below is not found. Unit tests may be for Unix alone.

use std::path::{Path, PathBuf};

/// Conditions on the system.
const GUARDS: &[&str] = &["#[cfg(unix)]", "#[cfg(target_os = \"linux\")]"];

/// Parts of calls that not every system has.
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

/// Beginnings of paths that only Unix has. A read that has a fallback on its line needs no condition.
const UNIX_PATHS: &[&str] = &["\"/dev/", "\"/proc/", "\"/tmp"];

/// Fallbacks of a read that fails.
const FALLBACKS: &[&str] = &[".ok()", ".unwrap_or_default()"];

/// Programs that only Unix has.
const UNIX_PROGRAMS: &[&str] =
    &["bash", "cat", "chmod", "env", "kill", "ln", "nice", "ps", "setpriv", "sh", "true"];

/// Files for one system, with the reason.
const EXCEPTIONS: &[(&str, &str)] = &[(
    "bench/src/farm/server.rs",
    "`roost bench farm` reads /proc and runs `kill`: other systems get an error",
)];

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

/// Whether a line needs a system that not everybody has.
fn is_of_one_system(line: &str) -> bool {
    let has = |parts: &[&str]| parts.iter().any(|part| line.contains(part));
    let runs = UNIX_PROGRAMS.iter().any(|program| line.contains(&format!("Command::new(\"{program}\")")));
    has(UNIX_ONLY) || runs || has(UNIX_PATHS) && !has(FALLBACKS)
}

/// Lines without a condition that not every system compiles or runs. As the formatter leaves them, an item or statement ends at its own
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
        } else if !trimmed.starts_with("//") && is_of_one_system(line) {
            found.push(trimmed);
        }
    }
    found
}

/// A function under a condition.
struct Conditional {
    name: String,
    is_documented: bool,
}

/// The functions under a condition. Other attributes and comments may be before and after the condition.
fn functions_under(guard: &str, text: &str) -> Vec<Conditional> {
    let (mut found, mut is_under, mut is_documented, mut in_attribute) = (Vec::new(), false, false, false);
    for line in text.lines().map(str::trim) {
        is_under |= line == guard;
        is_documented |= line.starts_with("///");
        if in_attribute || line.starts_with("#[") {
            in_attribute = !line.ends_with(']');
            continue;
        }
        if line.starts_with("//") {
            continue;
        }
        let words: Vec<&str> = line.split([' ', '(', '<']).collect();
        let place = words.iter().position(|word| *word == "fn").filter(|_| is_under);
        let name = place.and_then(|place| words.get(place + 1));
        found.extend(name.map(|name| Conditional { name: (*name).to_owned(), is_documented }));
        (is_under, is_documented) = (false, false);
    }
    found
}

/// Names of functions under a condition on the system that have no twin, or one without a sentence on the other systems.
fn without_twin(text: &str) -> Vec<String> {
    let lacking = |guard: &&str| {
        let others = guard.replace("#[cfg(", "#[cfg(not(").replace(")]", "))]");
        let twins = functions_under(&others, text).into_iter().filter(|twin| twin.is_documented);
        let twins: Vec<String> = twins.map(|twin| twin.name).collect();
        let names = functions_under(guard, text).into_iter().map(|function| function.name);
        names.filter(move |name| !twins.contains(name)).collect::<Vec<_>>()
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
        let name = file.strip_prefix(root()).unwrap().display().to_string();
        faults.extend(without_twin(&text).iter().map(|function| format!("{name}: no twin: {function}")));
        if let Some((_, reason)) = EXCEPTIONS.iter().find(|(exception, _)| *exception == name) {
            assert!(!unguarded(&text).is_empty(), "{name} needs no exception any more: {reason}");
            continue;
        }
        faults.extend(unguarded(&text).iter().map(|line| format!("{name}: no condition: {line}")));
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
#[allow(
    dead_code,
    reason = \"a test\"
)]
// An attribute may be between.
pub(crate) fn boot() {}

#[cfg(unix)]
#[must_use]
fn hidden() {
    Command::new(\"kill\");
}

fn run() {
    #[cfg(unix)]
    command.process_group(0);
    rustix::process::umask(0);
    let shell = Command::new(\"sh\");
    let folder = Path::new(\"/tmp/roost\");
    let null = File::open(\"/dev/null\")?;
    let own = read(\"/proc/self/stat\")?;
    let fallback = read(\"/proc/meminfo\").ok()?;
}
// std::os::unix in words
#[cfg(test)]
mod tests {
    use std::os::unix::fs::symlink;
}
";
    let wrong = [
        "rustix::process::umask(0);",
        "let shell = Command::new(\"sh\");",
        "let folder = Path::new(\"/tmp/roost\");",
        "let null = File::open(\"/dev/null\")?;",
        "let own = read(\"/proc/self/stat\")?;",
    ];
    assert_eq!(unguarded(text), wrong);
    assert_eq!(without_twin(text), ["hidden", "boot"]);
    let undocumented = text.replace("/// On other systems nothing is measured.\n", "");
    assert_eq!(without_twin(&undocumented), ["free", "hidden", "boot"]);
}

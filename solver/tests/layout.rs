//! The import rules of the solver, read from its sources.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

fn source() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("src")
}

/// All Rust files under a folder of `src`, with their text up to their unit tests.
fn files(folder: &str) -> Vec<(PathBuf, String)> {
    let mut found = Vec::new();
    let mut folders = vec![source().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(&folder).expect("a folder of the solver") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|ext| ext == "rs") && !path.ends_with("tests.rs") {
                let text = std::fs::read_to_string(&path).expect("a readable source");
                let code = text.split("#[cfg(test)]\nmod tests").next().expect("a first part").to_owned();
                found.push((path, code));
            }
        }
    }
    assert!(!found.is_empty(), "{folder} has no sources");
    found.sort();
    found
}

/// Code without comments.
fn code(text: &str) -> String {
    text.lines().map(|line| line.split("//").next().unwrap_or("")).collect::<Vec<_>>().join("\n")
}

/// The first segments of all paths that begin with `crate::`, and the external crates of `use` declarations.
fn imports(text: &str) -> BTreeSet<String> {
    let code = code(text);
    let name = |rest: &str| rest.chars().take_while(|c| c.is_alphanumeric() || *c == '_').collect::<String>();
    let own = code.split("crate::").skip(1).map(name);
    let external = code.lines().filter_map(|line| {
        let line = line.strip_prefix("pub ").unwrap_or(line);
        let first = name(line.strip_prefix("use ")?);
        (!["crate", "super", "self", "std"].contains(&first.as_str())).then_some(first)
    });
    own.chain(external).collect()
}

/// Imports of a folder that are not among those allowed, as `file: import`.
fn forbidden(folder: &str, allowed: impl Fn(&str) -> bool) -> Vec<String> {
    let of = |(path, text): &(PathBuf, String)| {
        let file = path.file_name().expect("a file").to_string_lossy().into_owned();
        imports(text).into_iter().map(move |import| format!("{file}: {import}")).collect::<Vec<_>>()
    };
    let is_forbidden = |line: &String| !allowed(line.rsplit(' ').next().expect("an import"));
    files(folder).iter().flat_map(of).filter(is_forbidden).collect()
}

#[test]
fn physics_imports_only_glam() {
    let local: BTreeSet<String> = files("physics")
        .iter()
        .map(|(path, _)| path.file_stem().expect("a stem").to_string_lossy().into_owned())
        .collect();
    assert_eq!(forbidden("physics", |import| import == "glam" || local.contains(import)), [""; 0]);
}

#[test]
fn the_engine_imports_no_backend_and_no_experiment() {
    let never = ["cpu", "gpu", "experiments"];
    assert_eq!(forbidden("engine", |import| !never.contains(&import)), [""; 0]);
}

#[test]
fn the_scenario_imports_no_experiment() {
    let never = ["experiments", "check", "engine", "observe", "cpu", "gpu"];
    assert_eq!(forbidden("scenario", |import| !never.contains(&import)), [""; 0]);
}

#[test]
fn observe_imports_only_results() {
    let own: BTreeSet<String> = files("observe")
        .iter()
        .map(|(path, _)| path.file_stem().expect("a stem").to_string_lossy().into_owned())
        .collect();
    let external = ["glam", "serde", "serde_json"];
    let allowed = |import: &str| import == "result" || external.contains(&import) || own.contains(import);
    assert_eq!(forbidden("observe", allowed), [""; 0]);
}

/// The imports of each module of the fast path, by path within `cpu/fast`; `mod` files stand for their folder.
fn fast_path_imports() -> BTreeMap<String, BTreeSet<String>> {
    let root = source().join("cpu/fast");
    let module = |path: &Path| {
        let path = path.strip_prefix(&root).expect("within the folder").with_extension("");
        path.to_string_lossy().replace('/', "::")
    };
    let files: Vec<(String, String)> =
        files("cpu/fast").iter().map(|(path, text)| (module(path), code(text))).collect();
    let known: BTreeSet<String> = files.iter().map(|(name, _)| name.clone()).collect();
    let mut graph = BTreeMap::new();
    for (name, text) in &files {
        let folder = name.rsplit_once("::").map_or("", |(folder, _)| folder);
        let mut imported = BTreeSet::new();
        for use_ in text.split("use ").skip(1).filter_map(|rest| rest.split(';').next()) {
            let path = use_.split_whitespace().collect::<String>();
            let path = match path.strip_prefix("crate::cpu::fast::") {
                Some(path) => path.to_owned(),
                None => match path.strip_prefix("super::") {
                    Some(path) if folder.is_empty() => path.to_owned(),
                    Some(path) => format!("{folder}::{path}"),
                    None => path,
                },
            };
            imported.extend(known.iter().filter(|other| **other != *name && names(&path, other)).cloned());
        }
        graph.insert(name.clone(), imported);
    }
    graph
}

/// Whether a `use` path, with its braces, names a module or something in it.
fn names(path: &str, module: &str) -> bool {
    let (folder, stem) = module.rsplit_once("::").map_or(("", module), |(folder, stem)| (folder, stem));
    let whole = |rest: &str| rest.is_empty() || rest.starts_with("::");
    if path.strip_prefix(module).is_some_and(whole) {
        return true;
    }
    let list = path.strip_prefix(folder).and_then(|rest| rest.trim_start_matches("::").strip_prefix('{'));
    list.is_some_and(|list| list.trim_end_matches('}').split(',').any(|entry| entry == stem))
}

/// Modules that import themselves, directly or by way of others.
fn circular(graph: &BTreeMap<String, BTreeSet<String>>) -> Vec<String> {
    let reaches_itself = |start: &String| {
        let mut seen = BTreeSet::new();
        let mut waiting: Vec<&String> = graph[start].iter().collect();
        while let Some(module) = waiting.pop() {
            if module == start {
                return true;
            }
            if seen.insert(module) {
                waiting.extend(graph.get(module).into_iter().flatten());
            }
        }
        false
    };
    graph.keys().filter(|module| reaches_itself(module)).cloned().collect()
}

#[test]
fn the_fast_path_has_no_import_cycles() {
    let graph = fast_path_imports();
    let edges: usize = graph.values().map(BTreeSet::len).sum();
    assert!(graph.len() > 30 && edges > 100, "{} modules, {edges} imports", graph.len());
    assert_eq!(circular(&graph), [""; 0]);
}

#[test]
fn the_folders_of_the_fast_path_import_in_one_direction() {
    let order = ["instructions", "storage", "broad_phase", "narrow_phase", "integration"];
    let rank = |module: &str| order.iter().position(|folder| module.split("::").next() == Some(folder));
    let mut against = Vec::new();
    for (module, imported) in fast_path_imports() {
        let Some(own) = rank(&module) else { continue };
        let later = imported.iter().filter(|other| rank(other).is_none_or(|rank| rank > own));
        against.extend(later.map(|other| format!("{module} imports {other}")));
    }
    assert_eq!(against, [""; 0]);
}

#[test]
fn import_cycles_and_forbidden_imports_are_detected() {
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let graph = [("a", set(&["b"])), ("b", set(&["c"])), ("c", set(&["b"])), ("d", set(&["a"]))];
    let graph = graph.map(|(name, imported)| (name.to_owned(), imported)).into();
    assert_eq!(circular(&graph), ["b", "c"]);
    let text = "use glam::Vec3;\nuse crate::engine::state; // crate::cpu\nlet x = crate::gpu::open();";
    assert_eq!(imports(text), set(&["engine", "glam", "gpu"]));
    assert!(names("storage::{body::Body,pairs}", "storage::pairs") && names("kernels", "kernels"));
    assert!(!names("storage::pairs_of", "storage::pairs"));
}

//! The import rules of the server, read from its sources: no cycle between modules, and the layers in one
//! direction.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

/// Modules and the modules that they import, by path such as `http::jobs`.
type Graph = BTreeMap<String, BTreeSet<String>>;

/// Rust files below a folder, except unit tests.
fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<_> = entries
        .filter(|path| !["tests", "tests.rs", "simulation"].iter().any(|name| path.ends_with(name)))
        .flat_map(|path| if path.is_dir() { files(&path) } else { vec![path] })
        .collect();
    found.sort();
    found
}

/// The module of a file; that of `http/mod.rs` is `http`.
fn module(root: &Path, file: &Path) -> String {
    let path = file.strip_prefix(root).unwrap().with_extension("");
    let path = if path.ends_with("mod") { path.parent().unwrap().to_owned() } else { path };
    path.to_str().unwrap().replace('/', "::")
}

/// Code without comments and unit tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests").next().unwrap();
    text.lines().map(|line| line.split("//").next().unwrap()).collect::<Vec<_>>().join("\n")
}

/// All paths of a `use` tree: `a::{b, c::d}` has `a::b` and `a::c::d`. The tree may be followed by other text.
fn paths(tree: &str) -> Vec<String> {
    let end = tree.find(|c: char| !(c.is_alphanumeric() || "_:@".contains(c))).unwrap_or(tree.len());
    let (prefix, rest) = tree.split_at(end);
    let Some(list) = rest.strip_prefix('{').filter(|_| prefix.is_empty() || prefix.ends_with("::")) else {
        return vec![prefix.trim_end_matches("::").to_owned()];
    };
    let mut depth = 0;
    let mut items = vec![String::new()];
    for c in list.chars() {
        depth += i32::from(c == '{') - i32::from(c == '}');
        match c {
            _ if depth < 0 => break,
            ',' if depth == 0 => items.push(String::new()),
            _ => items.last_mut().unwrap().push(c),
        }
    }
    let inner = items.iter().flat_map(|item| paths(item.trim()));
    inner.map(|path| format!("{prefix}{path}")).collect()
}

/// The paths that a module imports from its crate, from `use` declarations and elsewhere.
fn imports(module: &str, code: &str) -> Vec<String> {
    let mut found = Vec::new();
    for start in ["crate::", "super::"] {
        for (at, _) in code.match_indices(start) {
            if code[..at].ends_with(|c: char| c.is_alphanumeric() || c == ':') {
                continue;
            }
            let (mut rest, mut base) = (&code[at..], module);
            while let Some(after) = rest.strip_prefix("super::") {
                base = base.rsplit_once("::").map_or("", |(parent, _)| parent);
                rest = after;
            }
            let tree = rest.strip_prefix("crate::").unwrap_or(rest);
            let base =
                if start == "crate::" || base.is_empty() { String::new() } else { format!("{base}::") };
            found.extend(paths(tree).into_iter().map(|path| format!("{base}{path}")));
        }
    }
    found
}

/// The re-exports of a module: the path by which others import an item, and its own path.
fn reexports(module: &str, code: &str) -> Vec<(String, String)> {
    let declarations = ["pub use ", "pub(crate) use ", "pub(super) use "];
    let trees = code.lines().enumerate().filter_map(|(at, line)| {
        let start = declarations.iter().find_map(|declaration| line.strip_prefix(declaration))?;
        let rest = code.lines().skip(at + 1);
        let tree = std::iter::once(start).chain(rest).collect::<Vec<_>>().join(" ");
        Some(tree.split(';').next().unwrap().replace(" as ", "@"))
    });
    let reexport = |path: String| {
        let (path, name) = match path.split_once('@') {
            Some((path, name)) => (path, name),
            None => (path.as_str(), path.rsplit("::").next().unwrap()),
        };
        let own = match path.strip_prefix("crate::") {
            Some(path) => path.to_owned(),
            None => format!("{module}::{}", path.trim_start_matches("self::")),
        };
        (format!("{module}::{name}"), own)
    };
    trees.flat_map(|tree| paths(&tree)).map(reexport).collect()
}

/// Whether a path is `outer` or lies in it.
fn is_part(inner: &str, outer: &str) -> bool {
    inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// The graph of all modules of the server.
fn graph() -> Graph {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let sources: Vec<_> = files(&root)
        .iter()
        .map(|file| (module(&root, file), code(&std::fs::read_to_string(file).unwrap())))
        .filter(|(module, _)| module != "lib")
        .collect();
    graph_of(&sources)
}

/// The graph of modules with their code. A re-exported item is imported from its own file. A file does not
/// import the folder that it is part of.
fn graph_of(sources: &[(String, String)]) -> Graph {
    let known: BTreeSet<&String> = sources.iter().map(|(module, _)| module).collect();
    let reexported: Vec<_> = sources.iter().flat_map(|(module, code)| reexports(module, code)).collect();
    let imported = |(module, code): &(String, String)| {
        let of_path = |mut path: String| {
            // A re-export may lead to another.
            for _ in 0..3 {
                if let Some((outer, own)) = reexported.iter().find(|(outer, _)| is_part(&path, outer)) {
                    path = format!("{own}{}", &path[outer.len()..]);
                }
            }
            known.iter().rev().find(|known| is_part(&path, known)).map(|known| (**known).clone())
        };
        let imported = imports(module, code).into_iter().filter_map(of_path);
        (module.clone(), imported.filter(|other| !is_part(module, other)).collect())
    };
    sources.iter().map(imported).collect()
}

/// The same graph with one node per top-level module.
fn top_level(graph: &Graph) -> Graph {
    let top = |module: &str| module.split("::").next().unwrap().to_owned();
    let mut tops = Graph::new();
    for (module, imported) in graph {
        let others = imported.iter().map(|other| top(other)).filter(|other| *other != top(module));
        tops.entry(top(module)).or_default().extend(others);
    }
    tops
}

/// Modules that import themselves, directly or through others.
fn cyclic(graph: &Graph) -> Vec<&String> {
    let reaches_itself = |start: &&String| {
        let mut seen = BTreeSet::new();
        let mut waiting: Vec<&String> = graph[*start].iter().collect();
        while let Some(module) = waiting.pop() {
            if module == *start {
                return true;
            }
            if seen.insert(module) {
                waiting.extend(graph.get(module).into_iter().flatten());
            }
        }
        false
    };
    graph.keys().filter(reaches_itself).collect()
}

#[test]
fn top_level_modules_have_no_import_cycle() {
    let tops = top_level(&graph());
    let edges: usize = tops.values().map(BTreeSet::len).sum();
    assert!(tops.len() > 12 && edges > 30, "{} modules, {edges} imports", tops.len());
    assert_eq!(cyclic(&tops), [""; 0]);
}

#[test]
fn files_of_http_and_state_have_no_import_cycle() {
    let graph: Graph = graph()
        .into_iter()
        .filter(|(module, _)| module.starts_with("http::") || module.starts_with("state::"))
        .collect();
    let edges: usize = graph.values().map(BTreeSet::len).sum();
    assert!(graph.len() > 40 && edges > 150, "{} files, {edges} imports", graph.len());
    assert_eq!(cyclic(&graph), [""; 0]);
}

#[test]
fn lower_layers_do_not_import_higher_ones() {
    let tops = top_level(&graph());
    for lower in
        ["store", "queue", "sweep", "study", "document", "forecast", "measurements", "mesh", "validation"]
    {
        for higher in ["http", "state", "server", "reaper", "decider"] {
            assert!(!tops[lower].contains(higher), "{lower} imports {higher}");
        }
    }
    assert!(!tops["state"].contains("http"), "state imports http");
    assert!(tops["http"].contains("state") && tops["state"].contains("store"));
}

#[test]
fn use_trees_are_expanded_and_import_cycles_detected() {
    assert_eq!(paths("a::{b, c::{d, e}, f}; x"), ["a::b", "a::c::d", "a::c::e", "a::f"]);
    let code = "use crate::{http, queue::x};\nuse super::super::store::Store;\nlet y = super::rows::z();";
    assert_eq!(
        imports("http::listener::paced", code),
        ["http", "queue::x", "http::store::Store", "http::listener::rows::z"]
    );
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let sources = [
        ("a", "mod x;\nmod y;\npub(crate) use x::{\n    X,\n};\npub(crate) use y::Y as Other;"),
        ("a::x", "use crate::a::Other;"),
        ("a::y", "use super::X;"),
    ];
    let sources = sources.map(|(module, code)| (module.to_owned(), code.to_owned()));
    assert_eq!(cyclic(&graph_of(&sources)), ["a::x", "a::y"]);
    let graph = [("a", set(&["b"])), ("b", set(&["c"])), ("c", set(&["b"])), ("d", set(&["a"]))];
    let graph: Graph = graph.map(|(name, imported)| (name.to_owned(), imported)).into();
    assert_eq!(cyclic(&graph), ["b", "c"]);
}

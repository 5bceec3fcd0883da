//! The import rules of modules, read from the sources of all crates: no cycle, and the layers of the server in one direction.

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

/// The node of items that a crate declares in `lib.rs` or `main.rs`.
const ROOT: &str = "crate root";

/// The module of a file; that of `http/mod.rs` is `http`. The root has no name.
fn module(root: &Path, file: &Path) -> String {
    let path = file.strip_prefix(root).unwrap().with_extension("");
    if ["lib", "main"].iter().any(|name| path == Path::new(name)) {
        return String::new();
    }
    let path = if path.ends_with("mod") { path.parent().unwrap().to_owned() } else { path };
    path.to_str().unwrap().replace('/', "::")
}

/// Code without comments and unit tests.
fn code(text: &str) -> String {
    let text = text.split("#[cfg(test)]\nmod tests {").next().unwrap();
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
    let at = |path: &str| if module.is_empty() { path.to_owned() } else { format!("{module}::{path}") };
    let reexport = |path: String| {
        let (path, name) = match path.split_once('@') {
            Some((path, name)) => (path, name),
            None => (path.as_str(), path.rsplit("::").next().unwrap()),
        };
        let own = match path.strip_prefix("crate::") {
            Some(path) => path.to_owned(),
            None => at(path.trim_start_matches("self::")),
        };
        (at(name), own)
    };
    // An exported macro belongs to the root, wherever it is declared.
    let macros = code.split("#[macro_export]\nmacro_rules! ").skip(1).map(|rest| {
        let name = rest.split(' ').next().unwrap();
        (name.to_owned(), at(name))
    });
    trees.flat_map(|tree| paths(&tree)).map(reexport).chain(macros).collect()
}

/// Whether a path is `outer` or lies in it.
fn is_part(inner: &str, outer: &str) -> bool {
    inner.strip_prefix(outer).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"))
}

/// The folders of all crates, the root of the repository included.
fn crates() -> Vec<PathBuf> {
    let repository = Path::new(env!("CARGO_MANIFEST_DIR"));
    let entries = std::fs::read_dir(repository).unwrap().map(|entry| entry.unwrap().path());
    let mut found: Vec<_> = entries.chain([repository.to_owned()]).collect();
    found.retain(|folder| folder.join("src").is_dir() && folder.join("Cargo.toml").is_file());
    found.sort();
    found
}

/// The graph of all modules of a crate.
fn graph(crate_folder: &Path) -> Graph {
    let root = crate_folder.join("src");
    let sources: Vec<_> = files(&root)
        .iter()
        .filter(|file| file.extension().is_some_and(|extension| extension == "rs"))
        .map(|file| (module(&root, file), code(&std::fs::read_to_string(file).unwrap())))
        .collect();
    graph_of(&sources)
}

/// The graph of the modules of the server.
fn server() -> Graph {
    graph(&Path::new(env!("CARGO_MANIFEST_DIR")).join("server"))
}

/// The graph of modules with their code. A re-exported item is imported from its own file. A file does not
/// import the folder that it is part of. An import of an item of the root is one of [`ROOT`].
fn graph_of(sources: &[(String, String)]) -> Graph {
    let modules = || sources.iter().filter(|(module, _)| !module.is_empty());
    let known: BTreeSet<&String> = modules().map(|(module, _)| module).collect();
    let reexported: Vec<_> = sources.iter().flat_map(|(module, code)| reexports(module, code)).collect();
    let imported = |(module, code): &(String, String)| {
        let of_path = |mut path: String| {
            let mut is_own = true;
            // A re-export may lead to another.
            for _ in 0..3 {
                if let Some((outer, own)) = reexported.iter().find(|(outer, _)| is_part(&path, outer)) {
                    path = format!("{own}{}", &path[outer.len()..]);
                    is_own = false;
                }
            }
            let of_module = known.iter().rev().find(|known| is_part(&path, known));
            let is_root = is_own && !path.is_empty() && path != "self";
            of_module.map(|known| (**known).clone()).or_else(|| is_root.then(|| ROOT.to_owned()))
        };
        let imported = imports(module, code).into_iter().filter_map(of_path);
        (module.clone(), imported.filter(|other| !is_part(module, other)).collect())
    };
    modules().map(imported).collect()
}

/// The graph with one node for each file and folder of a folder; that of the whole crate is empty.
fn within(folder: &str, graph: &Graph) -> Graph {
    let node = |module: &str| {
        let inner = match folder {
            "" => module,
            _ => module.strip_prefix(folder)?.strip_prefix("::")?,
        };
        Some(inner.split("::").next().unwrap().to_owned())
    };
    let mut nodes = Graph::new();
    for (module, imported) in graph {
        let Some(own) = node(module) else { continue };
        let others = imported.iter().filter_map(|other| node(other)).filter(|other| *other != own);
        nodes.entry(own.clone()).or_default().extend(others);
    }
    nodes
}

/// The folders of a graph.
fn folders(graph: &Graph) -> BTreeSet<String> {
    let parents = |module: &String| {
        module.match_indices("::").map(|(at, _)| module[..at].to_owned()).collect::<Vec<_>>()
    };
    graph.keys().flat_map(parents).collect()
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
fn no_crate_has_an_import_cycle_between_its_modules() {
    let mut all = 0;
    for folder in crates() {
        let modules = within("", &graph(&folder));
        let edges: usize = modules.values().map(BTreeSet::len).sum();
        assert!(modules.len() > 1, "{}: {modules:?}", folder.display());
        assert_eq!(cyclic(&modules), [""; 0], "{}: {modules:?}", folder.display());
        let from_root: Vec<_> = modules.iter().filter(|(_, imported)| imported.contains(ROOT)).collect();
        assert!(from_root.is_empty(), "{}: {from_root:?}", folder.display());
        all += edges;
    }
    assert!(crates().len() > 10 && all > 300, "{all} imports");
}

#[test]
fn no_folder_has_an_import_cycle_with_a_neighbour() {
    let mut all = 0;
    for crate_folder in crates() {
        let graph = graph(&crate_folder);
        let folders = folders(&graph);
        for folder in &folders {
            let modules = within(folder, &graph);
            let in_cycles = cyclic(&modules).into_iter().map(|module| format!("{folder}::{module}"));
            let cycles: Vec<_> = in_cycles.filter(|module| folders.contains(module)).collect();
            assert!(cycles.is_empty(), "{}: {cycles:?}", crate_folder.display());
            all += modules.len();
        }
    }
    assert!(all > 300, "{all} files and folders");
}

#[test]
fn files_of_http_and_state_have_no_import_cycle() {
    let graph: Graph = server()
        .into_iter()
        .filter(|(module, _)| module.starts_with("http::") || module.starts_with("state::"))
        .collect();
    let edges: usize = graph.values().map(BTreeSet::len).sum();
    assert!(graph.len() > 40 && edges > 150, "{} files, {edges} imports", graph.len());
    assert_eq!(cyclic(&graph), [""; 0]);
}

#[test]
fn lower_layers_do_not_import_higher_ones() {
    let tops = within("", &server());
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
    // Imports may follow the declaration of tests in a file of their own.
    let declared = self::code("#[cfg(test)]\nmod tests;\nuse crate::a; // comment");
    assert_eq!(declared, "#[cfg(test)]\nmod tests;\nuse crate::a; ");
    let set = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<BTreeSet<_>>();
    let sources = [
        ("a", "mod x;\nmod y;\npub(crate) use x::{\n    X,\n};\npub(crate) use y::Y as Other;"),
        ("a::x", "use crate::a::Other;"),
        ("a::y", "use super::X;"),
    ];
    let sources = sources.map(|(module, code)| (module.to_owned(), code.to_owned()));
    assert_eq!(cyclic(&graph_of(&sources)), ["a::x", "a::y"]);
    let sources = [
        ("", "mod a;\nmod b;\npub use b::z::Z;\npub use other::O;\nfn item() {}"),
        ("a", "use crate::{O, Z};"),
        ("b", ""),
        ("b::y", "use crate::{a::A, item, message};"),
        ("b::z", "#[macro_export]\nmacro_rules! message {}"),
    ];
    let sources = sources.map(|(module, code)| (module.to_owned(), code.to_owned()));
    let graph = graph_of(&sources);
    assert_eq!(graph["a"], set(&["b::z"]));
    assert_eq!(graph["b::y"], set(&["a", "b::z", ROOT]));
    assert_eq!(cyclic(&graph), [""; 0]);
    assert_eq!(cyclic(&within("", &graph)), ["a", "b"]);
    assert_eq!((folders(&graph), within("b", &graph)["y"].clone()), (set(&["b"]), set(&["z"])));
    let graph = [("a", set(&["b"])), ("b", set(&["c"])), ("c", set(&["b"])), ("d", set(&["a"]))];
    let graph: Graph = graph.map(|(name, imported)| (name.to_owned(), imported)).into();
    assert_eq!(cyclic(&graph), ["b", "c"]);
}

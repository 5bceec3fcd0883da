//! Checks of the documents: paths and links exist, generated parts are current, and every folder is on the map.

#[path = "../solver/tests/common/generated.rs"]
mod generated;

use std::path::Path;
use std::process::Command;

use generated::assert_generated;

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(name: &str) -> String {
    std::fs::read_to_string(root().join(name)).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Words in backticks that have the form of a path.
fn paths(text: &str) -> Vec<&str> {
    let is_path = |word: &&str| word.ends_with('/') || word.ends_with(".rs") && word.contains('/');
    text.split('`').skip(1).step_by(2).filter(is_path).collect()
}

#[test]
fn paths_in_architecture_recipes_and_decisions_exist() {
    let records = documents().into_iter().filter(|name| name.starts_with("docs/decisions/"));
    let mut count = 0;
    for name in records.chain(["ARCHITECTURE.md", "docs/recipes.md"].map(str::to_owned)) {
        let text = read(&name);
        count += paths(&text).len();
        let missing: Vec<_> = paths(&text).into_iter().filter(|path| !root().join(path).exists()).collect();
        assert!(missing.is_empty(), "{name} names paths that do not exist: {missing:?}");
    }
    assert!(count > 50, "{count}");
}

#[test]
fn every_folder_is_on_the_map() {
    let text = read("ARCHITECTURE.md");
    let folders = |of: &str| {
        let entries = std::fs::read_dir(root().join(of)).expect("a folder");
        let names = entries.map(|entry| entry.expect("an entry")).filter(|entry| entry.path().is_dir());
        names.map(|entry| entry.file_name().into_string().expect("UTF-8")).collect::<Vec<_>>()
    };
    let is_source = |name: &String| {
        !name.starts_with('.') && !["target", "dist"].contains(&name.as_str()) && !name.ends_with("-out")
    };
    for name in folders(".").into_iter().filter(is_source) {
        assert!(text.contains(&format!("`{name}/`")), "{name}/ is not on the map");
    }
    for name in folders("solver/src") {
        assert!(text.contains(&format!("`solver/src/{name}/`")), "solver/src/{name}/ is not on the map");
    }
}

/// Paths of the documents: those at the root, and the pages of the book.
fn documents() -> Vec<String> {
    let mut found: Vec<String> =
        ["README.md", "ARCHITECTURE.md", "CHANGELOG.md", "api.md", "deploy/README.md"]
            .map(str::to_owned)
            .into();
    let mut folders = vec!["docs".to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(root().join(&folder)).expect("a folder") {
            let entry = entry.expect("an entry");
            let name = format!("{folder}/{}", entry.file_name().into_string().expect("UTF-8"));
            if entry.path().is_dir() {
                folders.push(name);
            } else if name.ends_with(".md") {
                found.push(name);
            }
        }
    }
    found
}

/// The anchor of a heading.
fn anchor(heading: &str) -> String {
    let is_kept = |c: &char| c.is_alphanumeric() || "-_ ".contains(*c);
    heading.trim().to_lowercase().chars().filter(is_kept).collect::<String>().replace(' ', "-")
}

/// Links of a document to files and headings.
fn links(text: &str) -> Vec<&str> {
    let links = text.split("](").skip(1).filter_map(|rest| rest.split(')').next());
    links.filter(|link| !link.contains("://")).collect()
}

#[test]
fn linked_documents_and_headings_exist() {
    let documents = documents();
    assert!(documents.len() > 30, "{documents:?}");
    for name in &documents {
        let text = read(name);
        let folder = Path::new(name).parent().expect("a folder");
        for link in links(&text) {
            let (file, heading) = link.split_once('#').unwrap_or((link, ""));
            let path = if file.is_empty() { root().join(name) } else { root().join(folder).join(file) };
            assert!(path.exists(), "{name} links to {link}, which does not exist");
            if !heading.is_empty() {
                let target = std::fs::read_to_string(&path).expect("a document");
                let mut headings = target.lines().filter(|line| line.starts_with('#'));
                let found = headings.any(|line| anchor(line.trim_start_matches('#')) == heading);
                assert!(found, "{name} links to {link}, but {} has no such heading", path.display());
            }
        }
    }
}

#[test]
fn every_page_is_in_the_book_and_links_within_it() {
    let summary = read("docs/SUMMARY.md");
    let parts = ["docs", "api.md", "ARCHITECTURE.md", "CHANGELOG.md", "deploy/README.md"];
    let has = |path: &Path| parts.iter().any(|part| path.starts_with(part));
    for name in documents().iter().filter(|name| *name != "README.md" && *name != "docs/SUMMARY.md") {
        let from_docs = name.strip_prefix("docs/").map_or(format!("../{name}"), str::to_owned);
        let is_record = name.starts_with("docs/decisions/");
        assert!(is_record || summary.contains(&format!("({from_docs})")), "{name} is not in docs/SUMMARY.md");
        let folder = Path::new(name).parent().expect("a folder");
        let text = read(name);
        for link in links(&text).into_iter().filter(|link| !link.starts_with('#')) {
            let file = link.split('#').next().expect("a first part");
            let mut path = std::path::PathBuf::new();
            for part in folder.join(file).components() {
                match part {
                    std::path::Component::ParentDir => assert!(path.pop(), "{name}: {link}"),
                    part => path.push(part),
                }
            }
            assert!(has(&path), "{name} links to {link}, which is not in the book");
        }
    }
}

#[test]
fn documents_named_in_the_code_exist() {
    let names = [
        "src",
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
        "tests",
        "deploy",
    ];
    let mut folders: Vec<_> = names.map(|name| root().join(name)).into();
    let mut named = 0;
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
                continue;
            }
            let Ok(text) = std::fs::read_to_string(&path) else { continue };
            for start in text.match_indices("docs/").map(|(at, _)| at) {
                let is_name = |c: char| c.is_ascii_alphanumeric() || "/-_.".contains(c);
                let name: String = text[start..].chars().take_while(|c| is_name(*c)).collect();
                let follows_a_path = text[..start].ends_with(is_name);
                if let Some(end) = name.find(".md").filter(|_| !follows_a_path) {
                    named += 1;
                    let name = &name[..end + 3];
                    assert!(
                        root().join(name).exists(),
                        "{} names {name}, which does not exist",
                        path.display()
                    );
                }
            }
        }
    }
    assert!(named > 5, "{named}");
}

#[test]
fn readme_commands_are_targets_of_the_makefile() {
    let (readme, makefile) = (read("README.md"), read("Makefile"));
    let targets: Vec<&str> = readme
        .lines()
        .filter_map(|line| line.strip_prefix("make "))
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(targets, ["demo", "test"]);
    for target in targets {
        assert!(makefile.lines().any(|line| line.starts_with(&format!("{target}:"))), "make {target}");
    }
}

#[test]
fn documents_of_the_first_runs_are_valid() {
    let page = read("docs/howto/first-runs.md");
    let documents: Vec<&str> =
        page.split("<<'JSON'\n").skip(1).filter_map(|rest| rest.split("\nJSON\n").next()).collect();
    assert_eq!(documents.len(), 2);
    for document in documents {
        let value: serde_json::Value = serde_json::from_str(document).expect("JSON");
        let scenario = value.get("base").unwrap_or(&value);
        let scenario = roost_solver::scenario::from_value(scenario).expect("a sound scenario");
        roost_solver::check(
            &scenario,
            &roost_solver::mesh::Meshes::default(),
            &roost_solver::Limits::default(),
        )
        .expect("a scenario that can run");
    }
}

#[test]
fn sweep_in_the_documentation_is_valid_and_all_designs_are_listed() {
    let text = read("docs/sweeps.md");
    let document =
        text.split("```json\n").nth(1).and_then(|rest| rest.split("\n```").next()).expect("a sweep");
    let document = serde_json::from_str(document).expect("JSON");
    let (meshes, limits) = (roost_solver::mesh::Meshes::default(), roost_solver::Limits::default());
    let report = roost_server::validate(document, &meshes, &limits, 1000).expect("a sound sweep");
    assert_eq!((report.document.as_str(), report.jobs), ("sweep", 128));

    let designs = text.split("## Designs").nth(1).and_then(|rest| rest.split("## ").next()).expect("designs");
    let rows: Vec<&str> =
        designs.lines().filter_map(|line| line.strip_prefix("| `")?.split('`').next()).skip(1).collect();
    let kinds: Vec<&str> = roost_api::design::DesignKind::ALL.iter().map(|kind| kind.as_str()).collect();
    assert_eq!(rows, kinds);
}

#[test]
fn api_example_has_the_solver_revision() {
    let revision = format!("\"solver_revision\": {},", roost_solver::SOLVER_REVISION);
    assert!(read("api.md").contains(&revision), "api.md shall hold {revision}");
}

#[test]
fn ci_runs_the_test_command_of_the_readme() {
    assert!(read(".ci/run").contains("make test 2>&1"));
    assert!(
        read(".ci/run").contains("CI=1 make check"),
        "CI runs the checks that compile but run no program"
    );
}

/// The help of a command and its subcommands as Markdown.
fn help(path: &[&str], page: &mut String) {
    let output = Command::new(env!("CARGO_BIN_EXE_roost")).args(path).arg("--help").env_clear().output();
    let text = String::from_utf8(output.expect("the command runs").stdout).expect("text");
    let title = ["roost"].iter().chain(path).copied().collect::<Vec<_>>().join(" ");
    let lines: Vec<&str> = text.lines().map(str::trim_end).collect();
    let shown = lines.join("\n");
    // Options of all commands are listed only in the first text.
    let shown = match (path, shown.split_once("\n      --log-format <FORMAT>\n")) {
        ([_, ..], Some((own, common))) => {
            let (_, after) = common.split_once("Print version").expect("the last common option");
            let own = own.trim_end();
            format!("{}{after}", own.strip_suffix("\nOptions:").unwrap_or(own).trim_end())
        }
        _ => shown,
    };
    *page += &format!("## {title}\n\n```text\n{}\n```\n\n", shown.trim_end());
    let listed =
        text.split("\nCommands:\n").nth(1).and_then(|rest| rest.split("\n\n").next()).unwrap_or_default();
    for name in
        listed.lines().filter_map(|line| line.split_whitespace().next()).filter(|name| *name != "help")
    {
        help(&[path, &[name]].concat(), page);
    }
}

#[test]
fn command_line_page_is_the_help_of_the_command() {
    let mut page = String::new();
    help(&[], &mut page);
    assert!(page.contains("## roost token create") && page.contains("## roost run"), "{page}");
    assert_generated(
        &root().join("docs/reference/command-line.md"),
        "the command's own help",
        page.trim_end(),
    );
}

#[test]
fn tests_named_in_the_verification_exist() {
    let mut sources = String::new();
    let mut folders = vec![root().join("solver/src"), root().join("solver/tests")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                sources += &std::fs::read_to_string(path).expect("a source");
            }
        }
    }
    let (text, planted) = (read("docs/verification.md"), read("docs/data/planted-errors.csv"));
    let words =
        text.split('`').skip(1).step_by(2).chain(planted.lines().filter_map(|line| line.rsplit(',').next()));
    let names: Vec<&str> =
        words.filter(|word| word.contains("::")).filter_map(|word| word.rsplit("::").next()).collect();
    assert!(names.len() > 150, "{names:?}");
    let missing: Vec<_> =
        names.into_iter().filter(|name| !sources.contains(&format!("fn {name}("))).collect();
    assert!(
        missing.is_empty(),
        "docs/verification.md or docs/data/planted-errors.csv names tests that do not exist: {missing:?}"
    );
}

#[test]
fn each_text_of_a_planted_error_occurs_once_in_its_file() {
    let list = read("docs/data/planted-errors.csv");
    let mut count = 0;
    for row in csv::Reader::from_reader(list.as_bytes()).records() {
        let row = row.expect("five columns");
        let [file, error, find, replace, _] = std::array::from_fn(|column| &row[column]);
        if !find.is_empty() {
            let found = read(&format!("solver/src/{file}")).matches(find).count();
            assert_eq!(found, 1, "planted-errors.csv: how often the text of \"{error}\" occurs in {file}");
            assert_ne!(find, replace, "planted-errors.csv: \"{error}\" changes nothing");
            count += 1;
        }
    }
    let page = read("docs/planted-errors.md");
    assert!(page.contains(&format!("For {count} of these errors")), "the list has {count} texts");
}

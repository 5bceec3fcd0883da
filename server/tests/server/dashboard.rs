//! Pages and files of the dashboard: all are served with a strict policy, and refer only to served files.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use reqwest::header::{CONTENT_ENCODING, CONTENT_SECURITY_POLICY, CONTENT_TYPE, ETAG, IF_NONE_MATCH};

use super::test_server::*;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("dashboard")
}

/// Files below `server/dashboard`, by their path there.
fn files() -> BTreeSet<String> {
    let mut folders = vec![folder()];
    let mut found = BTreeSet::new();
    while let Some(at) = folders.pop() {
        for entry in std::fs::read_dir(at).unwrap() {
            let path = entry.unwrap().path();
            if path.is_dir() {
                folders.push(path);
            } else {
                found.insert(path.strip_prefix(folder()).unwrap().to_str().unwrap().to_owned());
            }
        }
    }
    found
}

/// All texts between two marks.
fn texts_between<'a>(text: &'a str, open: &str, close: &str) -> Vec<&'a str> {
    text.split(open).skip(1).filter_map(|rest| rest.split(close).next()).collect()
}

async fn fetch(server: &TestServer, path: &str) -> reqwest::Response {
    server.http.get(format!("http://{}{path}", server.address)).send().await.unwrap()
}

#[tokio::test]
async fn every_page_has_a_policy_without_inline_or_evaluated_code() {
    let (server, _dir) = TestServer::start().await;
    let id = "01890000-0000-7000-8000-000000000000";
    let (sweep, study, job) = (format!("/sweeps/{id}"), format!("/studies/{id}"), format!("/jobs/{id}"));
    for path in ["/", &sweep, "/studies", &study, &job, "/workers", "/projects", "/compare?jobs=", "/submit"]
    {
        let page = fetch(&server, path).await;
        assert_eq!(page.status(), 200, "{path}");
        assert_eq!(page.headers()[CONTENT_TYPE], "text/html; charset=utf-8");
        let policy = page.headers()[CONTENT_SECURITY_POLICY].to_str().unwrap().to_owned();
        let rules: Vec<_> = policy.split("; ").collect();
        for rule in ["default-src 'none'", "script-src 'self'", "style-src 'self'", "frame-ancestors 'none'"]
        {
            assert!(rules.contains(&rule), "{rule}: {policy}");
        }
        assert!(!policy.contains("unsafe-inline") && !policy.contains("unsafe-eval"), "{policy}");
        let text = page.text().await.unwrap();
        assert!(text.starts_with("<!doctype html>") && text.contains(r#"lang="en""#));
        let scripts = texts_between(&text, "<script", "</script>");
        assert!(
            !scripts.is_empty() && scripts.iter().all(|script| script.ends_with('>')),
            "code in the page"
        );
        assert!(!text.contains("<style") && !text.contains(" style="), "style in the page");
    }
    server.stop().await;
}

#[tokio::test]
async fn every_file_is_served_and_refers_only_to_served_files() {
    let (server, _dir) = TestServer::start().await;
    let mut served = files();
    assert!(served.remove("page.html") && served.len() > 20);
    for name in &served {
        let answer = fetch(&server, &format!("/dashboard/{name}")).await;
        assert_eq!(answer.status(), 200, "{name} is not in the list of `http/dashboard.rs`");
        let tag = answer.headers()[ETAG].clone();
        let again = server.http.get(format!("http://{}/dashboard/{name}", server.address));
        assert_eq!(again.header(IF_NONE_MATCH, tag).send().await.unwrap().status(), 304, "{name}");
    }
    // Made at build time, and routes without a file.
    served.extend(["plotly.min.js", "session", "sign-in"].map(str::to_owned));
    let mut named = 0;
    for name in files() {
        let text = std::fs::read_to_string(folder().join(&name)).unwrap();
        let at = Path::new(&name).parent().unwrap();
        let imports = text
            .lines()
            .filter(|line| line.starts_with("import "))
            .flat_map(|line| texts_between(line, "\"", "\""));
        let imports = imports.filter(|path| path.starts_with('.')).map(|path| resolved(&at.join(path)));
        let links = texts_between(&text, "\"/dashboard/", "\"").into_iter().map(str::to_owned);
        for target in imports.chain(links).collect::<Vec<_>>() {
            assert!(served.contains(&target), "{name} names {target}, which is not served");
            named += 1;
        }
    }
    assert!(named > 40, "{named} names: the check has lost them");
    assert_eq!(server.get("/dashboard/nothing.js").await.status, 404);
    server.stop().await;
}

/// A path without `.` and `..`.
fn resolved(path: &Path) -> String {
    let mut parts = Vec::new();
    for part in path.iter().map(|part| part.to_str().unwrap()) {
        match part {
            "." => {}
            ".." => drop(parts.pop()),
            name => parts.push(name),
        }
    }
    parts.join("/")
}

#[tokio::test]
async fn plotly_is_compressed_and_no_file_names_other_servers() {
    let (server, _dir) = TestServer::start().await;
    let answer = fetch(&server, "/dashboard/plotly.min.js").await;
    assert_eq!(answer.headers()[CONTENT_ENCODING], "gzip");
    let packed = answer.bytes().await.unwrap();
    assert!(
        packed.starts_with(&[0x1f, 0x8b]) && (1_000_000..2_000_000).contains(&packed.len()),
        "{}",
        packed.len()
    );
    for name in files() {
        let text = std::fs::read_to_string(folder().join(&name)).unwrap();
        let outside: Vec<_> =
            text.match_indices("://").map(|(at, _)| &text[at.saturating_sub(6)..]).collect();
        let is_allowed = |text: &&str| text.contains("http://www.w3.org/2000/svg");
        assert!(outside.iter().all(is_allowed), "{name} names an address outside");
    }
    server.stop().await;
}

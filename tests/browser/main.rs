//! The dashboard in headless Chromium, with a real server and results of a real worker.
//!
//! Tests read the data of a plot from the page, never from an image, and compare it with the API.

#[path = "../support/mod.rs"]
mod support;

mod access;
mod chromium;
mod forms;
mod jobs;
mod many;
mod modules;
mod page;
mod playback;
mod plots;
mod projects;
mod sign_in;
mod studies;
mod submit;
mod visits;

use page::Page;
use support::Sandbox;

/// Opens pages in both themes: no faults of accessibility and no errors in the browser's log.
fn audit_pages(page: &mut Page, paths: &[&str]) {
    for path in paths {
        for theme in ["light", "dark"] {
            page.open(path);
            page.theme(theme);
            page.until(
                "something is shown",
                "document.querySelector('main table, main textarea, main .plot:not([hidden])')",
            );
            // Plots are drawn again in the colours of the theme.
            page.until(
                "plots are drawn",
                "document.querySelectorAll('.plot:not([hidden]):not(.js-plotly-plot)').length === 0",
            );
            let faults = page.audit();
            assert!(faults.is_empty(), "{path}, {theme}:\n{}", faults.join("\n"));
        }
    }
    let errors = page.errors();
    assert!(errors.is_empty(), "{}", errors.join("\n"));
}

#[test]
fn sweep_runs_from_the_form_to_its_plots() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    let sweep = submit::submit_by_form(&sandbox, &mut page);
    submit::note_progress(&mut page);
    let _worker = sandbox.start_worker("bench");
    submit::progress_shows_without_reload(&mut page);
    plots::match_the_api(&sandbox, &mut page, &sweep);
    plots::clicks_open_jobs(&sandbox, &mut page, &sweep);
    submit::extensions_show(&sandbox, &mut page, &sweep);
    submit::clone_fills_the_form(&sandbox, &mut page, &sweep);
    let job = playback::plays(&sandbox, &mut page, &sweep);
    let jobs = sandbox.get(&format!("/v1/sweeps/{sweep}/jobs?limit=2"));
    let pair = format!("/compare?jobs={},{}", text(&jobs["items"][0]["id"]), text(&jobs["items"][1]["id"]));
    let paths = [
        "/",
        &format!("/sweeps/{sweep}"),
        &format!("/jobs/{job}"),
        "/workers",
        "/projects",
        &pair,
        "/submit",
    ];
    audit_pages(&mut page, &paths);
}

#[test]
fn single_fillet_experiments_have_their_own_plots() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let _worker = sandbox.start_worker("bench");
    let mut page = Page::new(&sandbox.address);
    let sweeps = forms::run_sweeps(&sandbox);
    forms::match_the_api(&sandbox, &mut page, &sweeps);
    let paths: Vec<String> = sweeps.iter().map(|id| format!("/sweeps/{id}")).collect();
    audit_pages(&mut page, &paths.iter().map(String::as_str).collect::<Vec<_>>());
}

fn text(value: &serde_json::Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("{value} is not a string"))
}

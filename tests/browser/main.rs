//! The dashboard in a browser, as people have it: the real server, results of a real worker, Chromium without a screen.
//!
//! What a plot shows is read from the page's own data, never from a picture, and held against what the API says.

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
mod submit;
mod visits;

use page::Page;
use support::Home;

/// Pages in both themes: nothing without a name, out of order or hard to read, and nothing that the browser refused or failed at.
fn look_at(page: &mut Page, paths: &[&str]) {
    for path in paths {
        for theme in ["light", "dark"] {
            page.open(path);
            page.theme(theme);
            page.until("something is shown", "document.querySelector('main table, main textarea')");
            // Plots draw themselves anew in the theme's colours.
            page.until(
                "plots are drawn",
                "document.querySelectorAll('.plot:not([hidden]):not(.js-plotly-plot)').length === 0",
            );
            let faults = page.audit();
            assert!(faults.is_empty(), "{path}, {theme}:\n{}", faults.join("\n"));
        }
    }
    let complaints = page.complaints();
    assert!(complaints.is_empty(), "{}", complaints.join("\n"));
}

#[test]
fn a_sweep_from_its_form_to_its_plots() {
    let home = Home::new();
    let _server = home.serve();
    let mut page = Page::new(&home.address);
    let sweep = submit::by_the_form(&home, &mut page);
    let _worker = home.work("bench");
    submit::gets_on_before_ones_eyes(&mut page);
    plots::hold_what_the_api_says(&home, &mut page, &sweep);
    plots::lead_to_jobs(&home, &mut page, &sweep);
    submit::grows(&home, &mut page, &sweep);
    submit::is_cloned(&home, &mut page, &sweep);
    let job = playback::plays(&home, &mut page, &sweep);
    let jobs = home.get(&format!("/v1/sweeps/{sweep}/jobs?limit=2"));
    let pair = format!("/compare?jobs={},{}", text(&jobs["items"][0]["id"]), text(&jobs["items"][1]["id"]));
    let paths = ["/", &format!("/sweeps/{sweep}"), &format!("/jobs/{job}"), "/workers", &pair, "/submit"];
    look_at(&mut page, &paths);
}

#[test]
fn tests_of_single_fillets_have_plots_of_their_own() {
    let home = Home::new();
    let _server = home.serve();
    let _worker = home.work("bench");
    let mut page = Page::new(&home.address);
    let sweeps = forms::run(&home);
    forms::show_what_the_api_says(&home, &mut page, &sweeps);
    let paths: Vec<String> = sweeps.iter().map(|id| format!("/sweeps/{id}")).collect();
    look_at(&mut page, &paths.iter().map(String::as_str).collect::<Vec<_>>());
}

fn text(value: &serde_json::Value) -> &str {
    value.as_str().unwrap_or_else(|| panic!("{value} is no text"))
}

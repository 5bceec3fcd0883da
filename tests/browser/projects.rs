//! The page of projects: shares, budgets and waiting jobs.

use serde_json::json;

use super::page::Page;
use super::support::{Sandbox, hopper_scenario, stdout, wait_until};

#[test]
fn projects_show_their_shares_budgets_and_jobs() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let data = sandbox.path("data").display().to_string();
    stdout(&sandbox.roost(&[
        "project",
        "create",
        "steel",
        "--data",
        &data,
        "--share",
        "3",
        "--budget-core-hours",
        "500",
    ]));
    stdout(&sandbox.roost(&["project", "create", "spent", "--data", &data, "--budget-core-hours", "0"]));
    let token = |project: &str| {
        let arguments = ["token", "create", "--data", &data, "--scope", "submit", "--project", project];
        stdout(&sandbox.roost(&arguments)).trim().to_owned()
    };
    let token = token("spent");
    wait_until("the server asks for tokens", || sandbox.answers("/v1/sweeps", 401).then_some(()));
    let file = sandbox.file("scenario.json", &hopper_scenario(0.2));
    let token_file = sandbox.path("token");
    std::fs::write(&token_file, &token).unwrap();
    stdout(&sandbox.roost(&["submit", &file, "--token-file", &token_file.display().to_string()]));

    let mut page = Page::new(&sandbox.address);
    page.open("/projects");
    page.write("Token", &token);
    page.click_named("Sign in");
    page.until("projects are listed", "find.rows('Jobs and core-hours')?.length === 3");
    let rows: Vec<Vec<String>> = page.value("find.rows('Jobs and core-hours')");
    let expected = json!([
        ["spent", "1", "1", "0", "0", "0", "budget used up: its queued jobs wait"],
        ["steel", "3", "0", "0", "0", "0 % of 500", ""],
        ["default", "1", "0", "0", "0", "no limit", ""],
    ]);
    assert_eq!(json!(rows), expected);
    // The requests before the sign-in were refused.
    assert!(page.errors().iter().all(|line| line.contains("401")));
    super::audit_pages(&mut page, &["/projects"]);
}

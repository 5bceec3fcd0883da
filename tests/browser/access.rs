//! A server with tokens: the page asks for a token, hides it from scripts, and asks again after its revocation.

use serde_json::json;

use super::page::Page;
use super::support::{Sandbox, hopper_scenario, stdout, wait_until};
use super::text;

#[test]
fn the_page_asks_again_for_a_token_after_its_revocation() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let data = sandbox.path("data").display().to_string();
    // The page of a sweep has a dialog of its own.
    let sweep = json!({"name": "waits", "base": hopper_scenario(0.2), "design": {"kind": "grid"}});
    let sweep = sandbox.json_output(&["submit", &sandbox.file("sweep.json", &sweep)]);
    let token = |name: &str| {
        stdout(&sandbox.roost(&["token", "create", "--data", &data, "--scope", "submit", "--name", name]))
            .trim()
            .to_owned()
    };
    let (first, second) = (token("first"), token("second"));
    let mut page = Page::new(&sandbox.address);
    // The server reads its tokens once a second.
    wait_until("the server asks for tokens", || sandbox.answers("/v1/sweeps", 401).then_some(()));
    page.open("/");
    page.until(
        "the page asks",
        "document.querySelector('dialog[open] h2')?.textContent === 'This server needs a token'",
    );
    assert!(page.audit().is_empty(), "{:?}", page.audit());
    page.write("Token", "nonsense");
    page.click_named("Sign in");
    page.until("it is refused", "document.querySelector('#sign-in-errors').textContent");
    page.write("Token", &first);
    page.click_named("Sign in");
    page.until("sweeps are listed", "!document.querySelector('dialog') && find.rows('1 sweep,')");
    let seen: String =
        page.value("document.cookie + JSON.stringify(localStorage) + JSON.stringify(sessionStorage)");
    assert!(!seen.contains(&first), "scripts can read the token");
    page.open(&format!("/sweeps/{}", text(&sweep["id"])));
    page.until("the actions of the sweep", "find.control('Extend')");

    let id = stdout(&sandbox.roost(&["token", "list", "--data", &data]));
    let id = id.lines().find(|line| line.contains("first")).unwrap().split_whitespace().next().unwrap();
    stdout(&sandbox.roost(&["token", "revoke", "--data", &data, id]));
    // The page polls, so it asks without a reload.
    page.until(
        "it asks again",
        "document.querySelector('dialog[open] h2')?.textContent === 'The token is no longer valid'",
    );
    page.write("Token", &second);
    page.click_named("Sign in");
    page.until(
        "the sweep is there again",
        "!document.querySelector('dialog[open]') && find.control('Extend')",
    );
    let errors = page.errors();
    assert!(errors.iter().all(|line| line.contains("401")), "{errors:?}");
    page.click_named("Sign out");
    page.until("nothing is shown without", "document.querySelector('dialog[open]')");
}

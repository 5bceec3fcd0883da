//! A server with sign-in: a user signs in through the form of a real identity provider, submits, and signs out.

use serde_json::Value;

use super::page::Page;
use super::support::provider::{PASSWORD, Provider};
use super::support::{Sandbox, run, stdout, wait_until};

#[test]
fn a_user_signs_in_with_the_provider_submits_and_signs_out() {
    let sandbox = Sandbox::new();
    let provider = Provider::start(&sandbox.address);
    let data = sandbox.path("data").display().to_string();
    stdout(&run(&["project", "create", "wax", "--data", &data]));
    let mut options = provider.options(&sandbox.address, &sandbox.path("secret"));
    options.extend(["--oidc-allow", "scientists=wax:submit", "--log-format", "json"].map(str::to_owned));
    let server = sandbox.spawn_server(&options.iter().map(String::as_str).collect::<Vec<_>>());
    wait_until("the server answers", || sandbox.answers("/v1/sweeps", 401).then_some(()));

    let mut page = Page::new(&sandbox.address);
    page.open("/");
    let button = format!("Sign in with {}", provider.issuer.trim_start_matches("http://"));
    page.until("the page offers the provider", &format!("find.control('{button}')"));
    assert!(page.audit().is_empty(), "{:?}", page.audit());
    page.click_named(&button);
    page.until("the form of the provider", "document.querySelector('input[name=login]')");
    for (field, text, next) in
        [("login", "ada", "input[name=password]"), ("password", PASSWORD, "button[value=accept]")]
    {
        page.value::<()>(&format!(
            "(document.querySelector('input[name={field}]').value = '{text}',
              document.querySelector('input[name={field}]').form.requestSubmit(), null)"
        ));
        page.until(next, &format!("document.querySelector('{next}')"));
    }
    // A click at a position misses the button if fonts that arrive late move it.
    page.value::<()>("(document.querySelector('button[value=accept]').click(), null)");
    // The page after the callback leads to the dashboard by itself, with the cookie.
    page.until(
        "sweeps are listed",
        "location.pathname === '/' && !document.querySelector('dialog') && find.control('Sign out') && document.querySelector('main h1')",
    );
    page.until("the user is shown", "document.querySelector('header').innerText.includes('ada@lab.example')");
    assert!(page.audit().is_empty(), "{:?}", page.audit());
    let seen: String =
        page.value("document.cookie + JSON.stringify(localStorage) + JSON.stringify(sessionStorage)");
    assert!(!seen.contains("roost_"), "scripts can read a secret: {seen}");
    let mut errors = page.errors();
    // The provider has pages without all of their fonts.
    errors.retain(|line| !line.contains(&provider.issuer));
    assert!(errors.iter().all(|line| line.contains("401")), "{errors:?}");

    let submit = "fetch('/v1/jobs', {method: 'POST', headers: {'content-type': 'application/json', 'x-roost-page': 'dashboard'},
        body: JSON.stringify({scenario: {experiment: 'hopper', seed: 5}})}).then((answer) => answer.json())";
    let job: Value = page.value(submit);
    assert_eq!((&job["user"], &job["project"]), (&"ada@lab.example".into(), &"wax".into()), "{job}");

    page.click_named("Sign out");
    page.until("it asks again", "document.querySelector('dialog[open]')");
    let status: u16 = page.value("fetch('/v1/jobs').then((answer) => answer.status)");
    assert_eq!(status, 401, "the session is over");
    let log = server.log();
    for action in ["sign_in", "submit", "sign_out"] {
        let lines = log.lines().filter_map(|line| serde_json::from_str::<Value>(line).ok());
        let mut lines = lines.filter(|line| line["action"] == action);
        let fields = lines.next().unwrap_or_else(|| panic!("no line {action}: {log}")).clone();
        assert!(fields["user"] == "ada@lab.example" && fields["project"] == "wax", "{fields}");
    }
}

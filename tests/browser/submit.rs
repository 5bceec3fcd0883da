//! From the form to a sweep and its extension: faults show at their fields, progress shows without a reload.

use serde_json::{Value, json};

use super::page::Page;
use super::support::Sandbox;
use super::text;

pub(crate) const GATE: &str = "/equipment/gate_opening_m";
pub(crate) const BELT: &str = "/equipment/belt_speed_m_s";
pub(crate) const POINTS: u64 = 9;
const FRICTION: &str = "/contact/fillet_fillet/static_friction";

#[test]
fn invalid_sweeps_are_refused_and_not_saved_as_draft() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/submit");
    page.until("the form shows an estimate", "find.control('Submit 1 job')");
    page.click_named("As JSON");
    for (text, message) in [
        ("[1]", "not a sweep"),
        ("{", "not valid JSON"),
        (r#"{"base": {}, "design": {}, "factors": [7]}"#, "factors"),
    ] {
        page.write("The sweep as JSON", text);
        page.until("it is refused", &format!("find.control('Submit 1 job') === undefined && document.querySelector('.fault').textContent.includes('{message}')"));
    }
    page.open("/submit");
    page.until("the draft from before", "find.control('Submit 1 job')");
    assert_eq!(page.errors(), [""; 0]);
}

#[test]
fn fields_show_their_published_intervals() {
    let sandbox = Sandbox::new();
    let _server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/submit");
    page.until("the form shows an estimate", "find.control('Submit 1 job')");
    page.click_named("contact, fillet fillet");
    page.click("find.field('Static friction').closest('div').querySelector('summary')");
    let rows = "[...find.field('Static friction').closest('div').querySelectorAll('li')].map((row) => row.textContent)";
    let rows: Vec<String> = page.value(rows);
    let library = sandbox.get("/v1/parameters");
    let own = |entry: &&Value| entry["fields"].as_array().unwrap().contains(&json!(FRICTION));
    let own: Vec<&Value> = library["entries"].as_array().unwrap().iter().filter(own).collect();
    assert!(own.len() > 1 && own.len() == rows.len(), "{rows:?}");
    for (row, entry) in rows.iter().zip(own) {
        let numbers = match entry["status"].as_str() {
            Some("interval") => format!(": {} to {} (", entry["low"], entry["high"]),
            _ => format!(": no interval published ({} alone); test: slide (", entry["single_value"]),
        };
        assert!(row.starts_with(text(&entry["product"])) && row.contains(&numbers), "{row} is not {numbers}");
        assert!(row.ends_with(text(&entry["place"])), "{row}");
    }
    let links: Vec<String> = page.value("[...document.querySelectorAll('.published a')].map((a) => a.href)");
    assert!(links.len() > 20 && links.iter().all(|link| link.starts_with("http")), "{links:?}");
    // A field without an entry has no such list.
    assert!(page.value::<bool>("find.field('Count').closest('div').querySelector('.published') === null"));
    assert!(page.audit().is_empty() && page.errors().is_empty());
}

/// Fills in the form and submits it. Returns the id of the sweep, whose page is then open.
pub(crate) fn submit_by_form(sandbox: &Sandbox, page: &mut Page) -> String {
    page.open("/submit");
    page.until("the form shows an estimate", "find.control('Submit 1 job')");
    page.write("Gate opening", "0.05, 7");
    let fault = page.until("the fault shows at its field", "find.field('Gate opening').ariaInvalid && find.field('Gate opening').closest('label').querySelector('.wrong').textContent");
    assert!(text(&fault).contains('7'), "{fault}");
    assert!(
        page.value::<bool>("find.control('Submit 1 job') === undefined"),
        "a faulty sweep can be submitted"
    );
    page.click_named("numerics, stop");
    page.write("Name", "gate by belt");
    page.write("Replicates", "2");
    for (label, value) in [
        ("Gate opening", "0.045, 0.055, 0.065"),
        ("Belt speed", "0.15, 0.25, 0.35"),
        ("Hopper width", "0.15"),
        ("Side walls", "frictionless"),
        ("Count", "4"),
        ("Subparticle radius", "0.009"),
        ("Timestep", "0.0003"),
        ("Duration", "1.2"),
        ("When empty", "false"),
    ] {
        page.write(label, value);
    }
    page.write("Frames every", "0.05");
    page.until("the form shows an estimate", "find.control('Submit 18 jobs')");
    assert!(page.errors().iter().all(|line| line.contains("/v1/validate") && line.contains("422")));
    // Not by the mouse: the estimate of the last field may replace the button between press and release.
    page.value::<()>("(find.control('Submit 18 jobs').click(), null)");
    let path = page.until(
        "the page of the sweep",
        "/^.sweeps.[0-9a-f-]{36}$/.test(location.pathname) && location.pathname",
    );
    page.until("it has its heading", "document.querySelector('h1')?.textContent === 'gate by belt'");
    let id = text(&path).trim_start_matches("/sweeps/").to_owned();
    let view = sandbox.get(&format!("/v1/sweeps/{id}"));
    assert_eq!(view["factors"], json!([GATE, BELT]));
    assert_eq!((&view["points"], &view["replicates"]), (&json!(POINTS), &json!(2)));
    id
}

/// Lets the page of a sweep note each progress that it shows.
pub(crate) fn note_progress(page: &mut Page) {
    page.until("the bar", "document.querySelector('.bar.large')");
    page.value::<()>(
        "(window.steps = new Set(), new MutationObserver(() => window.steps.add(document.querySelector('.bar.large').ariaValueNow))
            .observe(document.querySelector('main'), { childList: true, subtree: true }), null)",
    );
}

/// Watches the page of a sweep until its end: progress shows in steps, without a reload.
pub(crate) fn progress_shows_without_reload(page: &mut Page) {
    page.until("the end", "document.querySelector('.bar.large').ariaValueNow === '100'");
    // A page that was loaded again would have none.
    let steps: Vec<String> = page.value("[...window.steps]");
    assert!(steps.len() > 1, "{steps:?}");
    page.until("the last state", "document.querySelector('main .state').textContent === 'succeeded'");
    // Plots update without a reload too.
    page.until(
        "every design point is drawn",
        &format!("find.rows('{POINTS} points')?.every((row) => row[3] === '2/2')"),
    );
}

/// Extends a sweep twice, on its page and by the command; the page shows both.
pub(crate) fn extensions_show(sandbox: &Sandbox, page: &mut Page, id: &str) {
    page.open(&format!("/sweeps/{id}"));
    page.until("its actions", "find.control('Extend')");
    page.click_named("Extend");
    page.write("More replicates of every point", "1");
    page.click_named("Extend");
    page.until("there are more jobs", "document.querySelector('.facts').textContent.includes('× 3')");
    page.until("they are done", "find.rows('9 points')?.every((row) => row[3] === '3/3')");
    assert_eq!(sandbox.get(&format!("/v1/sweeps/{id}"))["counts"]["succeeded"], 27);
    // The command adds another replicate.
    let grown = sandbox.roost(&["extend", id, "--replicates", "1"]);
    assert!(grown.status.success());
    page.until("the extension shows", "document.querySelector('.facts').textContent.includes('× 4')");
    page.until("all is done", "find.rows('9 points')?.every((row) => row[3] === '4/4')");
}

/// The form takes an existing sweep as its draft.
pub(crate) fn clone_fills_the_form(sandbox: &Sandbox, page: &mut Page, id: &str) {
    page.click_named("Clone");
    page.until("the form has the levels", "find.field('Gate opening')?.value === '0.045, 0.055, 0.065'");
    let draft: Value = page.value("JSON.parse(document.querySelector('textarea').value)");
    let spec = sandbox.get(&format!("/v1/sweeps/{id}/spec"));
    assert_eq!((&draft["base"], &draft["factors"]), (&spec["base"], &spec["factors"]));
    page.until("it can be submitted", "find.control('Submit 18 jobs') ?? find.control('Submit 36 jobs')");
}

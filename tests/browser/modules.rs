//! What modules of the dashboard work out, where it needs no page: asked in the browser that runs them.

use serde_json::{Value, json};

use super::page::Page;
use super::plots::numbers;
use super::support::Home;

/// A server and an open page that can import modules from it.
fn opened() -> (Home, super::support::Process, Page) {
    let home = Home::new();
    let server = home.serve();
    let mut page = Page::new(&home.address);
    page.open("/");
    (home, server, page)
}

#[test]
fn a_mean_is_taken_of_all_trials_or_not_at_all() {
    let (_home, _server, mut page) = opened();
    let group = json!({"name": "a", "replicates": [
        {"t_s": [0.0, 1.0, 2.0], "values": [0.0, 2.0, 4.0], "partial": false},
        {"t_s": [0.0, 1.0, 2.0, 3.0], "values": [0.0, 1.0, 2.0, 3.0], "partial": false},
        {"t_s": [0.0], "values": [100.0], "partial": true}]});
    let mut of = |name: &str| -> (Vec<f64>, Vec<f64>, Vec<String>) {
        let plot = format!(
            "import('/dashboard/plots/curves.js').then(({{ bandPlot }}) => bandPlot([{group}], '{name}', 'kg'))
                .then(({{ traces, table }}) => [traces[2].x, traces[2].y, [...table().tBodies[0].rows[0].cells].map((cell) => cell.textContent)])"
        );
        let [x, y, row]: [Value; 3] = page.value(&plot);
        (numbers(&x), numbers(&y), serde_json::from_value(row).unwrap())
    };
    // What is out stays out; a rate is over with its run.
    let (x, y, row) = of("discharged_mass");
    assert_eq!((x, y), (vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 1.5, 3.0, 3.5]));
    assert_eq!(row, ["a", "2", "3.5"], "each trial's last value, of those that have ended");
    let (x, y, row) = of("mass_rate");
    assert_eq!((x, y), (vec![0.0, 1.0, 2.0], vec![0.0, 1.5, 3.0]));
    assert_eq!(row, ["a", "2", "3.5"]);
}

#[test]
fn linked_fields_stay_linked() {
    let (_home, _server, mut page) = opened();
    let sweep = json!({"base": {}, "design": {"kind": "grid"}, "factors": [
        {"pointers": ["/bonds/a", "/bonds/b"], "levels": [1, 2]}, {"pointer": "/c", "levels": [3, 4]}]});
    let mut written = |pointer: &str, text: &str| -> Value {
        page.value(&format!(
            "import('/dashboard/document.js').then(({{ writeField }}) => writeField({sweep}, {{ pointer: '{pointer}', types: ['number'], words: [] }}, '{text}'))"
        ))
    };
    let other = json!({"pointer": "/c", "levels": [3, 4]});
    for field in ["/bonds/a", "/bonds/b"] {
        let linked = json!({"pointers": ["/bonds/a", "/bonds/b"], "levels": [1, 5]});
        assert_eq!(written(field, "1, 5")["factors"], json!([linked, other]));
        let ranged =
            json!({"pointers": ["/bonds/a", "/bonds/b"], "low": 1, "high": 9, "scale": "log", "count": 3});
        assert_eq!(written(field, "1 .. 9 log in 3")["factors"], json!([ranged, other]));
        let fixed = written(field, "7");
        assert_eq!(
            (&fixed["factors"], &fixed["base"]),
            (&json!([other]), &json!({"bonds": {"a": 7, "b": 7}}))
        );
    }
}

#[test]
fn what_fails_is_tried_again_and_made_once() {
    let (_home, _server, mut page) = opened();
    let tried = |error: &str, until: &str| {
        format!(
            "import('/dashboard/api.js').then(({{ once }}) => new Promise((done) => {{ let n = 0; const told = [];
                once(async () => {{ if (++n < 3) throw {error}; }}, (error) => (told.push(error?.message ?? null), ({until}) && done(told)), 0.01)('key'); }}))"
        )
    };
    let lost = "new Error('no answer')";
    assert_eq!(page.value::<Value>(&tried(lost, "!error")), json!(["no answer", "no answer", null]));
    let refused = "Object.assign(new Error('no such job'), { status: 404 })";
    let waited = "setTimeout(() => done(told), 200) && false";
    assert_eq!(page.value::<Value>(&tried(refused, waited)), json!(["no such job"]));

    // An answer that was lost, the same again, one more of the same, and something else.
    let keys: Vec<String> = page.value(
        "import('/dashboard/api.js').then(async ({ maker }) => { const keys = [], make = maker('/'), asked = window.fetch;
            window.fetch = async (path, { headers }) => { keys.push(headers['idempotency-key']);
                if (keys.length === 1 || keys.length === 4) throw new TypeError('lost'); return new Response('{}'); };
            for (const body of [1, 1, 1, 2, 3]) await make(body).catch(() => {});
            window.fetch = asked; return keys; })",
    );
    assert_eq!(keys[0], keys[1]);
    let different: std::collections::BTreeSet<&String> = keys.iter().collect();
    assert_eq!(different.len(), 4, "{keys:?}");
    assert!(keys.iter().all(|key| key.len() == 36 && key.as_bytes()[14] == b'4'), "{keys:?}");
}

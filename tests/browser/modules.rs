//! Functions of the dashboard's modules, called in the browser.

use serde_json::{Value, json};

use super::page::Page;
use super::plots::numbers;
use super::support::Sandbox;

/// A server and an open page that imports modules.
fn opened() -> (Sandbox, super::support::Process, Page) {
    let sandbox = Sandbox::new();
    let server = sandbox.start_server();
    let mut page = Page::new(&sandbox.address);
    page.open("/");
    (sandbox, server, page)
}

#[test]
fn a_mean_needs_a_value_of_every_trial() {
    let (_home, _server, mut page) = opened();
    let group = json!({"name": "a", "replicates": [
        {"t_s": [0.0, 1.0, 2.0], "values": [0.0, 2.0, 4.0], "partial": false},
        {"t_s": [0.0, 1.0, 2.0, 3.0], "values": [0.0, 1.0, 2.0, 3.0], "partial": false},
        {"t_s": [0.0], "values": [100.0], "partial": true}]});
    let mut band = |name: &str| -> (Vec<f64>, Vec<f64>, Vec<String>) {
        let plot = format!(
            "Promise.all([import('/dashboard/plots/curves.js'), import('/dashboard/outputs.js').then(({{ readOutputs }}) => readOutputs())])
                .then(([{{ bandPlot }}, {{ series }}]) => bandPlot([{group}], series.find((row) => row.name === '{name}'), 'kg'))
                .then(({{ traces, table }}) => [traces[2].x, traces[2].y, [...table().tBodies[0].rows[0].cells].map((cell) => cell.textContent)])"
        );
        let [x, y, row]: [Value; 3] = page.value(&plot);
        (numbers(&x), numbers(&y), serde_json::from_value(row).unwrap())
    };
    // Discharged mass stays constant after a run; a rate ends with it.
    let (x, y, row) = band("discharged_mass");
    assert_eq!((x, y), (vec![0.0, 1.0, 2.0, 3.0], vec![0.0, 1.5, 3.0, 3.5]));
    assert_eq!(row, ["a", "2", "3.5"], "each trial's last value, of those that have ended");
    let (x, y, row) = band("mass_rate");
    assert_eq!((x, y), (vec![0.0, 1.0, 2.0], vec![0.0, 1.5, 3.0]));
    assert_eq!(row, ["a", "2", "3.5"]);
}

#[test]
fn a_curve_over_bodies_has_dots() {
    let (_home, _server, mut page) = opened();
    let mut mode = |data: Value| -> String {
        let plot = format!(
            "Promise.all([import('/dashboard/plots/curves.js'), import('/dashboard/outputs.js')]).then(async ([{{ linePlot }}, {{ isPerBody, readOutputs }}]) =>
                linePlot([{{ name: 'a', data: {data} }}], isPerBody(await readOutputs(), {data})).traces[0].mode)"
        );
        serde_json::from_value(page.value(&plot)).unwrap()
    };
    let curve = |name: &str, over: &str| json!({"name": name, "unit": "1", "over": over, "over_unit": "1", "x": [0, 1], "values": [1, 2]});
    assert_eq!(mode(curve("settle_time", "fillet")), "markers");
    assert_eq!(mode(curve("stress", "strain")), "lines");
    let series = json!({"name": "mass_rate", "unit": "kg/s", "t_s": [0, 1], "values": [1, 2]});
    assert_eq!(mode(series), "lines");
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
fn temporary_failures_are_retried_with_the_same_idempotency_key() {
    let (_home, _server, mut page) = opened();
    let tried = |error: &str, until: &str| {
        format!(
            "import('/dashboard/api.js').then(({{ runLatest }}) => new Promise((done) => {{ let n = 0; const errors = [];
                runLatest(async () => {{ if (++n < 3) throw {error}; }}, (error) => (errors.push(error?.message ?? null), ({until}) && done(errors)), 0.01)('key'); }}))"
        )
    };
    let lost = "new Error('no answer')";
    assert_eq!(page.value::<Value>(&tried(lost, "!error")), json!(["no answer", "no answer", null]));
    let refused = "Object.assign(new Error('no such job'), { status: 404 })";
    let waited = "setTimeout(() => done(errors), 200) && false";
    assert_eq!(page.value::<Value>(&tried(refused, waited)), json!(["no such job"]));

    // A lost answer, its retry, the same body again, and two other bodies.
    let keys: Vec<String> = page.value(
        "import('/dashboard/api.js').then(async ({ idempotentPost }) => { const keys = [], make = idempotentPost('/'), asked = window.fetch;
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

#[test]
fn labels_and_fields_follow_the_tables_of_the_server() {
    let (_home, _server, mut page) = opened();
    let labels: Value = page.value(
        "Promise.all([import('/dashboard/format.js'), import('/dashboard/schema.js')]).then(async ([{ labelOf, factorLabel }, { readSchema }]) => {
            await readSchema();
            return [labelOf('bulk_density_kg_m3', 'kg/m³'), labelOf('discharged_kg_at_4s', 'kg'), labelOf('bend_angle_deg', '°'), labelOf('linearity_r2', ''), labelOf('strain', '1'),
                ...['/equipment/belt_speed_m_s', '/compress/strain_rate_1_s', '/equipment/surfaces/0/velocity_m_s', '/seed'].map((pointer) => factorLabel(pointer))]; })",
    );
    let expected = [
        "bulk density (kg/m³)",
        "discharged kg at 4s (kg)",
        "bend angle (°)",
        "linearity r2",
        "strain",
        "belt speed (m/s)",
        "strain rate (1/s)",
        "velocity (m/s)",
        "seed",
    ];
    assert_eq!(labels, json!(expected));
    let experiments: Value = page.value(
        "Promise.all([import('/dashboard/document.js'), import('/dashboard/schema.js')]).then(async ([{ fields, isFor }, { readSchema }]) => {
            const all = fields(await readSchema());
            return ['/drop/speed_m_s', '/equipment/belt_speed_m_s', '/seed'].map((pointer) => ['drop', 'hopper'].filter((name) => isFor(all.find((one) => one.pointer === pointer), name))); })",
    );
    assert_eq!(experiments, json!([["drop"], ["hopper"], ["drop", "hopper"]]));
}

#[test]
fn a_share_has_the_interval_of_the_server_even_without_a_trial() {
    let (_home, _server, mut page) = opened();
    let points = json!([
        {"responses": {"regime": {"n": 5, "words": {"no_flow": 5}, "shares": {"no_flow": {"low_95": 0.57, "high_95": 1.0}}, "unseen_high_95": 0.43}}},
        {"responses": {"regime": {"n": 1, "words": {"constant": 1}, "shares": {"constant": {"low_95": 0.21, "high_95": 1.0}}, "unseen_high_95": 0.79}}},
        {"responses": {"regime": {"n": 0}}}]);
    let intervals: Value = page.value(&format!(
        "import('/dashboard/measures.js').then(({{ measures }}) => {{ const points = {points}; return points.map(measures(points, {{ responses: [] }})[1].of); }})"
    ));
    assert_eq!(
        intervals,
        json!([
            {"n": 5, "count": 5, "mean": 1, "low": 0.57, "high": 1},
            {"n": 1, "count": 0, "mean": 0, "low": 0, "high": 0.79},
            null,
        ])
    );
    let jammed = json!({"responses": {"jammed": {"n": 12, "mean": 0.25, "low_95": 0.09, "high_95": 0.53}}});
    let measure: Value = page.value(&format!(
        "import('/dashboard/measures.js').then(({{ measures }}) => {{
            const points = [{jammed}], [jammed] = measures(points, {{ responses: [{{ name: 'jammed', type: 'indicator' }}] }});
            return [jammed.label, jammed.is_share, jammed.of(points[0])]; }})"
    ));
    let interval = json!({"n": 12, "count": 3, "mean": 0.25, "low": 0.09, "high": 0.53});
    assert_eq!(measure, json!(["share jammed", true, interval]));
}

#[test]
fn own_series_of_an_experiment_come_first() {
    let (_home, _server, mut page) = opened();
    let first: Vec<String> = page.value(
        "import('/dashboard/outputs.js').then(({ readOutputsOf, seriesRows }) =>
            Promise.all(['hopper', 'bend', 'slide'].map(async (name) => seriesRows(await readOutputsOf(name))[0].name)))",
    );
    assert_eq!(first, ["discharged_mass", "bend_angle", "sliding_speed"]);
}

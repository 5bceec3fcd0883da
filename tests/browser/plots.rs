//! Every plot of a sweep's page, compared with results, effects and series of the API.

use std::collections::BTreeMap;

use serde_json::Value;

use super::page::Page;
use super::submit::{BELT, GATE};
use super::support::Sandbox;
use super::text;

const RESPONSE: &str = "mean_rate_kg_s";

/// Compares all plots of the page with the API.
pub(crate) fn match_the_api(sandbox: &Sandbox, page: &mut Page, id: &str) {
    page.open(&format!("/sweeps/{id}?response={RESPONSE}&map=regime%3Dconstant&x={GATE}&y={BELT}"));
    page.until("the last plot is drawn", "find.plot('Curves')");
    let results = sandbox.get(&format!("/v1/sweeps/{id}/results?by=point"));
    let points = results["points"].as_array().unwrap();
    response(
        &drawn(page, "Response against factor"),
        points,
        &sandbox.get(&format!("/v1/sweeps/{id}/results"))["trials"],
    );
    map(&drawn(page, "Map over two factors"), points);
    let computed = sandbox.get(&format!("/v1/sweeps/{id}/effects"));
    effects(&drawn(page, "Main effects"), &computed);
    let sentence: String =
        page.value("find.card('Main effects').querySelector('p:not([hidden])').textContent");
    assert_eq!(sentence, text(&computed["pairing"]["sentence"]));
    surface(&drawn(page, "Response surface"), points);
    coordinates(page, points);
    for series in ["discharged_mass", "mass_rate"] {
        page.choose("Series", series);
        let title = series.replace('_', " ");
        page.until(
            "the series is drawn",
            &format!(
                "find.card('Curves').querySelector('.plot').layout.yaxis.title.text.startsWith('{title}')"
            ),
        );
        curves(&drawn(page, "Curves"), sandbox, id, series);
    }
}

/// A click on a trial opens its job; a click on a line of the parallel coordinates opens the jobs of its design point.
pub(crate) fn clicks_open_jobs(sandbox: &Sandbox, page: &mut Page, id: &str) {
    let path = format!("/sweeps/{id}?response={RESPONSE}&x={GATE}&y={BELT}");
    page.open(&path);
    page.until(
        "trials are drawn",
        "find.card('Response against factor').querySelector('.scatterlayer .point')",
    );
    wait_until_still(page, "find.card('Response against factor')");
    // The trial that is farthest from all other marks; marks of trials are small.
    let alone = "(() => { const card = find.card('Response against factor'); card.scrollIntoView({ block: 'center', behavior: 'instant' });
        const all = [...card.querySelectorAll('.scatterlayer .point')].map((one) => one.getBoundingClientRect()).map((box) => [box.x + box.width / 2, box.y + box.height / 2, box.width]);
        const distance = ([x, y]) => Math.min(...all.map((other) => Math.hypot(other[0] - x, other[1] - y)).filter((far) => far > 0));
        const [x, y] = all.filter(([, , width]) => width < 7).sort((a, b) => distance(b) - distance(a))[0]; return [x, y]; })()";
    let (x, y): (f64, f64) = page.value(alone);
    page.click_at(x, y);
    let there =
        page.until("a job's page", "location.pathname.startsWith('/jobs/') && location.pathname.slice(6)");
    let job = sandbox.get(&format!("/v1/jobs/{}", text(&there)));
    assert_eq!(job["sweep_id"], id);
    page.open(&path);
    page.until("lines are drawn", "document.querySelector('.coordinates path')");
    wait_until_still(page, "document.querySelector('.coordinates')");
    // A place on a line that no other line crosses.
    let free = "(() => { const figure = document.querySelector('.coordinates'); figure.scrollIntoView({ block: 'center', behavior: 'instant' });
        for (const line of figure.querySelectorAll('path')) for (let share = 0.05; share < 1; share += 0.05) {
            const at = line.getPointAtLength(share * line.getTotalLength()).matrixTransform(line.getScreenCTM());
            if (document.elementFromPoint(at.x, at.y) === line) return [at.x, at.y];
        } })()";
    let (x, y): (f64, f64) = page.value(free);
    page.click_at(x, y);
    let query =
        page.until("the comparison of its jobs", "location.pathname === '/compare' && location.search");
    let point = |id: &str| sandbox.get(&format!("/v1/jobs/{id}"))["point"].clone();
    let ids: Vec<&str> = text(&query).trim_start_matches("?jobs=").split(&[',', '%'][..]).collect();
    assert!(
        ids.len() > 1 && ids.iter().all(|id| point(id.trim_start_matches("2C")) == point(ids[0])),
        "{query}"
    );
}

/// Waits until all plots are drawn and an element has not moved for a second: later plots push it down.
fn wait_until_still(page: &mut Page, element: &str) {
    let still = format!(
        "(() => {{ const top = {element}.getBoundingClientRect().top + scrollY, now = performance.now();
            if (window.stood?.top !== top) window.stood = {{ top, since: now }};
            const undrawn = document.querySelectorAll('.plot:not([hidden]):not(.js-plotly-plot)').length;
            return undrawn === 0 && document.querySelector('.coordinates path') && now - window.stood.since > 1000; }})()"
    );
    page.until("nothing moves any more", &still);
}

fn drawn(page: &mut Page, title: &str) -> Vec<Value> {
    let what = format!("find.plot('{title}')");
    page.until(&format!("{title} is drawn"), &what);
    page.value(&what)
}

/// Numbers of an array; NaN for other values.
pub(crate) fn numbers(values: &Value) -> Vec<f64> {
    values
        .as_array()
        .unwrap_or_else(|| panic!("{values}"))
        .iter()
        .map(|value| value.as_f64().unwrap_or(f64::NAN))
        .collect()
}

/// Pairs of two arrays in ascending order.
fn pairs(x: &Value, y: &Value) -> Vec<(f64, f64)> {
    let mut pairs: Vec<_> = numbers(x).into_iter().zip(numbers(y)).collect();
    pairs.sort_by(|a, b| a.partial_cmp(b).unwrap());
    pairs
}

/// A mean with its bounds at a design point.
fn summary(point: &Value) -> (f64, f64, f64) {
    let of = |name: &str| point["responses"][RESPONSE][name].as_f64().unwrap();
    (of("mean"), of("low_95"), of("high_95"))
}

fn at(row: &Value, factor: &str) -> f64 {
    row["factors"][factor].as_f64().unwrap()
}

fn close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() <= 1e-9 * expected.abs().max(1e-9),
        "{what}: drawn {found}, the API says {expected}"
    );
}

fn response(traces: &[Value], points: &[Value], trials: &Value) {
    let trials = trials.as_array().unwrap();
    for belt in [0.15, 0.25, 0.35] {
        let name = format!("belt speed (m/s): {belt}");
        let at_belt =
            traces.iter().position(|trace| trace["name"] == *name).expect("a trace for each belt speed");
        let (dots, means) = (&traces[at_belt - 1], &traces[at_belt]);
        let rows: Vec<_> = points.iter().filter(|row| at(row, BELT) == belt).collect();
        assert_eq!((rows.len(), numbers(&means["x"]).len()), (3, 3));
        for (i, (x, mean)) in numbers(&means["x"]).into_iter().zip(numbers(&means["y"])).enumerate() {
            let row = rows.iter().find(|row| at(row, GATE) == x).unwrap();
            let (expected, low, high) = summary(row);
            close(mean, expected, "mean");
            close(numbers(&means["up"])[i], high - expected, "upper end of the interval");
            close(numbers(&means["down"])[i], expected - low, "lower end of the interval");
        }
        let of_belt: Vec<_> = trials.iter().filter(|trial| at(trial, BELT) == belt).collect();
        assert_eq!((of_belt.len(), numbers(&dots["y"]).len()), (6, 6));
        for (i, y) in numbers(&dots["y"]).into_iter().enumerate() {
            let id = text(&dots["customdata"][i]).trim_start_matches("/jobs/");
            let trial = of_belt.iter().find(|trial| trial["job_id"] == id).expect("a dot leads to its job");
            assert_eq!(y, trial["responses"][RESPONSE].as_f64().unwrap());
            assert_eq!(numbers(&dots["x"])[i], at(trial, GATE));
        }
    }
}

fn map(traces: &[Value], points: &[Value]) {
    let labels = |axis: &str| -> Vec<f64> {
        traces[0][axis].as_array().unwrap().iter().map(|label| text(label).parse().unwrap()).collect()
    };
    let (across, up) = (labels("x"), labels("y"));
    assert_eq!((across.len(), up.len()), (3, 3));
    for (j, belt) in up.iter().enumerate() {
        for (i, gate) in across.iter().enumerate() {
            let row = points.iter().find(|row| at(row, GATE) == *gate && at(row, BELT) == *belt).unwrap();
            let regime = &row["responses"]["regime"];
            let share = regime["words"]["constant"].as_f64().unwrap_or(0.0) / regime["n"].as_f64().unwrap();
            assert_eq!(traces[0]["z"][j][i].as_f64().unwrap(), share, "{gate} m, {belt} m/s");
        }
    }
}

fn effects(traces: &[Value], effects: &Value) {
    let of = effects["responses"].as_array().unwrap().iter().find(|one| one["response"] == RESPONSE).unwrap();
    let expected: BTreeMap<String, f64> = of["factors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (text(&one["factor"]).to_owned(), one["effect"].as_f64().unwrap()))
        .collect();
    let names = traces[0]["y"].as_array().unwrap();
    assert_eq!(names.len(), 2);
    for (name, size) in names.iter().zip(numbers(&traces[0]["x"])) {
        let pointer = if text(name).starts_with("gate") { GATE } else { BELT };
        assert_eq!(size, expected[pointer], "{name}");
    }
    // Bars reach to both ends of the interval.
    let sizes = numbers(&traces[0]["x"]);
    let bars = [("right", "high_95", 1.0), ("left", "low_95", -1.0)];
    for (name, (index, size)) in names.iter().zip(sizes.iter().enumerate()) {
        let pointer = if text(name).starts_with("gate") { GATE } else { BELT };
        let factor = of["factors"].as_array().unwrap().iter().find(|one| one["factor"] == pointer).unwrap();
        for (side, end, sign) in bars {
            let end = factor[end].as_f64().expect("several replicates");
            assert!((size + sign * numbers(&traces[0][side])[index] - end).abs() < 1e-9, "{name}: {side}");
        }
    }
}

/// The residuals of a least-squares fit are orthogonal to each of its terms.
fn surface(traces: &[Value], points: &[Value]) {
    let measured = pairs(&traces[1]["x"], &traces[1]["y"]);
    let mut expected: Vec<_> = points.iter().map(|row| (at(row, GATE), at(row, BELT))).collect();
    expected.sort_by(|a, b| a.partial_cmp(b).unwrap());
    assert_eq!(measured, expected);
    let (across, up) = (numbers(&traces[0]["x"]), numbers(&traces[0]["y"]));
    let nearest = |axis: &[f64], value: f64| {
        let (i, found) = axis
            .iter()
            .enumerate()
            .min_by(|a, b| (a.1 - value).abs().total_cmp(&(b.1 - value).abs()))
            .unwrap();
        close(*found, value, "a level on the surface's grid");
        i
    };
    let residuals: Vec<(f64, f64, f64)> = points
        .iter()
        .map(|row| {
            let (x, y) = (at(row, GATE), at(row, BELT));
            let fitted = traces[0]["z"][nearest(&up, y)][nearest(&across, x)].as_f64().unwrap();
            ((x - 0.055) / 0.01, (y - 0.25) / 0.1, summary(row).0 - fitted)
        })
        .collect();
    let size: f64 = residuals.iter().map(|(_, _, residual)| residual.abs()).sum();
    let terms: [fn(f64, f64) -> f64; 6] =
        [|_, _| 1.0, |x, _| x, |_, y| y, |x, _| x * x, |x, y| x * y, |_, y| y * y];
    for term in terms {
        let along: f64 = residuals.iter().map(|(x, y, residual)| residual * term(*x, *y)).sum();
        assert!(along.abs() < 1e-9 * size.max(1.0), "{along} of {size}");
    }
    assert!(size > 0.0, "a surface of six terms through nine measured points leaves residuals");
}

/// Lines cross the axes at the values of their design point; limits select lines.
fn coordinates(page: &mut Page, points: &[Value]) {
    let lines: Vec<String> = page
        .value("[...document.querySelectorAll('.coordinates path')].map((path) => path.getAttribute('d'))");
    let (top, bottom): (f64, f64) = page.value("(({ y1, y2 }) => [Number(y2.baseVal.value), Number(y1.baseVal.value)])(document.querySelector('.coordinates .axis'))");
    assert_eq!(lines.len(), points.len());
    let means: Vec<f64> = points.iter().map(|row| summary(row).0).collect();
    let (low, high) =
        means.iter().fold((f64::MAX, f64::MIN), |(low, high), mean| (low.min(*mean), high.max(*mean)));
    for (line, row) in lines.iter().zip(points) {
        let heights: Vec<f64> =
            line[1..].split('L').map(|at| at.split_once(',').unwrap().1.parse().unwrap()).collect();
        let shares = [
            (at(row, GATE) - 0.045) / 0.02,
            (at(row, BELT) - 0.15) / 0.2,
            (summary(row).0 - low) / (high - low),
        ];
        for (height, share) in heights.iter().zip(shares) {
            let expected = bottom - share * (bottom - top);
            assert!((height - expected).abs() < 0.06, "{line}: {height}, not {expected}");
        }
    }
    let count = "document.querySelectorAll('.coordinates path:not(.out)').length";
    // The lower half of the second axis.
    page.drag("document.querySelectorAll('.coordinates .hit')[1]", (0.5, 0.99), (0.5, 0.6));
    assert_eq!(page.value::<usize>(count), points.iter().filter(|row| at(row, BELT) < 0.2).count());
    page.click("document.querySelectorAll('.coordinates .hit')[1]");
    assert_eq!(page.value::<usize>(count), points.len());
    // The same limits entered as numbers.
    page.click("find.card('Parallel coordinates').querySelector('summary')");
    let middle = (low + high) / 2.0;
    page.write("mean rate (kg/s): from", &middle.to_string());
    assert_eq!(page.value::<usize>(count), means.iter().filter(|mean| **mean >= middle).count());
}

/// Bands of the trials of each design point: minimum, maximum and mean at every time.
fn curves(traces: &[Value], sandbox: &Sandbox, id: &str, series: &str) {
    let trials = sandbox.get(&format!("/v1/sweeps/{id}/results"));
    let mut groups: BTreeMap<u64, Vec<BTreeMap<u64, f64>>> = BTreeMap::new();
    for trial in trials["trials"].as_array().unwrap() {
        let data = sandbox.get(&format!("/v1/jobs/{}/series/{series}", text(&trial["job_id"])));
        let curve =
            numbers(&data["t_s"]).into_iter().map(f64::to_bits).zip(numbers(&data["values"])).collect();
        groups.entry(trial["point"].as_u64().unwrap()).or_default().push(curve);
    }
    assert_eq!((groups.len(), traces.len()), (9, 27));
    for (band, curves) in traces.chunks(3).zip(groups.values()) {
        let times = numbers(&band[2]["x"]);
        assert!(times.len() > 20);
        for (i, t) in times.into_iter().enumerate() {
            let values: Vec<f64> =
                curves.iter().filter_map(|curve| curve.get(&t.to_bits()).copied()).collect();
            assert_eq!(values.len(), curves.len(), "no sample at {t} s");
            close(numbers(&band[0]["y"])[i], values.iter().copied().fold(f64::MAX, f64::min), "lower edge");
            close(numbers(&band[1]["y"])[i], values.iter().copied().fold(f64::MIN, f64::max), "upper edge");
            close(numbers(&band[2]["y"])[i], values.iter().sum::<f64>() / values.len() as f64, "mean");
        }
    }
}

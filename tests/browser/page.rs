//! A page as a user operates it: elements are found by label or heading, clicked with the pointer, and read.

use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::chromium::Browser;

/// Timeout of `until`, long enough for a busy machine.
const TIMEOUT: Duration = Duration::from_secs(90);

/// Time that the pointer rests before a click.
const HOVER: Duration = Duration::from_millis(80);

/// Defines `find` and `audit` in every page.
const SCRIPT: &str = concat!(include_str!("find.js"), include_str!("audit.js"));

/// A page of the dashboard at this address.
pub(crate) struct Page {
    browser: Browser,
    address: String,
}

impl Page {
    /// Starts a browser with an empty page.
    pub(crate) fn new(address: &str) -> Self {
        Self { browser: Browser::start(1280, 900, SCRIPT), address: address.to_owned() }
    }

    /// Navigates to a path without waiting.
    pub(crate) fn go(&mut self, path: &str) {
        self.browser.call("Page.navigate", json!({"url": format!("{}{path}", self.address)}));
    }

    /// Opens a path, waits for its heading, and returns the time that took.
    pub(crate) fn open(&mut self, path: &str) -> Duration {
        let started = Instant::now();
        self.go(path);
        self.until(&format!("{path} has a heading"), "document.querySelector('main h1')?.textContent");
        started.elapsed()
    }

    /// Evaluates an expression on the page; panics when it throws.
    pub(crate) fn value<T: DeserializeOwned>(&mut self, expression: &str) -> T {
        let value = self.evaluate(expression).unwrap_or_else(|error| panic!("{expression}: {error}"));
        serde_json::from_value(value.clone())
            .unwrap_or_else(|error| panic!("{expression} is {value}: {error}"))
    }

    /// Evaluates an expression until it is truthy, and returns its value. It may throw meanwhile.
    pub(crate) fn until(&mut self, what: &str, expression: &str) -> Value {
        let started = Instant::now();
        // An element cannot be sent: true takes its place.
        let script = format!(
            "(async (value) => ((value = await value) instanceof Node ? true : value))({expression})"
        );
        loop {
            let last = self.evaluate(&script);
            if let Ok(value) = &last
                && ![json!(null), json!(false), json!(0), json!("")].contains(value)
            {
                return value.clone();
            }
            if started.elapsed() > TIMEOUT {
                let seen: String = self.value("document.body.innerText");
                panic!("timed out: {what}: {expression} is {last:?}\n{:?}\n{seen}", self.errors());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Clicks the middle of the element that an expression finds.
    pub(crate) fn click(&mut self, element: &str) {
        let (x, y) = self.middle(element);
        self.click_at(x, y);
    }

    /// Clicks a place of the window. The pointer rests there first, so that plots find the point under it.
    pub(crate) fn click_at(&mut self, x: f64, y: f64) {
        self.pointer("mouseMoved", false, x, y);
        std::thread::sleep(HOVER);
        for kind in ["mousePressed", "mouseReleased"] {
            self.pointer(kind, kind == "mousePressed", x, y);
        }
    }

    /// Presses a key.
    pub(crate) fn key(&mut self, key: &str) {
        for kind in ["keyDown", "keyUp"] {
            self.browser.call("Input.dispatchKeyEvent", json!({"type": kind, "key": key, "text": key}));
        }
    }

    /// Runs `act` and measures the time that it takes.
    pub(crate) fn timed<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> (T, Duration) {
        let started = Instant::now();
        (act(self), started.elapsed())
    }

    /// Clicks the button or link with this name.
    pub(crate) fn click_named(&mut self, name: &str) {
        self.click(&format!("find.control({})", json!(name)));
    }

    /// Drags between two places of an element, each as shares of its width and height.
    pub(crate) fn drag(&mut self, element: &str, from: (f64, f64), to: (f64, f64)) {
        let [x, y, width, height]: [f64; 4] = self.value(&format!("find.place({element})"));
        let at = |(across, down): (f64, f64)| (x + across * width, y + down * height);
        for (kind, (x, y)) in [("mousePressed", at(from)), ("mouseMoved", at(to)), ("mouseReleased", at(to))]
        {
            self.pointer(kind, kind != "mouseReleased", x, y);
        }
    }

    fn pointer(&mut self, kind: &str, is_held: bool, x: f64, y: f64) {
        let held = i32::from(is_held);
        let event = json!({"type": kind, "x": x, "y": y, "button": "left", "buttons": held, "clickCount": 1});
        self.browser.call("Input.dispatchMouseEvent", event);
    }

    /// Scrolls to an element and returns its middle, once no other element covers it.
    fn middle(&mut self, element: &str) -> (f64, f64) {
        self.until(&format!("{element} can be clicked"), &format!("find.isFree({element})"));
        let [x, y, width, height]: [f64; 4] = self.value(&format!("find.place({element})"));
        (x + width / 2.0, y + height / 2.0)
    }

    /// Replaces the text of the field with this label, and leaves the field.
    pub(crate) fn write(&mut self, label: &str, text: &str) {
        let found = format!("find.field({})", json!(label));
        self.until(&format!("there is a field {label}"), &format!("Boolean({found})"));
        self.value::<()>(&format!("({found}.focus(), {found}.select(), null)"));
        self.browser.call("Input.insertText", json!({"text": text}));
        self.value::<()>(&format!("({found}.blur(), null)"));
    }

    /// Chooses an option of the select element with this label, by script: its list opens outside the page.
    pub(crate) fn choose(&mut self, label: &str, value: &str) {
        let found = format!("find.field({})", json!(label));
        self.until(
            &format!("{label} offers {value}"),
            &format!("[...{found}.options].some((one) => one.value === {})", json!(value)),
        );
        self.value::<()>(&format!(
            "(({found}.value = {}), {found}.dispatchEvent(new Event('change')), null)",
            json!(value)
        ));
    }

    /// Checks names, roles and contrast: a line for each fault.
    pub(crate) fn audit(&mut self) -> Vec<String> {
        self.value("audit()")
    }

    /// Chooses a theme.
    pub(crate) fn theme(&mut self, theme: &str) {
        self.choose("Theme", theme);
        self.until("the theme is there", &format!("document.documentElement.dataset.theme === '{theme}'"));
    }

    /// Hides the page, as another tab does, or shows it again.
    pub(crate) fn set_hidden(&mut self, is_hidden: bool) {
        let event = if is_hidden { "pagehide" } else { "pageshow" };
        self.value::<()>(&format!(
            "(Object.defineProperty(document, 'hidden', {{ value: {is_hidden}, configurable: true }}),
              document.dispatchEvent(new Event('visibilitychange')), dispatchEvent(new Event('{event}')), null)"
        ));
    }

    /// Errors and warnings in the log since the last call, on any page: exceptions, refusals of the policy, failed requests.
    pub(crate) fn errors(&mut self) -> Vec<String> {
        let mut all: Vec<String> = Vec::new();
        for event in self.browser.events("Runtime.exceptionThrown") {
            all.push(event["exceptionDetails"].to_string());
        }
        for event in self.browser.events("Log.entryAdded") {
            let entry = &event["entry"];
            if entry["level"] == "error" || entry["level"] == "warning" {
                all.push(format!("{}: {} {}", entry["source"], entry["text"], entry["url"]));
            }
        }
        for event in self.browser.events("Runtime.consoleAPICalled") {
            if event["type"] == "error" || event["type"] == "warning" {
                all.push(event["args"].to_string());
            }
        }
        all
    }

    fn evaluate(&mut self, expression: &str) -> Result<Value, String> {
        let what = json!({"expression": expression, "awaitPromise": true, "returnByValue": true});
        let mut answer = self.browser.try_call("Runtime.evaluate", what)?;
        match answer.get("exceptionDetails") {
            Some(thrown) => Err(thrown["exception"]["description"].to_string()),
            None => Ok(answer["result"]["value"].take()),
        }
    }
}

//! What a person does to a page and sees of it: parts are found by their labels and headings, pressed with the pointer, and read back.

use std::time::{Duration, Instant};

use serde::de::DeserializeOwned;
use serde_json::{Value, json};

use super::chromium::Browser;

/// Nothing that a page is to show takes longer, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(90);

/// How long the pointer rests before it presses.
const HOVER: Duration = Duration::from_millis(80);

/// Finds parts of a page (`find`), and looks at it as a whole (`audit`).
const SCRIPT: &str = concat!(include_str!("find.js"), include_str!("audit.js"));

/// A page of the dashboard at this address.
pub(crate) struct Page {
    browser: Browser,
    address: String,
}

impl Page {
    /// A browser that has opened nothing yet.
    pub(crate) fn new(address: &str) -> Self {
        Self { browser: Browser::start(1280, 900, SCRIPT), address: address.to_owned() }
    }

    /// Goes to a path and waits for nothing.
    pub(crate) fn go(&mut self, path: &str) {
        self.browser.call("Page.navigate", json!({"url": format!("{}{path}", self.address)}));
    }

    /// Opens a path and waits until it has its heading; says how long that took.
    pub(crate) fn open(&mut self, path: &str) -> Duration {
        let started = Instant::now();
        self.go(path);
        self.until(&format!("{path} has a heading"), "document.querySelector('main h1')?.textContent");
        started.elapsed()
    }

    /// The value of an expression on the page; what it throws fails the test.
    pub(crate) fn value<T: DeserializeOwned>(&mut self, expression: &str) -> T {
        let value = self.evaluate(expression).unwrap_or_else(|error| panic!("{expression}: {error}"));
        serde_json::from_value(value.clone())
            .unwrap_or_else(|error| panic!("{expression} is {value}: {error}"))
    }

    /// Asks until an expression is true in JavaScript's sense, and returns its value. That it cannot be told yet is no failure.
    pub(crate) fn until(&mut self, what: &str, expression: &str) -> Value {
        let started = Instant::now();
        // An element is there or not; it cannot be sent.
        let asked = format!(
            "(async (value) => ((value = await value) instanceof Node ? true : value))({expression})"
        );
        loop {
            let last = self.evaluate(&asked);
            if let Ok(value) = &last
                && ![json!(null), json!(false), json!(0), json!("")].contains(value)
            {
                return value.clone();
            }
            if started.elapsed() > PATIENCE {
                let seen: String = self.value("document.body.innerText");
                panic!("waited in vain: {what}: {expression} is {last:?}\n{:?}\n{seen}", self.complaints());
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Presses the middle of what an expression finds, with the pointer.
    pub(crate) fn press(&mut self, element: &str) {
        let (x, y) = self.middle(element);
        self.press_at(x, y);
    }

    /// Presses a place of the window, where the pointer rests a moment first: plots look what is under it.
    pub(crate) fn press_at(&mut self, x: f64, y: f64) {
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

    /// Does something, and says how long it took.
    pub(crate) fn timed<T>(&mut self, act: impl FnOnce(&mut Self) -> T) -> (T, Duration) {
        let started = Instant::now();
        (act(self), started.elapsed())
    }

    /// Presses the button or link that is called so.
    pub(crate) fn press_named(&mut self, name: &str) {
        self.press(&format!("find.control({})", json!(name)));
    }

    /// Drags from one share of an element's box to another, each (across, down).
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

    /// The middle of an element, brought into view; it must not lie under another.
    fn middle(&mut self, element: &str) -> (f64, f64) {
        self.until(&format!("{element} can be pressed"), &format!("find.isFree({element})"));
        let [x, y, width, height]: [f64; 4] = self.value(&format!("find.place({element})"));
        (x + width / 2.0, y + height / 2.0)
    }

    /// Writes into the field of this label, in place of what is there, and leaves it.
    pub(crate) fn write(&mut self, label: &str, text: &str) {
        let found = format!("find.field({})", json!(label));
        self.until(&format!("there is a field {label}"), &format!("Boolean({found})"));
        self.value::<()>(&format!("({found}.focus(), {found}.select(), null)"));
        self.browser.call("Input.insertText", json!({"text": text}));
        self.value::<()>(&format!("({found}.blur(), null)"));
    }

    /// Chooses an option of the list of this label: such lists open outside the page, where no pointer of ours comes.
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

    /// Looks at labels, roles and contrast: a line for each fault.
    pub(crate) fn audit(&mut self) -> Vec<String> {
        self.value("audit()")
    }

    /// Goes to a theme, as its menu does.
    pub(crate) fn theme(&mut self, theme: &str) {
        self.choose("Theme", theme);
        self.until("the theme is there", &format!("document.documentElement.dataset.theme === '{theme}'"));
    }

    /// Leaves the page, as for another tab or another page, or comes back to it as it was.
    pub(crate) fn look_away(&mut self, is_away: bool) {
        let event = if is_away { "pagehide" } else { "pageshow" };
        self.value::<()>(&format!(
            "(Object.defineProperty(document, 'hidden', {{ value: {is_away}, configurable: true }}),
              document.dispatchEvent(new Event('visibilitychange')), dispatchEvent(new Event('{event}')), null)"
        ));
    }

    /// What was logged as wrong since this was last asked, on any page: faults of scripts, what the policy refused, requests that failed.
    pub(crate) fn complaints(&mut self) -> Vec<String> {
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

//! Headless Chromium, driven through the DevTools protocol over two pipes. It needs no driver and no port, and exits with its pipes.

use std::collections::VecDeque;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use tempfile::TempDir;

/// Timeout of one call.
const CALL_TIMEOUT: Duration = Duration::from_secs(60);

/// Chromium reads commands from file descriptor 3 and writes answers to 4.
const START: &str = r#"exec chromium "$@" 3<&0 4>&1 </dev/null >&2"#;

const FLAGS: &[&str] = &[
    "--headless=new",
    "--remote-debugging-pipe",
    // Chromium's sandbox does not work for root in containers.
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-extensions",
    "--hide-scrollbars",
    "--force-color-profile=srgb",
    // No host outside this machine resolves.
    "--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1, EXCLUDE 127.0.0.2",
    // WebGL on the CPU.
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
];

/// A browser with one page.
pub(crate) struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    session: Option<String>,
    calls: u64,
    /// Events that no caller has read yet.
    events: VecDeque<Value>,
    profile: TempDir,
}

impl Browser {
    /// Starts a browser with an empty page of this size, in pixels. `script` runs before the scripts of every page.
    pub(crate) fn start(width: u32, height: u32, script: &str) -> Self {
        let profile = tempfile::tempdir().unwrap();
        let log = File::create(profile.path().join("chromium.log")).unwrap();
        let mut child = Command::new("sh")
            .args(["-c", START, "sh"])
            .args(FLAGS)
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .stderr(log)
            .spawn()
            .unwrap();
        let (to, out) = (child.stdin.take().unwrap(), child.stdout.take().unwrap());
        let (sender, from) = channel();
        std::thread::spawn(move || {
            for message in BufReader::new(out).split(0).map_while(Result::ok) {
                let message = serde_json::from_slice(&message).expect("Chromium speaks JSON");
                if sender.send(message).is_err() {
                    return;
                }
            }
        });
        let mut browser = Self { child, to, from, session: None, calls: 0, events: VecDeque::new(), profile };
        let page = browser.call("Target.createTarget", json!({"url": "about:blank"}));
        let attached =
            browser.call("Target.attachToTarget", json!({"targetId": page["targetId"], "flatten": true}));
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser.call("Page.addScriptToEvaluateOnNewDocument", json!({"source": script}));
        browser.resize(width, height);
        browser
    }

    /// Resizes the page, in pixels.
    pub(crate) fn resize(&mut self, width: u32, height: u32) {
        let size = json!({"width": width, "height": height, "deviceScaleFactor": 1, "mobile": false});
        self.call("Emulation.setDeviceMetricsOverride", size);
    }

    /// Calls a method and waits for its answer; panics on an error.
    pub(crate) fn call(&mut self, method: &str, parameters: Value) -> Value {
        self.try_call(method, parameters).unwrap_or_else(|error| panic!("{method}: {error}"))
    }

    /// Calls a method and returns its error, such as that of a page that is being left.
    pub(crate) fn try_call(&mut self, method: &str, parameters: Value) -> Result<Value, String> {
        let number = self.send(method, parameters);
        let until = Instant::now() + CALL_TIMEOUT;
        loop {
            let mut message = self.next(until).ok_or_else(|| self.no_answer(method))?;
            if message["id"] == number {
                return match message.get("error") {
                    Some(error) => Err(error.to_string()),
                    None => Ok(message["result"].take()),
                };
            }
            self.receive(message);
        }
    }

    /// Parameters of the events of this method since the last call.
    pub(crate) fn events(&mut self, method: &str) -> Vec<Value> {
        // The answer arrives after all earlier events.
        self.call("Runtime.evaluate", json!({"expression": "0"}));
        let (found, rest): (VecDeque<Value>, _) =
            self.events.drain(..).partition(|event| event["method"] == method);
        self.events = rest;
        found.into_iter().map(|mut event| event["params"].take()).collect()
    }

    fn receive(&mut self, message: Value) {
        // A confirmation dialog blocks the page: accept it.
        if message["method"] == "Page.javascriptDialogOpening" {
            self.send("Page.handleJavaScriptDialog", json!({"accept": true}));
        }
        if message.get("method").is_some() {
            self.events.push_back(message);
        }
    }

    fn send(&mut self, method: &str, parameters: Value) -> u64 {
        self.calls += 1;
        let mut message = json!({"id": self.calls, "method": method, "params": parameters});
        if let Some(session) = &self.session {
            message["sessionId"] = json!(session);
        }
        let written = write!(self.to, "{message}\0").and_then(|()| self.to.flush());
        written.unwrap_or_else(|_| panic!("{}", self.no_answer(method)));
        self.calls
    }

    fn next(&mut self, until: Instant) -> Option<Value> {
        self.from.recv_timeout(until.saturating_duration_since(Instant::now())).ok()
    }

    fn no_answer(&self, method: &str) -> String {
        let log = std::fs::read_to_string(self.profile.path().join("chromium.log")).unwrap_or_default();
        format!("chromium, which `make test` installs, does not answer {method}; its log:\n{log}")
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        self.session = None;
        let _ = write!(self.to, "{}\0", json!({"id": 0, "method": "Browser.close"}))
            .and_then(|()| self.to.flush());
        let until = Instant::now() + Duration::from_secs(5);
        while Instant::now() < until && matches!(self.child.try_wait(), Ok(None)) {
            std::thread::sleep(Duration::from_millis(20));
        }
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

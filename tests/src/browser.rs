//! A headless browser: Debian's Chromium, controlled through its DevTools protocol.
//!
//! The protocol is JSON over a pipe (`--remote-debugging-pipe`), with a zero byte after each message. This needs less
//! code than a library with a WebSocket and a TLS stack.

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, ChildStdin, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// Longest wait for a reply, on a busy machine.
const REPLY_TIMEOUT: Duration = Duration::from_secs(120);

/// A browser with one page.
pub struct Browser {
    child: Child,
    to: ChildStdin,
    from: Receiver<Value>,
    next: u64,
    session: Option<String>,
    /// Everything on the page's console, exceptions, dialogs, and violations of the content security policy.
    pub problems: Vec<String>,
    /// Every address that the page requested.
    pub requests: Vec<String>,
    _profile: TempDir,
}

impl Browser {
    /// Starts the browser with a new profile.
    pub fn start() -> Self {
        let profile = TempDir::new().expect("a temporary folder");
        // The protocol uses descriptors 3 and 4.
        let mut child = Command::new("sh")
            .args(["-c", "exec \"$@\" 3<&0 4>&1 </dev/null >/dev/null 2>&1", "sh", "chromium", "--headless"])
            .args(["--no-sandbox", "--enable-unsafe-swiftshader", "--disable-quic", "--no-first-run", "--disable-sync"])
            .args(["--disable-background-networking", "--disable-component-update", "--remote-debugging-pipe"])
            // Pages show no animations unless a test allows them.
            .arg("--force-prefers-reduced-motion")
            .arg(format!("--user-data-dir={}", profile.path().display()))
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("a shell");
        let (sender, from) = channel();
        let mut answers = BufReader::new(child.stdout.take().expect("a pipe"));
        std::thread::spawn(move || {
            let mut message = Vec::new();
            while answers.read_until(0, &mut message).is_ok_and(|count| count > 0) {
                message.pop();
                let Ok(value) = serde_json::from_slice(&message) else { break };
                if sender.send(value).is_err() {
                    break;
                }
                message.clear();
            }
        });
        let to = child.stdin.take().expect("a pipe");
        let (problems, requests) = (Vec::new(), Vec::new());
        let mut browser = Self { child, to, from, next: 0, session: None, problems, requests, _profile: profile };
        let target = browser.call("Target.createTarget", json!({ "url": "about:blank" }));
        let attached =
            browser.call("Target.attachToTarget", json!({ "targetId": target["targetId"], "flatten": true }));
        browser.session = attached["sessionId"].as_str().map(str::to_owned);
        for domain in ["Page", "Runtime", "Log", "Network"] {
            browser.call(&format!("{domain}.enable"), json!({}));
        }
        browser
    }

    /// Calls a method of the protocol and returns its result.
    pub fn call(&mut self, method: &str, params: Value) -> Value {
        self.next += 1;
        let mut request = json!({ "id": self.next, "method": method, "params": params });
        if let Some(session) = &self.session {
            request["sessionId"] = json!(session);
        }
        let sent = self.to.write_all(format!("{request}\0").as_bytes());
        sent.expect("Chromium takes a message; `sh firmware/setup.sh test` installs it");
        loop {
            let message = self.receive(method);
            if message["id"] == self.next {
                assert!(message["error"].is_null(), "{method}: {}", message["error"]);
                return message["result"].clone();
            }
        }
    }

    /// Returns the next message; problems and requests are noted.
    fn receive(&mut self, what: &str) -> Value {
        let message = self.from.recv_timeout(REPLY_TIMEOUT);
        let message = message.unwrap_or_else(|error| {
            panic!("Chromium does not reply ({what}: {error}); `sh firmware/setup.sh test` installs it")
        });
        let params = &message["params"];
        match message["method"].as_str().unwrap_or_default() {
            "Runtime.exceptionThrown" => self.problems.push(params["exceptionDetails"].to_string()),
            "Runtime.consoleAPICalled" => self.problems.push(params["args"].to_string()),
            "Log.entryAdded" if !is_of_software_webgl(&params["entry"]) => {
                self.problems.push(params["entry"].to_string());
            }
            "Page.javascriptDialogOpening" => self.problems.push(format!("a dialog: {params}")),
            "Network.requestWillBeSent" => {
                self.requests.push(params["request"]["url"].as_str().unwrap_or_default().to_owned());
            }
            _ => {}
        }
        message
    }

    /// Opens a file from disk; returns how long it took to load, run and draw.
    pub fn open(&mut self, file: &Path) -> Duration {
        self.visit(&format!("file://{}", file.display()))
    }

    /// Opens an address; returns how long it took to load, run and draw.
    pub fn visit(&mut self, url: &str) -> Duration {
        self.load("Page.navigate", json!({ "url": url }))
    }

    /// Opens the same address once more.
    pub fn reload(&mut self) {
        self.load("Page.reload", json!({}));
    }

    /// Calls a method that loads a page, and waits until that page has run and been drawn.
    fn load(&mut self, method: &str, params: Value) -> Duration {
        let begun = Instant::now();
        self.call(method, params);
        while self.receive("load")["method"] != "Page.loadEventFired" {}
        // The second frame is drawn after the scripts have started.
        self.drawn();
        begun.elapsed()
    }

    /// Waits until the page has drawn itself.
    fn drawn(&mut self) {
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))).then(() => 0)");
    }

    /// Evaluates an expression in the page.
    pub fn evaluate(&mut self, expression: &str) -> Value {
        let params = json!({ "expression": expression, "returnByValue": true, "awaitPromise": true });
        let answer = self.call("Runtime.evaluate", params);
        assert!(answer["exceptionDetails"].is_null(), "{expression}: {answer}");
        answer["result"]["value"].clone()
    }

    /// Returns the text of the first element that matches a selector.
    pub fn text(&mut self, selector: &str) -> String {
        let value = self.evaluate(&format!("document.querySelector({}).textContent", json!(selector)));
        value.as_str().unwrap_or_default().to_owned()
    }

    /// Returns a number on the page; `None` for a dash.
    pub fn number(&mut self, selector: &str) -> Option<f64> {
        let text = self.text(selector).replace('−', "-");
        text.trim_end_matches(['°', 's', ' ']).parse().ok()
    }

    /// Scrolls to an element and returns its middle in the window.
    pub fn middle(&mut self, selector: &str) -> [f64; 2] {
        let place = self.evaluate(&format!(
            "(() => {{ const e = document.querySelector({}); e.scrollIntoView({{ block: 'center' }}); \
             const r = e.getBoundingClientRect(); return [r.x + r.width / 2, r.y + r.height / 2]; }})()",
            json!(selector)
        ));
        [0, 1].map(|i| place[i].as_f64().expect("an element with a place"))
    }

    /// Clicks an element.
    pub fn click(&mut self, selector: &str) {
        let place = self.middle(selector);
        self.drag(place, place);
    }

    /// Moves the mouse onto the middle of an element.
    pub fn hover(&mut self, selector: &str) {
        let [x, y] = self.middle(selector);
        self.call("Input.dispatchMouseEvent", json!({ "type": "mouseMoved", "x": x, "y": y }));
    }

    /// Presses the mouse button at a point, moves to another, and releases it.
    pub fn drag(&mut self, from: [f64; 2], to: [f64; 2]) {
        for (kind, [x, y], buttons) in
            [("mouseMoved", from, 0), ("mousePressed", from, 1), ("mouseMoved", to, 1), ("mouseReleased", to, 0)]
        {
            let button = if kind == "mouseMoved" && buttons == 0 { "none" } else { "left" };
            let event = json!({ "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", event);
        }
    }

    /// Presses a key, given by its name and its Windows virtual key code.
    pub fn key(&mut self, key: &str, code: u32) {
        let text = if key.len() == 1 { key } else { "" };
        for kind in ["keyDown", "keyUp"] {
            let mut event = json!({ "type": kind, "key": key, "windowsVirtualKeyCode": code });
            if kind == "keyDown" && !text.is_empty() {
                event["text"] = json!(text);
            }
            self.call("Input.dispatchKeyEvent", event);
        }
    }

    /// Returns what axe-core finds inaccessible on the page: each rule that is violated, and the elements.
    pub fn inaccessible(&mut self) -> Vec<String> {
        self.evaluate(include_str!("../data/axe/axe.min.js"));
        let found = self.evaluate(
            "axe.run().then(({ violations }) => violations.flatMap(({ id, nodes }) => \
             nodes.map(({ html, failureSummary }) => `${id}: ${html} ${failureSummary}`)))",
        );
        found.as_array().expect("a list").iter().map(|one| one.as_str().unwrap_or_default().to_owned()).collect()
    }

    /// Sets the size of the window, and waits until the page has it; a phone has a touch screen.
    pub fn window(&mut self, width: u32, height: u32, phone: bool) {
        let scale = if phone { 3 } else { 1 };
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": scale, "mobile": phone });
        self.call("Emulation.setDeviceMetricsOverride", size);
        self.call("Emulation.setTouchEmulationEnabled", json!({ "enabled": phone }));
        self.drawn();
    }

    /// Sets the preferred colour scheme.
    pub fn dark(&mut self, dark: bool) {
        let value = if dark { "dark" } else { "light" };
        let features = json!([{ "name": "prefers-color-scheme", "value": value }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Lets pages show animations.
    pub fn moving(&mut self) {
        let features = json!([{ "name": "prefers-reduced-motion", "value": "no-preference" }]);
        self.call("Emulation.setEmulatedMedia", json!({ "features": features }));
    }

    /// Saves a picture of the whole page.
    pub fn picture(&mut self, file: &Path) {
        self.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done))).then(() => 0)");
        let picture = self.call("Page.captureScreenshot", json!({ "captureBeyondViewport": true }));
        save(&picture, file);
    }

    /// Prints the page on A4 into a PDF file.
    pub fn print(&mut self, file: &Path) {
        let paper =
            json!({ "paperWidth": 8.27, "paperHeight": 11.69, "preferCSSPageSize": true, "printBackground": true });
        let pdf = self.call("Page.printToPDF", paper);
        save(&pdf, file);
    }
}

/// Returns whether an entry of the console comes from the driver that replaces a graphics card: for any page with WebGL, it
/// reports that each picture is copied.
fn is_of_software_webgl(entry: &Value) -> bool {
    let text = entry["text"].as_str().unwrap_or_default();
    entry["source"] == "rendering"
        && text.contains("GL Driver Message (OpenGL, Performance")
        && text.contains("ReadPixels")
}

fn save(answer: &Value, file: &Path) {
    let data = BASE64_STANDARD.decode(answer["data"].as_str().unwrap_or_default()).expect("base64");
    std::fs::create_dir_all(file.parent().expect("a folder")).expect("the pictures' folder");
    std::fs::write(file, data).expect("a picture");
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

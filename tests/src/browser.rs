//! Drives a headless Chromium through the DevTools protocol: opens pages, evaluates expressions in them,
//! takes pictures.

use std::io::{BufRead, BufReader};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use serde_json::{Value, json};
use tungstenite::{Message, WebSocket};

use crate::socket;

/// The names under which systems install the browser.
const NAMES: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
/// Flags that make it draw in software on every machine, and look for nothing on the network.
const FLAGS: [&str; 10] = [
    "--headless",
    "--no-sandbox",
    "--disable-gpu",
    "--enable-unsafe-swiftshader",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--remote-debugging-port=0",
];

/// A browser with one page. Dropping it ends the browser.
pub struct Browser {
    child: Child,
    socket: WebSocket<TcpStream>,
    session: String,
    calls: u64,
    _profile: tempfile::TempDir,
}

impl Browser {
    /// Starts this machine's browser with a window of this size, in CSS pixels. Returns `None` if there is no
    /// browser.
    pub fn start(width: u32, height: u32) -> Option<Self> {
        let profile = tempfile::tempdir().expect("a folder for the browser");
        let start = |name| {
            let mut command = Command::new(name);
            command.args(FLAGS).arg(format!("--user-data-dir={}", profile.path().display()));
            command.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped()).spawn().ok()
        };
        let mut child = NAMES.into_iter().find_map(start)?;
        let mut said =
            BufReader::new(child.stderr.take().expect("it is piped")).lines().map_while(Result::ok);
        let address = said
            .by_ref()
            .find_map(|line| Some(line.split_once("DevTools listening on ws://")?.1.to_owned()))
            .expect("the browser says where it listens");
        // Reads the browser's other output, so that the browser never blocks on a full pipe.
        std::thread::spawn(move || said.for_each(drop));
        let (host, path) = address.split_once('/').expect("an address has a path");
        let socket = socket::open(host, &format!("/{path}"), host, None).expect("it is a WebSocket");
        let mut browser = Self { child, socket, session: String::new(), calls: 0, _profile: profile };
        let target = browser.call("Target.createTarget", &json!({ "url": "about:blank" }));
        let attach = json!({ "targetId": target["targetId"], "flatten": true });
        browser.session = text(&browser.call("Target.attachToTarget", &attach)["sessionId"]);
        browser.resize(width, height, 1.0);
        Some(browser)
    }

    /// Sets the size of the window in CSS pixels, and the number of device pixels per CSS pixel.
    pub fn resize(&mut self, width: u32, height: u32, scale: f64) {
        let size = json!({ "width": width, "height": height, "deviceScaleFactor": scale, "mobile": false });
        self.call("Emulation.setDeviceMetricsOverride", &size);
    }

    /// Opens a page with this preferred colour scheme, `light` or `dark`.
    pub fn open(&mut self, url: &str, scheme: &str) {
        let features = json!([{ "name": "prefers-color-scheme", "value": scheme }]);
        self.call("Emulation.setEmulatedMedia", &json!({ "features": features }));
        self.call("Page.navigate", &json!({ "url": url }));
    }

    /// Evaluates an expression in the page. If the result is a promise, waits for it.
    pub fn eval(&mut self, expression: &str) -> Value {
        let how = json!({ "expression": expression, "awaitPromise": true, "returnByValue": true });
        let result = self.call("Runtime.evaluate", &how);
        assert!(result["exceptionDetails"].is_null(), "{expression}: {result}");
        result["result"]["value"].clone()
    }

    /// Waits until a condition holds in the page, which checks it in each animation frame. Panics after 20
    /// seconds.
    pub fn until(&mut self, condition: &str) {
        let wait = format!(
            "new Promise((done) => {{ const end = Date.now() + 20000; const look = () => {{ let holds = false; \
             try {{ holds = {condition}; }} catch {{ }} \
             if (holds || Date.now() > end) done(Boolean(holds)); else requestAnimationFrame(look); }}; look(); }})"
        );
        if self.eval(&wait) != json!(true) {
            let state = self.eval(
                "JSON.stringify(window.dcd?.counters) + document.getElementById('status')?.textContent",
            );
            panic!("not within 20 s: {condition}; {state}");
        }
    }

    /// Presses a key as a person would.
    pub fn press(&mut self, key: &str) {
        for kind in ["rawKeyDown", "keyUp"] {
            self.call("Input.dispatchKeyEvent", &json!({ "type": kind, "key": key }));
        }
    }

    /// Clicks at a place of the page.
    pub fn click(&mut self, x: f64, y: f64) {
        for kind in ["mousePressed", "mouseReleased"] {
            let event = json!({ "type": kind, "x": x, "y": y, "button": "left", "clickCount": 1 });
            self.call("Input.dispatchMouseEvent", &event);
        }
    }

    /// Takes a picture of the page, as PNG.
    pub fn picture(&mut self) -> Vec<u8> {
        let picture = self.call("Page.captureScreenshot", &json!({ "format": "png" }));
        data_encoding::BASE64.decode(text(&picture["data"]).as_bytes()).expect("a picture in base 64")
    }

    /// Takes a picture and writes it to a file.
    pub fn keep_picture(&mut self, path: &Path) -> Vec<u8> {
        let picture = self.picture();
        std::fs::write(path, &picture).expect("the picture can be kept");
        picture
    }

    fn call(&mut self, method: &str, params: &Value) -> Value {
        self.calls += 1;
        let mut call = json!({ "id": self.calls, "method": method, "params": params });
        if !self.session.is_empty() {
            call["sessionId"] = json!(self.session);
        }
        self.socket.send(Message::text(call.to_string())).expect("the browser listens");
        loop {
            let Message::Text(answer) = self.socket.read().expect("the browser answers") else { continue };
            let answer: Value = serde_json::from_str(&answer).expect("it is JSON");
            if answer["id"] == json!(self.calls) {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn text(value: &Value) -> String {
    value.as_str().expect("a text").to_owned()
}

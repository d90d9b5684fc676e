//! The page in a browser without a screen, driven by its developer tools: pictures arrive, keys and the mouse move the
//! camera, buttons do what they say.

use super::serve::Server;
use crate::common::{city, folder, has_program, skip, wait};
use serde_json::{Value, json};
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket};

/// Nothing here takes longer.
const MOST: Duration = Duration::from_secs(60);
/// What a browser may be called.
const NAMES: [&str; 3] = ["chromium", "chromium-browser", "google-chrome"];

/// A browser with one page.
struct Browser {
    child: Child,
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    number: u64,
}

impl Drop for Browser {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Browser {
    /// `None`, and the test is skipped, without a browser.
    fn start(folder: &Path) -> Option<Self> {
        let Some(program) = NAMES.into_iter().find(|name| has_program(name)) else {
            skip("chromium is not installed");
            return None;
        };
        let child = Command::new(program)
            .args(["--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"])
            .args(["--no-first-run", "--window-size=900,500", "--remote-debugging-port=0"])
            .arg(format!("--user-data-dir={}", folder.display()))
            .arg("about:blank")
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("the browser starts");
        let port = wait("the browser's port", || {
            let text = std::fs::read_to_string(folder.join("DevToolsActivePort")).ok()?;
            text.lines().next()?.parse::<u16>().ok()
        });
        let link = wait("a page", || {
            let all: Value = serde_json::from_str(&fetched(port, "/json/list")?).ok()?;
            let page = all.as_array()?.iter().find(|page| page["type"] == "page")?.clone();
            Some(format!("ws://127.0.0.1:{port}/devtools/page/{}", page["id"].as_str()?))
        });
        let (socket, _) = tungstenite::connect(link).expect("the page");
        Some(Self { child, socket, number: 0 })
    }

    /// Calls a method of the page, and gives its result.
    fn call(&mut self, method: &str, params: Value) -> Value {
        self.number += 1;
        let message = json!({"id": self.number, "method": method, "params": params});
        self.socket.send(Message::text(message.to_string())).expect("a message");
        loop {
            let Message::Text(text) = self.socket.read().expect("a message") else { continue };
            let answer: Value = serde_json::from_str(&text).expect("JSON");
            if answer["id"] == self.number {
                assert!(answer["error"].is_null(), "{method}: {answer}");
                return answer["result"].clone();
            }
        }
    }

    /// What an expression of the page comes to.
    fn value(&mut self, expression: &str) -> Value {
        self.call("Runtime.evaluate", json!({"expression": expression, "returnByValue": true}))["result"]["value"]
            .clone()
    }

    /// Waits until an expression is true.
    fn until(&mut self, expression: &str) {
        let start = Instant::now();
        while self.value(expression) != true {
            assert!(start.elapsed() < MOST, "{expression}: {}", self.value("JSON.stringify(window.brickwalk)"));
            std::thread::sleep(Duration::from_millis(30));
        }
    }

    fn key(&mut self, kind: &str, code: &str) {
        let key = code.trim_start_matches("Key").to_lowercase();
        self.call("Input.dispatchKeyEvent", json!({"type": kind, "code": code, "key": key}));
    }

    fn press(&mut self, code: &str) {
        self.key("keyDown", code);
        self.key("keyUp", code);
    }

    fn mouse(&mut self, kind: &str, x: f64, y: f64, button: &str, count: u32) {
        let buttons = u32::from(button == "left" && kind != "mouseReleased");
        let params = json!({
            "type": kind, "x": x, "y": y, "button": button, "buttons": buttons, "clickCount": count,
        });
        self.call("Input.dispatchMouseEvent", params);
    }

    /// The camera of the picture that is shown.
    fn position(&mut self) -> Value {
        self.value("JSON.stringify(brickwalk.head.position)")
    }

    /// A sum over the picture's pixels.
    fn pixels(&mut self) -> Value {
        self.value(
            "(() => { const c = document.querySelector('canvas'); \
             const d = c.getContext('2d').getImageData(0, 0, c.width, c.height).data; let h = 7; \
             for (const x of d) h = (h * 31 + x) % 1000003; return h; })()",
        )
    }
}

/// What an address of the browser answers.
fn fetched(port: u16, path: &str) -> Option<String> {
    let mut stream = TcpStream::connect(("127.0.0.1", port)).ok()?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n").ok()?;
    stream.set_read_timeout(Some(Duration::from_secs(2))).ok()?;
    let mut answer = Vec::new();
    // A browser that keeps the connection open has answered all the same.
    let _ = stream.read_to_end(&mut answer);
    let text = String::from_utf8_lossy(&answer).into_owned();
    text.split_once("\r\n\r\n").map(|(_, body)| body.to_owned())
}

const DONE: &str = "window.brickwalk?.head?.stage === 'done'";

#[test]
fn a_page_shows_what_is_served() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "500");
    let Some(mut browser) = Browser::start(&folder.path().join("profile")) else { return };
    let server = Server::start(&scene, "--spp 1 --cache 40% --viewers 2");
    // Without the token there is no page.
    browser.call("Page.navigate", json!({"url": format!("http://{}/?token=0", server.host)}));
    browser.until("document.body.innerText.includes('token')");
    browser.call("Page.navigate", json!({"url": server.link}));
    browser.until(DONE);
    let (home, first) = (browser.position(), browser.pixels());
    assert!(browser.value("brickwalk.head.kind") == "image/webp" && first.is_number());
    assert_eq!(browser.value("document.title.startsWith('brickwalk')"), true);
    // Nothing comes from elsewhere.
    assert_eq!(browser.value("performance.getEntriesByType('resource').length"), 0);
    // Keys.
    browser.key("keyDown", "KeyW");
    std::thread::sleep(Duration::from_millis(400));
    browser.key("keyUp", "KeyW");
    browser.until(&format!("{DONE} && JSON.stringify(brickwalk.head.position) !== {home}"));
    assert_ne!(browser.pixels(), first);
    browser.press("Home");
    browser.until(&format!("{DONE} && JSON.stringify(brickwalk.head.position) === {home}"));
    wait("the first picture again", || (browser.pixels() == first).then_some(()));
    // The mouse: look around, then a click, then a double click.
    browser.mouse("mousePressed", 600.0, 200.0, "left", 1);
    for step in 1..6 {
        browser.mouse("mouseMoved", 600.0 + 8.0 * f64::from(step), 200.0, "left", 0);
    }
    browser.mouse("mouseReleased", 640.0, 200.0, "left", 1);
    wait("another picture", || (browser.value(DONE) == true && browser.pixels() != first).then_some(()));
    browser.press("Home");
    wait("the first picture again", || (browser.value(DONE) == true && browser.pixels() == first).then_some(()));
    for count in [1, 2] {
        browser.mouse("mousePressed", 590.0, 150.0, "left", count);
        browser.mouse("mouseReleased", 590.0, 150.0, "left", count);
    }
    browser.until("brickwalk.state.found?.some(line => line.includes('triangle id')) === true");
    browser.until(&format!("{DONE} && JSON.stringify(brickwalk.head.position) !== {home}"));
    // Buttons and boxes.
    for name in ["state", "bricks", "none"] {
        let press =
            format!("[...document.querySelectorAll('#overlays button')].find(b => b.textContent === '{name}').click()");
        browser.value(&press);
        browser.until(&format!("brickwalk.state.overlay === '{name}'"));
    }
    browser.value("document.querySelector('[data-effect=ao]').click()");
    browser.until("!brickwalk.state.settings.effects.split(',').includes('ao')");
    browser.value("document.querySelector('[data-do=keyframe]').click()");
    browser.until("brickwalk.state.keyframes === 1");
    // What is compared is what is shown; the picture without occlusion comes first.
    let before = browser.value("brickwalk.pictures");
    browser.press("Home");
    browser.until(&format!(
        "{DONE} && brickwalk.pictures > {before} && JSON.stringify(brickwalk.head.position) === {home}"
    ));
    browser.value("document.querySelector('[data-do=compare]').click()");
    browser.until("brickwalk.state.comparison?.flip === 0");
    // A second one sees the same scene by itself.
    let Some(mut other) = Browser::start(&folder.path().join("other")) else { return };
    other.call("Page.navigate", json!({"url": server.link}));
    other.until(DONE);
    other.press("KeyF");
    other.until(&format!("{DONE} && JSON.stringify(brickwalk.head.position) !== {home}"));
    assert_eq!(browser.position(), home);
    // The server ends, and the page says so.
    drop(server);
    browser.until("brickwalk.closed && document.getElementById('status').textContent.includes('Reload')");
}

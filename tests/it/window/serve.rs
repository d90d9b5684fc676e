//! The server of pages, spoken to directly: tokens, limits, pictures, and what a page may not do.

use crate::common::{city, folder};
use serde_json::{Value, json};
use std::io::{BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tungstenite::client::IntoClientRequest;
use tungstenite::stream::MaybeTlsStream;
use tungstenite::{Message, WebSocket, connect};

/// Nothing here takes longer.
const MOST: Duration = Duration::from_secs(60);

/// A server, which ends with the test.
pub struct Server {
    child: Child,
    /// `127.0.0.1:PORT`.
    pub host: String,
    pub token: String,
    pub link: String,
}

impl Drop for Server {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

impl Server {
    pub fn start(scene: &Path, options: &str) -> Self {
        let mut child = Command::new(env!("CARGO_BIN_EXE_brickwalk"))
            .arg("serve")
            .arg(scene)
            .args(["--port", "0", "--adapter", "cpu"])
            .args(options.split_whitespace())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the command starts");
        let mut line = String::new();
        BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
        let link = line.trim().to_owned();
        let (host, token) = link.strip_prefix("http://").and_then(|rest| rest.split_once("/?token=")).expect("a link");
        Self { child, host: host.into(), token: token.into(), link: link.clone() }
    }

    /// The status of a request.
    fn status(&self, path: &str) -> u16 {
        let mut stream = self.connection();
        write!(stream, "GET {path} HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.host).expect("a request");
        let mut answer = String::new();
        let _ = stream.read_to_string(&mut answer);
        answer.split(' ').nth(1).and_then(|code| code.parse().ok()).unwrap_or_else(|| panic!("{answer}"))
    }

    fn connection(&self) -> TcpStream {
        let stream = TcpStream::connect(&self.host).expect("a connection");
        stream.set_read_timeout(Some(MOST)).expect("a timeout");
        stream
    }

    /// A session, or the status that it is refused with.
    fn session(&self, token: &str) -> Result<Guest, u16> {
        self.session_with(token, &[])
    }

    /// The same with more headers.
    fn session_with(&self, token: &str, headers: &[(&'static str, &str)]) -> Result<Guest, u16> {
        let mut request = format!("ws://{}/session?token={token}", self.host).into_client_request().expect("a request");
        for (name, value) in headers {
            request.headers_mut().insert(*name, value.parse().expect("a value"));
        }
        match connect(request) {
            Ok((socket, _)) => {
                if let MaybeTlsStream::Plain(stream) = socket.get_ref() {
                    stream.set_read_timeout(Some(MOST)).expect("a timeout");
                }
                Ok(Guest { socket, state: Value::Null })
            }
            Err(tungstenite::Error::Http(answer)) => Err(answer.status().as_u16()),
            Err(error) => panic!("{error}"),
        }
    }

    /// A session, once one is free.
    fn wait_for_session(&self) -> Guest {
        let start = Instant::now();
        loop {
            match self.session(&self.token) {
                Ok(guest) => return guest,
                Err(status) => assert!(status == 503 && start.elapsed() < MOST),
            }
            std::thread::sleep(Duration::from_millis(20));
        }
    }

    /// Threads and open files of the server, where the system tells.
    fn holds(&self) -> Option<[usize; 2]> {
        let count = |what: &str| Some(std::fs::read_dir(format!("/proc/{}/{what}", self.child.id())).ok()?.count());
        Some([count("task")?, count("fd")?])
    }
}

/// A page.
struct Guest {
    socket: WebSocket<MaybeTlsStream<TcpStream>>,
    state: Value,
}

impl Guest {
    fn tell(&mut self, message: Value) {
        self.socket.send(Message::text(message.to_string())).expect("a message");
    }

    /// The head and the bytes of the next picture.
    fn picture(&mut self) -> (Value, Vec<u8>) {
        loop {
            match self.socket.read().expect("a message") {
                Message::Text(text) => self.note(&text),
                Message::Binary(bytes) => {
                    let length = u32::from_le_bytes(bytes[..4].try_into().expect("a length")) as usize;
                    let head = serde_json::from_slice(&bytes[4..4 + length]).expect("a head");
                    return (head, bytes[4 + length..].to_vec());
                }
                _ => {}
            }
        }
    }

    fn note(&mut self, text: &str) {
        let told: Value = serde_json::from_str(text).expect("JSON");
        if !told["state"].is_null() {
            self.state = told["state"].clone();
        }
    }

    /// Takes pictures until one is what is wanted.
    fn until(&mut self, is: impl Fn(&Value) -> bool) -> (Value, Vec<u8>) {
        let start = Instant::now();
        loop {
            let (head, bytes) = self.picture();
            self.tell(json!({"do": "taken"}));
            if is(&head) {
                return (head, bytes);
            }
            assert!(start.elapsed() < MOST, "{head}");
        }
    }

    /// Reads until the state is what is wanted.
    fn state_that(&mut self, is: impl Fn(&Value) -> bool) {
        let start = Instant::now();
        while !is(&self.state) {
            match self.socket.read().expect("a message") {
                Message::Text(text) => self.note(&text),
                Message::Binary(_) => self.tell(json!({"do": "taken"})),
                _ => {}
            }
            assert!(start.elapsed() < MOST, "{}", self.state);
        }
    }
}

fn is_done(head: &Value) -> bool {
    head["stage"] == "done"
}

#[test]
fn pictures_follow_what_a_page_tells() {
    let folder = folder();
    let scene = city(folder.path(), "60K", "500");
    let server = Server::start(&scene, "--spp 1 --size 320x180 --cache 40%");
    assert_eq!(server.status(&format!("/?token={}", server.token)), 200);
    let mut guest = server.session(&server.token).expect("a session");
    guest.tell(json!({"do": "size", "width": 160, "height": 90}));
    let wanted = |head: &Value| is_done(head) && head["size"] == json!([160, 90]);
    let (first, picture) = guest.until(wanted);
    assert_eq!((first["kind"].as_str(), first["states"][0].as_u64()), (Some("image/webp"), Some(160 * 90)));
    // Without loss: it is the picture of `walk`.
    let decoded = image::load_from_memory(&picture).expect("a picture").to_rgb8();
    let settings = brickwalk::Settings::from_options("--spp 1 --size 160x90 --adapter cpu").expect("options");
    let session = brickwalk::Session::open(
        &scene,
        &brickwalk::Settings {
            // The view that a page begins with is that of its own first size.
            size: brickwalk::settings::ImageSize { width: 320, height: 180 },
            ..settings.clone()
        },
    );
    let camera = session.expect("a session").path().frame(0, 1);
    let mut session = brickwalk::Session::open(&scene, &settings).expect("a session");
    let truth = session.frame(&camera).expect("a frame").picture();
    assert!(decoded.as_raw() == truth.as_flattened());
    // Keys move the camera.
    guest.tell(json!({"do": "thrust", "forward": 1, "right": 0, "up": 0, "fast": true}));
    let (moving, jpeg) = guest.until(|head| head["stage"] == "moving" && head["position"] != first["position"]);
    assert_eq!(moving["kind"], "image/jpeg");
    assert!(image::load_from_memory(&jpeg).is_ok());
    guest.tell(json!({"do": "thrust", "forward": 0, "right": 0, "up": 0, "fast": false}));
    let (rested, _) = guest.until(wanted);
    assert_ne!(rested["position"], first["position"]);
    guest.tell(json!({"do": "home"}));
    let (home, _) = guest.until(|head| wanted(head) && head["position"] == first["position"]);
    assert_eq!(home["position"], first["position"]);
    // Settings, clicks, paths.
    guest.tell(json!({"do": "set", "key": "effects", "value": "primary"}));
    guest.state_that(|state| state["settings"]["effects"] == "primary");
    guest.tell(json!({"do": "click", "at": [0.5, 0.45], "double": false}));
    guest.state_that(|state| state["found"].as_array().is_some_and(|lines| !lines.is_empty()));
    // Nodes: found, left out, shown again, gone to; a number that none has is said.
    guest.tell(json!({"do": "find", "text": "block"}));
    guest.state_that(|state| state["nodes"]["count"].as_u64().is_some_and(|count| count > 0));
    guest.tell(json!({"do": "node", "act": "hide", "number": null}));
    guest.tell(json!({"do": "node", "act": "only", "number": 0}));
    guest.state_that(|state| state["left_out"][1].as_array().is_some_and(|only| only.len() == 1));
    guest.tell(json!({"do": "show_all"}));
    guest.state_that(|state| state["left_out"] == json!([[], []]));
    guest.tell(json!({"do": "node", "act": "go", "number": 0}));
    guest.state_that(|state| state["located"]["size"][0].as_f64().is_some_and(|size| size > 0.0));
    guest.tell(json!({"do": "node", "act": "hide", "number": 1_000_000}));
    guest.state_that(|state| state["messages"].to_string().contains("no such node"));
    guest.tell(json!({"do": "keyframe"}));
    guest.state_that(|state| state["keyframes"] == 1);
    // What is wrong is said, and changes nothing.
    let before = guest.state["settings"].clone();
    for bad in [
        json!({"do": "set", "key": "cache", "value": "1G"}),
        json!({"do": "set", "key": "environment", "value": "/etc/hostname"}),
        json!({"do": "overlay", "name": "nothing"}),
        json!({"do": "erase"}),
        json!([1, 2, 3]),
    ] {
        let count = guest.state["messages"].as_array().map_or(0, Vec::len);
        guest.tell(bad);
        guest.state_that(|state| state["messages"].as_array().is_some_and(|all| all.len() > count));
    }
    assert_eq!(guest.state["settings"], before);
    for wild in [f64::MAX, -1e300] {
        guest.tell(json!({"do": "look", "right": wild, "up": wild}));
        guest.tell(json!({"do": "dolly", "at": [wild, wild], "steps": wild}));
        guest.tell(json!({"do": "orbit", "at": [0.5, 0.5], "right": wild, "up": wild}));
    }
    guest.tell(json!({"do": "size", "width": 0, "height": 0}));
    guest.until(|head| head["size"] == json!([1, 1]));
}

#[test]
fn who_asks_for_nothing_is_let_go() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "500");
    let server = Server::start(&scene, "--spp 1 --size 64x36");
    // More than may be open, half of them in the middle of a request.
    let mut idle: Vec<TcpStream> = (0..150).map(|_| server.connection()).collect();
    for stream in idle.iter_mut().step_by(2) {
        write!(stream, "GET /?token={} HTTP/1.1\r\nHost: ", server.token).expect("half a request");
    }
    assert_eq!(server.status(&format!("/?token={}", server.token)), 200);
    for stream in &mut idle {
        let mut answer = Vec::new();
        match stream.read_to_end(&mut answer) {
            Ok(count) => assert!(count == 0 || answer.starts_with(b"HTTP/1.1 408"), "{answer:?}"),
            Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset),
        }
    }
    server.wait_for_session().until(is_done);
}

#[test]
fn nobody_comes_in_without_the_token_or_beyond_the_limit() {
    let folder = folder();
    let scene = city(folder.path(), "10K", "500");
    let server = Server::start(&scene, "--spp 1 --size 64x36 --viewers 2");
    let wrong = format!("{}0", &server.token[..31]);
    for path in ["/".to_owned(), "/?token=".into(), format!("/?token={wrong}"), format!("/?token={}0", server.token)] {
        let expected = if wrong == server.token && path.ends_with(&wrong) { 200 } else { 401 };
        assert_eq!(server.status(&path), expected, "{path}");
    }
    assert_eq!(server.session("").err(), Some(401));
    // Pages of other servers, even with the token.
    let own = format!("http://{}", server.host);
    for (headers, expected) in [
        (vec![("origin", "http://example.org")], Some(403)),
        (vec![("origin", "null")], Some(403)),
        (vec![("origin", &own[..]), ("host", "example.org")], Some(403)),
        (vec![("origin", &own[..])], None),
        (vec![("origin", "https://example.org"), ("x-forwarded-host", "example.org")], None),
    ] {
        assert_eq!(server.session_with(&server.token, &headers).err(), expected, "{headers:?}");
    }
    assert_eq!(server.status("/../etc/hostname"), 404);
    // More than a hand can tell ends a session.
    let mut flood = server.wait_for_session();
    let size = Message::text(json!({"do": "size", "width": 64, "height": 36}).to_string());
    // However many of them the system keeps until they are read.
    let start = Instant::now();
    while flood.socket.send(size.clone()).is_ok() {
        assert!(start.elapsed() < MOST, "it may tell on and on");
    }
    drop(flood);
    let mut guests: Vec<Guest> = (0..2).map(|_| server.wait_for_session()).collect();
    for guest in &mut guests {
        guest.until(is_done);
    }
    // A page that takes no pictures gets no more of them, and holds nobody up.
    guests[0].tell(json!({"do": "thrust", "forward": 0.1, "right": 0, "up": 0, "fast": false}));
    guests[0].picture();
    let before = server.holds();
    let refused = (0..100).filter(|_| server.session(&server.token).err() == Some(503)).count();
    assert_eq!(refused, 100);
    guests[1].tell(json!({"do": "all"}));
    guests[1].until(is_done);
    if let (Some(before), Some(after)) = (before, server.holds()) {
        assert!(after[0] <= before[0] + 2 && after[1] <= before[1] + 4, "{before:?} {after:?}");
    }
    // Whoever goes makes room, many times over, and nothing is left of them.
    drop(guests);
    let mut least = None;
    for number in 0..6 {
        let mut guest = server.wait_for_session();
        guest.until(is_done);
        drop(guest);
        std::thread::sleep(Duration::from_millis(300));
        let Some(holds) = server.holds() else { continue };
        if number == 1 {
            least = Some(holds);
        }
        if let Some(least) = least {
            assert!(holds[0] <= least[0] + 3 && holds[1] <= least[1] + 4, "{least:?} {holds:?}");
        }
    }
}

//! The same behind a web page, for machines without a screen: one page without other files, pictures and input over a
//! WebSocket. Whoever has the token in the link gets a session, as far as there are some left.
//!
//! | part | what it does |
//! | --- | --- |
//! | this file | listens, checks tokens, counts sessions |
//! | `guest` | one session: what is told becomes wishes, pictures go out as fast as they are taken |
//! | `told` | what a page tells, and what it may set |
//! | `encode` | pictures as bytes |
//! | `page.html` | the page |

mod encode;
mod guest;
pub mod told;

use super::studio::{Converter, Pace};
use crate::session::Settings;
use anyhow::{Context, Result};
use axum::Router;
use axum::extract::ws::WebSocketUpgrade;
use axum::extract::{Query, State};
use axum::http::{HeaderMap, StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use hyper::server::conn::http1;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::service::TowerToHyperService;
use serde::Deserialize;
use std::net::{IpAddr, SocketAddr};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;
use tokio::sync::{Notify, Semaphore};

const PAGE: &str = include_str!("page.html");
/// Most bytes of what a page tells at once.
const MOST_BYTES: usize = 1 << 16;
/// Most connections at a time that are no sessions; more wait.
const MOST_CONNECTIONS: usize = 128;
/// A connection that has not asked for anything within so long ends.
const PATIENCE: Duration = Duration::from_secs(10);

/// What is served.
pub struct Options {
    /// A scene file or a model.
    pub scene: PathBuf,
    /// Settings that sessions begin with.
    pub settings: Settings,
    /// What time pictures have.
    pub pace: Pace,
    /// Where to listen.
    pub address: IpAddr,
    /// 0: any that is free.
    pub port: u16,
    /// Most sessions at a time.
    pub most: usize,
}

/// What all connections share.
struct Shared {
    options: Options,
    converter: Converter,
    token: String,
    sessions: Arc<Semaphore>,
    /// Told when the server ends.
    ends: Arc<Notify>,
}

/// What comes with an address.
#[derive(Deserialize)]
struct Asked {
    #[serde(default)]
    token: String,
}

impl Shared {
    /// Whether a token is the one; it takes the same time wherever they differ.
    fn knows(&self, token: &str) -> bool {
        let differences = token.bytes().zip(self.token.bytes()).fold(0, |sum, (a, b)| sum | (a ^ b));
        token.len() == self.token.len() && differences == 0
    }
}

/// 128 random bits, in hexadecimal.
fn token() -> Result<String> {
    let mut bytes = [0; 16];
    getrandom::fill(&mut bytes).map_err(|error| anyhow::anyhow!("no random numbers for a token: {error}"))?;
    Ok(bytes.iter().map(|byte| format!("{byte:02x}")).collect())
}

/// Serves until the process is told to stop; `ready` gets the link as soon as it works.
///
/// # Errors
/// The address cannot be listened on.
pub fn run(options: Options, converter: Converter, ready: impl FnOnce(&str) -> Result<()>) -> Result<()> {
    let address = SocketAddr::new(options.address, options.port);
    let runtime = tokio::runtime::Builder::new_multi_thread().worker_threads(2).enable_all().build()?;
    let sessions = Arc::new(Semaphore::new(options.most));
    let shared = Arc::new(Shared { options, converter, token: token()?, sessions, ends: Arc::default() });
    runtime.block_on(async {
        let listener = TcpListener::bind(address).await;
        let listener = listener.with_context(|| format!("{address}: cannot listen there; give another --port"))?;
        let port = listener.local_addr()?.port();
        let host = match shared.options.address {
            IpAddr::V4(address) => address.to_string(),
            IpAddr::V6(address) => format!("[{address}]"),
        };
        ready(&format!("http://{host}:{port}/?token={}", shared.token))?;
        tokio::select! {
            () = accept(&listener, router(shared.clone())) => {}
            // Without a handler the process ends at once, which is as good.
            _ = tokio::signal::ctrl_c() => {}
        }
        // Sessions end with the picture that they are at; those that wait for their page are cut off.
        shared.ends.notify_waiters();
        let most = u32::try_from(shared.options.most)?;
        let _ = tokio::time::timeout(Duration::from_secs(1), shared.sessions.acquire_many(most)).await;
        Ok(())
    })
}

/// Answers whoever connects, for ever.
async fn accept(listener: &TcpListener, router: Router) {
    let connections = Arc::new(Semaphore::new(MOST_CONNECTIONS));
    while let Ok(permit) = connections.clone().acquire_owned().await {
        let stream = match listener.accept().await {
            Ok((stream, _)) => stream,
            Err(_) => {
                // Who went away while it waited, or too many open files, which others close.
                tokio::time::sleep(Duration::from_millis(50)).await;
                continue;
            }
        };
        let service = TowerToHyperService::new(router.clone());
        tokio::spawn(async move {
            let mut server = http1::Builder::new();
            server.timer(TokioTimer::new()).header_read_timeout(PATIENCE);
            // What goes wrong here concerns nobody but the other end. It is over once it becomes a session.
            let _ = server.serve_connection(TokioIo::new(stream), service).with_upgrades().await;
            drop(permit);
        });
    }
}

fn router(shared: Arc<Shared>) -> Router {
    Router::new().route("/", get(page)).route("/session", get(session)).with_state(shared)
}

/// The page.
async fn page(State(shared): State<Arc<Shared>>, Query(asked): Query<Asked>) -> Response {
    if !shared.knows(&asked.token) {
        return refused();
    }
    let own = "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; connect-src 'self'; \
               img-src blob: data:";
    let headers = [
        (header::CONTENT_TYPE, "text/html; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
        (header::REFERRER_POLICY, "no-referrer"),
        (header::CONTENT_SECURITY_POLICY, own),
    ];
    (headers, PAGE).into_response()
}

/// Whether a request comes from a page of this server. Browsers name the host that a page is from; what is no browser
/// names none. A proxy may have another host, and hands the one that was asked for on.
fn is_from_here(headers: &HeaderMap) -> bool {
    let text = |name: &str| headers.get(name)?.to_str().ok();
    if !headers.contains_key(header::ORIGIN) {
        return true;
    }
    let origin = text("origin").and_then(|origin| Some(origin.split_once("://")?.1));
    origin.is_some_and(|host| [text("host"), text("x-forwarded-host")].contains(&Some(host)))
}

/// A session, if there is one left.
async fn session(
    State(shared): State<Arc<Shared>>,
    Query(asked): Query<Asked>,
    headers: HeaderMap,
    upgrade: WebSocketUpgrade,
) -> Response {
    if !shared.knows(&asked.token) {
        return refused();
    }
    if !is_from_here(&headers) {
        return (
            StatusCode::FORBIDDEN,
            "this page is from another server; take the link that brickwalk serve printed\n",
        )
            .into_response();
    }
    let Ok(permit) = shared.sessions.clone().try_acquire_owned() else {
        let text = format!("all {} sessions are taken; close one, or serve with more --viewers", shared.options.most);
        return (StatusCode::SERVICE_UNAVAILABLE, text).into_response();
    };
    upgrade.max_message_size(MOST_BYTES).on_upgrade(move |socket| async move {
        guest::receive(socket, &shared.options, shared.converter.clone(), shared.ends.clone()).await;
        drop(permit);
    })
}

fn refused() -> Response {
    let text = "the token in the link is missing or wrong; take the link that brickwalk serve printed\n";
    (StatusCode::UNAUTHORIZED, text).into_response()
}

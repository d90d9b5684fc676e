//! An object in a bucket or on a web server, by the crate `object_store`: addresses, credentials, clients.

use super::fetch::Limits;
use super::traffic::{Counters, add};
use anyhow::{Context, Result, bail};
use async_trait::async_trait;
use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use http::HeaderMap;
use http::header::{AUTHORIZATION, HeaderValue, RANGE};
use http::status::StatusCode;
use http_body_util::BodyExt;
use object_store::aws::{AmazonS3Builder, AmazonS3ConfigKey};
use object_store::azure::{AzureConfigKey, MicrosoftAzureBuilder};
use object_store::client::{
    HttpClient, HttpConnector, HttpError, HttpErrorKind, HttpRequest, HttpResponse, HttpResponseBody, HttpService,
    ReqwestConnector,
};
use object_store::gcp::{GoogleCloudStorageBuilder, GoogleConfigKey};
use object_store::http::HttpBuilder;
use object_store::path::Path;
use object_store::{BackoffConfig, ClientConfigKey, ClientOptions, ObjectStore, RetryConfig};
use percent_encoding::percent_decode_str;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Duration;
use url::Url;

/// An object, and the store that it is in.
pub(super) struct Object {
    pub store: Arc<dyn ObjectStore>,
    pub path: Path,
}

/// What went wrong with the requests for a range; it goes along with them.
#[derive(Clone, Debug, Default)]
pub(super) struct Note(Arc<Mutex<Noted>>);

#[derive(Debug, Default)]
struct Noted {
    requests: u64,
    trouble: Option<String>,
}

impl Note {
    fn lock(&self) -> MutexGuard<'_, Noted> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn set(&self, text: String) {
        self.lock().trouble = Some(text);
    }

    /// Notes a request; whether there was one before.
    fn is_repeated(&self) -> bool {
        let mut noted = self.lock();
        noted.requests += 1;
        noted.requests > 1
    }

    /// What went wrong last.
    pub fn take(&self) -> Option<String> {
        self.lock().trouble.take()
    }
}

/// Said of a server that answers a request for a range with all of an object.
pub(super) const NO_RANGES: &str = "the server does not answer range requests";

/// Begins what is said of a request that a server refused.
pub(super) const ANSWERED: &str = "the server answered";
/// Said where no server is reached.
pub(super) const NO_CONNECTION: &str = "there is no connection";

/// What is said of a failed request; nothing of it is secret.
fn said(error: &HttpError) -> String {
    match error.kind() {
        HttpErrorKind::Connect => NO_CONNECTION.into(),
        HttpErrorKind::Timeout => "the answer took too long".into(),
        HttpErrorKind::Interrupted | HttpErrorKind::Request | HttpErrorKind::Decode => "the answer was cut off".into(),
        _ => "the request failed".into(),
    }
}

/// Counts requests and bytes, and notes what goes wrong.
#[derive(Debug)]
struct Counting {
    client: HttpClient,
    counters: Arc<Counters>,
}

#[async_trait]
impl HttpService for Counting {
    async fn call(&self, request: HttpRequest) -> Result<HttpResponse, HttpError> {
        add(&self.counters.requests, 1);
        let note = request.extensions().get::<Note>().cloned().unwrap_or_default();
        add(&self.counters.retries, u64::from(note.is_repeated()));
        let is_range = request.headers().contains_key(RANGE);
        let response = self.client.execute(request).await.inspect_err(|error| note.set(said(error)))?;
        let (parts, body) = response.into_parts();
        match parts.status {
            StatusCode::OK if is_range => note.set(NO_RANGES.into()),
            status if !status.is_success() => note.set(format!("{ANSWERED} {status}")),
            _ => {}
        }
        let counters = self.counters.clone();
        let body = body.map_frame(move |frame| {
            add(&counters.bytes_fetched, frame.data_ref().map_or(0, |data| data.len() as u64));
            frame
        });
        let body = body.map_err(move |error| {
            note.set(said(&error));
            error
        });
        Ok(HttpResponse::from_parts(parts, HttpResponseBody::new(body)))
    }
}

/// Makes clients that count.
#[derive(Debug)]
struct Connector(Arc<Counters>);

impl HttpConnector for Connector {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        let client = ReqwestConnector::default().connect(options)?;
        Ok(HttpClient::new(Counting { client, counters: self.0.clone() }))
    }
}

/// Longest time of an answer as a whole: there is a limit of silence, too.
const LONGEST_ANSWER: Duration = Duration::from_secs(3600);

impl Object {
    /// The object that `url` names. No request is made yet.
    ///
    /// # Errors
    /// The URL is none; what the environment says of credentials is wrong.
    pub fn new(url: &str, limits: &Limits, counters: &Arc<Counters>) -> Result<Self> {
        // Another one may be there already, and does as well.
        let _ = rustls::crypto::ring::default_provider().install_default();
        let mut url = Url::parse(url).context("this is no URL")?;
        let seconds = |time: Duration| format!("{} ms", time.as_millis());
        let client = [
            (ClientConfigKey::ConnectTimeout, seconds(limits.connect)),
            (ClientConfigKey::ReadTimeout, seconds(limits.silence)),
            (ClientConfigKey::Timeout, seconds(LONGEST_ANSWER)),
            (ClientConfigKey::UserAgent, concat!("brickwalk/", env!("CARGO_PKG_VERSION")).to_owned()),
        ];
        let retry = RetryConfig {
            backoff: BackoffConfig {
                init_backoff: limits.first_pause,
                max_backoff: limits.longest_pause,
                ..BackoffConfig::default()
            },
            max_retries: limits.retries,
            retry_timeout: limits.retry_time,
        };
        let connector = Connector(counters.clone());
        let host = url.host_str().context("the URL names no bucket or host")?.to_owned();
        let path = || Path::from_url_path(url.path()).context("the URL's path is none of an object");
        // What the crate says of settings may repeat them.
        let wrong = "the settings of the store in the environment do not go together; see docs/remote.md";
        // Builders of stores have no trait in common.
        macro_rules! in_bucket {
            ($builder:expr, $key:path) => {{
                let builder = $builder.with_retry(retry).with_http_connector(connector);
                let builder =
                    client.into_iter().fold(builder, |builder, (key, value)| builder.with_config($key(key), value));
                let store = builder.build().map_err(|_| anyhow::anyhow!(wrong))?;
                Self { store: Arc::new(store), path: path()? }
            }};
        }
        Ok(match url.scheme() {
            "s3" => in_bucket!(AmazonS3Builder::from_env().with_bucket_name(host), AmazonS3ConfigKey::Client),
            "gs" => in_bucket!(GoogleCloudStorageBuilder::from_env().with_bucket_name(host), GoogleConfigKey::Client),
            "az" => in_bucket!(MicrosoftAzureBuilder::from_env().with_container_name(host), AzureConfigKey::Client),
            "http" | "https" => {
                let is_plain = url.scheme() == "http";
                let options = ClientOptions::new().with_allow_http(is_plain).with_no_system_certificates(is_plain);
                let options = client.into_iter().fold(options, |options, (key, value)| options.with_config(key, value));
                let options = options.with_default_headers(login(&mut url)?);
                url.set_fragment(None);
                // The whole URL, so that nothing of it is encoded anew: a signature is of its very letters.
                let builder = HttpBuilder::new().with_url(url.as_str()).with_client_options(options).with_retry(retry);
                let store = builder.with_http_connector(connector).build();
                let store = store.map_err(|_| {
                    anyhow::anyhow!(
                        "cannot make a client; HTTPS needs root certificates of the system (the package \
                         ca-certificates, or SSL_CERT_FILE)"
                    )
                })?;
                Self { store: Arc::new(store), path: Path::default() }
            }
            scheme => bail!("no scheme {scheme}; use s3, gs, az, http or https"),
        })
    }
}

/// User and password of a URL as a header; they are taken out of it.
fn login(url: &mut Url) -> Result<HeaderMap> {
    let mut headers = HeaderMap::new();
    if !url.username().is_empty() || url.password().is_some() {
        let decoded = |text: &str| percent_decode_str(text).collect::<Vec<u8>>();
        let both = [decoded(url.username()), decoded(url.password().unwrap_or_default())].join(&b':');
        let mut value = HeaderValue::from_str(&format!("Basic {}", BASE64_STANDARD.encode(both)))?;
        value.set_sensitive(true);
        headers.insert(AUTHORIZATION, value);
        let _ = url.set_username("").and(url.set_password(None));
    }
    Ok(headers)
}

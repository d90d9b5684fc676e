//! `brickwalk-bucket ROOT`: a server of S3's protocol on this machine, for tests. Folders in ROOT are buckets.
//!
//! The crate `s3s` has the protocol from the service's own model. Signatures are checked against the key that the
//! environment names: `AWS_ACCESS_KEY_ID`, `AWS_SECRET_ACCESS_KEY`. Prints its port, and ends when its input does.

use anyhow::{Context, Result, anyhow};
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto::Builder;
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use std::env::{args_os, var};
use std::io::{Read, Write, stdin, stdout};
use std::path::PathBuf;
use tokio::net::TcpListener;
use tokio::runtime;

fn main() -> Result<()> {
    let root: PathBuf = args_os().nth(1).context("usage: brickwalk-bucket ROOT")?.into();
    let key = |name: &str| var(name).with_context(|| format!("{name} is not set"));
    let files = FileSystem::new(&root).map_err(|error| anyhow!("{}: {error:?}", root.display()))?;
    let mut service = S3ServiceBuilder::new(files);
    service.set_auth(SimpleAuth::from_single(key("AWS_ACCESS_KEY_ID")?, key("AWS_SECRET_ACCESS_KEY")?));
    let service = service.build();
    // Whoever started it has ended, or wants it to.
    std::thread::spawn(|| {
        let _ = stdin().read_to_end(&mut Vec::new());
        std::process::exit(0)
    });
    runtime::Builder::new_current_thread().enable_all().build()?.block_on(async {
        let listener = TcpListener::bind(("127.0.0.1", 0)).await?;
        writeln!(stdout(), "{}", listener.local_addr()?.port())?;
        stdout().flush()?;
        loop {
            let (socket, _) = listener.accept().await?;
            let service = service.clone();
            tokio::spawn(async move {
                // A connection that breaks is its client's affair.
                let _ = Builder::new(TokioExecutor::new()).serve_connection(TokioIo::new(socket), service).await;
            });
        }
    })
}

//! A walk through a scene in a bucket has the bytes of one through the file. The server is that of the crate `s3s`: it
//! knows S3's protocol from the service's own model, and checks signatures.

use crate::common::{city, folder, frames, json};
use hyper_util::rt::{TokioExecutor, TokioIo};
use hyper_util::server::conn::auto::Builder;
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use std::path::Path;
use std::process::{Command, Output};
use tokio::net::TcpListener;
use tokio::runtime;

const KEY: &str = "nobody";
const SECRET: &str = "5ec2e7-5ec2e7";

/// Serves the folders in `root` as buckets until the process ends; its address.
fn serve(root: &Path) -> String {
    let mut service = S3ServiceBuilder::new(FileSystem::new(root).expect("a folder"));
    service.set_auth(SimpleAuth::from_single(KEY, SECRET));
    let service = service.build();
    let listener = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let address = listener.local_addr().expect("an address");
    listener.set_nonblocking(true).expect("a socket");
    std::thread::spawn(move || {
        let threads = runtime::Builder::new_current_thread().enable_all().build().expect("a runtime");
        threads.block_on(async move {
            let listener = TcpListener::from_std(listener).expect("a socket");
            while let Ok((socket, _)) = listener.accept().await {
                let service = service.clone();
                tokio::spawn(async move {
                    let _ = Builder::new(TokioExecutor::new()).serve_connection(TokioIo::new(socket), service).await;
                });
            }
        });
    });
    format!("http://{address}")
}

fn walk(endpoint: &str, secret: &str, scene: &str, output: &Path, options: &str) -> Output {
    let mut command = Command::new(env!("CARGO_BIN_EXE_brickwalk"));
    command.args(["walk", scene, "-o"]).arg(output).args(options.split(' '));
    let keys = [("AWS_ACCESS_KEY_ID", KEY), ("AWS_SECRET_ACCESS_KEY", secret), ("AWS_REGION", "us-east-1")];
    command.envs(keys).env("AWS_ENDPOINT", endpoint).env("AWS_ALLOW_HTTP", "true");
    command.output().expect("the command starts")
}

#[test]
fn a_walk_from_a_bucket_is_that_of_the_file() {
    let folder = folder();
    let scene = city(folder.path(), "30K", "500");
    let bucket = folder.path().join("buckets").join("plant");
    std::fs::create_dir_all(bucket.join("scenes")).expect("a folder");
    let object = bucket.join("scenes").join("a b.bricks");
    std::fs::copy(&scene, &object).expect("a copy");
    let endpoint = serve(&folder.path().join("buckets"));
    let options = format!(
        "--path {} --quality draft --frames 3 --size 72x40 --cache 40% --adapter cpu",
        scene.with_extension("near.json").display()
    );
    let [local, remote] = ["local", "remote"].map(|name| folder.path().join(name));
    let url = "s3://plant/scenes/a%20b.bricks";
    for (scene, output) in [(scene.to_str().expect("a name"), &local), (url, &remote)] {
        let done = walk(&endpoint, SECRET, scene, output, &options);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    }
    assert!(frames(&remote) == frames(&local));
    let summary = json(&remote.join("summary.json"));
    let of = |key: &str| summary["remote"][key].as_u64().expect("a number");
    assert!(of("bytes_fetched") as f64 <= 1.05 * of("bytes_needed") as f64, "{}", summary["remote"]);
    assert!(of("requests") > 2 && of("retries") == 0, "{}", summary["remote"]);
    assert!(json(&local.join("summary.json"))["remote"].is_null());
    // The controls: a wrong secret opens nothing, and another object is another picture.
    let output = folder.path().join("other");
    let done = walk(&endpoint, "another", url, &output, &options);
    let said = String::from_utf8_lossy(&done.stderr);
    assert!(!done.status.success() && said.contains("access was denied") && !said.contains("another"), "{said}");
    std::fs::copy(city(folder.path(), "20K", "500"), &object).expect("a copy");
    let done = walk(&endpoint, SECRET, url, &output, &options);
    assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
    assert!(frames(&output) != frames(&local));
}

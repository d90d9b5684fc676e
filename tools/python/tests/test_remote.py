"""Scenes from a bucket, which two servers on this machine play: the same answers as from the file."""

import http.server
import os
import pickle
import shutil
import ssl
import subprocess
import sys
import threading
import time
import urllib.request

import numpy as np
import pytest

import brickwalk
import meshes

KEYS = {
    "AWS_ACCESS_KEY_ID": "nobody",
    "AWS_SECRET_ACCESS_KEY": "5ec2e7",
    "AWS_REGION": "us-east-1",
    "AWS_ALLOW_HTTP": "true",
}

# Servers serve until their input ends, and say at which port. This one has the protocol; that of tools/bucket, which
# the environment variable BUCKET names, checks signatures as well.
MOTO = """
import sys
from moto.server import ThreadedMotoServer
server = ThreadedMotoServer(ip_address="127.0.0.1", port=0, verbose=False)
server.start()
print(server.get_host_and_port()[1], flush=True)
sys.stdin.read()
server.stop()
"""


def put(url, body=b""):
    request = urllib.request.Request(url, data=body, method="PUT")
    request.add_header("Authorization", "AWS4-HMAC-SHA256 Credential=nobody/20260101/us-east-1/s3/aws4_request")
    request.add_header("Content-Type", "application/octet-stream")
    with urllib.request.urlopen(request, timeout=30) as answer:
        assert answer.status == 200


@pytest.fixture(scope="module", params=["moto", "s3s"])
def bucket(request, tmp_path_factory):
    """A scene file, and its URL."""
    root = tmp_path_factory.mktemp("buckets")
    if request.param == "moto":
        pytest.importorskip("moto.server")
        server = [sys.executable, "-c", MOTO]
    else:
        if "BUCKET" not in os.environ:
            pytest.skip("BUCKET names no server; tools/python/test.sh builds one")
        server = [os.environ["BUCKET"], str(root)]
        (root / "bucket").mkdir()
    file = tmp_path_factory.mktemp("scene") / "a.bricks"
    vertices, faces = meshes.soup(4000)
    with brickwalk.Scene.from_arrays(vertices, faces, brick_triangles=64) as scene:
        shutil.copy(scene.info["path"], file)
    own = {**os.environ, **KEYS}
    with subprocess.Popen(server, stdin=subprocess.PIPE, stdout=subprocess.PIPE, env=own) as server:
        try:
            endpoint = f"http://127.0.0.1:{int(server.stdout.readline())}"
            if request.param == "moto":
                put(f"{endpoint}/bucket")
                put(f"{endpoint}/bucket/scenes/moto-a.bricks", file.read_bytes())
            else:
                (root / "bucket" / "scenes").mkdir()
                shutil.copy(file, root / "bucket" / "scenes" / "s3s-a.bricks")
            with pytest.MonkeyPatch.context() as patch:
                for name, value in {**KEYS, "AWS_ENDPOINT": endpoint}.items():
                    patch.setenv(name, value)
                # What is counted counts for a URL.
                yield file, f"s3://bucket/scenes/{request.param}-a.bricks", request.param
        finally:
            server.stdin.close()
            server.wait(timeout=30)


def rays():
    rng = np.random.default_rng(1)
    return np.concatenate([rng.uniform(-2, 2, (5000, 3)), rng.normal(size=(5000, 3))], axis=1)


def test_answers_are_those_of_the_file(bucket):
    file, url, _ = bucket
    with brickwalk.Scene.open(file, adapter="cpu") as local, brickwalk.Scene.open(url, adapter="cpu") as remote:
        assert remote.stats()["remote"]["requests"] == 2
        assert "remote" not in local.stats()
        expected, found = local.cast_rays(rays()), remote.cast_rays(rays())
        assert np.isfinite(expected["t"]).sum() > 100
        for name in expected:
            np.testing.assert_array_equal(found[name], expected[name])
        points = np.random.default_rng(2).uniform(-2, 2, (500, 3))
        np.testing.assert_array_equal(remote.distance(points), local.distance(points))
        camera = brickwalk.Camera(position=(0, 0, 5), target=(0, 0, 0))
        picture = [scene.render(camera, size="32x24") for scene in (local, remote)]
        np.testing.assert_array_equal(picture[0]["radiance"], picture[1]["radiance"])
        stats = remote.stats()["remote"]
        assert stats["bytes_fetched"] <= 1.05 * stats["bytes_needed"] and stats["retries"] == 0
        assert "a.bricks" in repr(remote) and remote.info["path"] == url
        with pickle.loads(pickle.dumps(remote)) as copy:
            np.testing.assert_array_equal(copy.cast_rays(rays())["t"], expected["t"])


def test_a_disk_cache_saves_all_but_the_head(bucket, tmp_path):
    file, url, _ = bucket
    cache = f"{tmp_path},64M"
    # A folder that cannot be written to ends the caching, and nothing else.
    with pytest.warns(UserWarning, match="disk cache"), brickwalk.Scene.open(url, disk_cache=f"{file}/no,64M") as none:
        hits = none.cast_rays(rays())
    with brickwalk.Scene.open(url, disk_cache=cache) as first:
        expected = first.cast_rays(rays())
        np.testing.assert_array_equal(hits["t"], expected["t"])
        requests = first.stats()["remote"]["requests"]
    with brickwalk.Scene.open(url, disk_cache=cache) as second:
        np.testing.assert_array_equal(second.cast_rays(rays())["t"], expected["t"])
        stats = second.stats()["remote"]
        assert stats["requests"] == requests + 1 and stats["disk_cache_hits"] > 10
    with pytest.raises(ValueError, match="disk_cache"):
        brickwalk.Scene.open(url, disk_cache="nothing")


def test_a_forked_process_fetches_for_itself(bucket):
    _, url, _ = bucket
    if not hasattr(os, "fork"):
        pytest.skip("this system has no fork")
    with brickwalk.Scene.open(url) as scene:
        expected = scene.cast_rays(rays()[:100])["t"]
        child = os.fork()
        if child == 0:
            same = np.array_equal(scene.cast_rays(rays()[:100])["t"], expected)
            os._exit(0 if same else 1)
        deadline = time.monotonic() + 60
        while (done := os.waitpid(child, os.WNOHANG))[0] == 0 and time.monotonic() < deadline:
            time.sleep(0.05)
        if done[0] == 0:
            os.kill(child, 9)
            os.waitpid(child, 0)
        assert done == (child, 0)


def test_what_is_wrong_is_named_without_secrets(bucket, monkeypatch):
    _, url, server = bucket
    with pytest.raises(brickwalk.BrickwalkError, match="there is no such object"):
        brickwalk.Scene.open(url + ".missing")
    with pytest.raises(brickwalk.BrickwalkError, match="no connection") as error:
        brickwalk.Scene.open("http://ann:5ec2e7@127.0.0.1:9/a.bricks?sig=5ec2e7")
    assert "5ec2e7" not in str(error.value) and "127.0.0.1" in str(error.value)
    if server == "s3s":
        monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "another")
        with pytest.raises(brickwalk.BrickwalkError, match="access was denied") as error:
            brickwalk.Scene.open(url)
        assert "another" not in str(error.value)


class Ranges(http.server.BaseHTTPRequestHandler):
    """Answers requests for ranges of one file."""

    protocol_version = "HTTP/1.1"
    content = b""

    def do_GET(self):
        first, last = self.headers["Range"].removeprefix("bytes=").split("-")
        part = self.content[int(first) : int(last) + 1]
        self.send_response(206)
        self.send_header("Content-Length", str(len(part)))
        self.send_header("Content-Range", f"bytes {first}-{int(first) + len(part) - 1}/{len(self.content)}")
        self.send_header("ETag", '"one"')
        self.end_headers()
        self.wfile.write(part)

    def log_message(self, *_):
        pass


def test_https_trusts_known_certificates_alone(bucket, tmp_path):
    """A server with a certificate of its own; processes of their own, as certificates are read once in a process."""
    trustme = pytest.importorskip("trustme")
    file, _, _ = bucket
    authority = trustme.CA()
    authority.cert_pem.write_to_path(tmp_path / "known.pem")
    trustme.CA().cert_pem.write_to_path(tmp_path / "other.pem")
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), type("Own", (Ranges,), {"content": file.read_bytes()}))
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    authority.issue_cert("localhost").configure_cert(context)
    server.socket = context.wrap_socket(server.socket, server_side=True)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    url = f"https://localhost:{server.server_port}/a.bricks"
    words = f"import brickwalk; print(brickwalk.Scene.open({url!r}).info['triangles'])"

    def triangles(certificates):
        words_of = [sys.executable, "-c", words]
        done = subprocess.run(
            words_of, env={**os.environ, "SSL_CERT_FILE": str(certificates)}, capture_output=True, text=True
        )
        return done.returncode, done.stdout.strip(), done.stderr

    try:
        assert triangles(tmp_path / "known.pem")[:2] == (0, "4000")
        status, _, said = triangles(tmp_path / "other.pem")
        assert status == 1 and "BrickwalkError" in said and "panicked" not in said
    finally:
        server.shutdown()
        server.server_close()

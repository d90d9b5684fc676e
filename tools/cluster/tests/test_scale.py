"""The simulation of docs/scale.md against closed forms, and the bucket that it is compared with."""

import importlib.util
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import pytest

TOOL = Path(__file__).parents[2] / "scale.py"


@pytest.fixture(scope="module")
def scale():
    found = importlib.util.spec_from_file_location("scale", TOOL)
    module = importlib.util.module_from_spec(found)
    found.loader.exec_module(module)
    return module


def test_waiting_is_latency_and_bytes(scale):
    steps = [(0.0, 2e6, 4.0), (1.5, 0.0, 0.0), (0.0, 1e6, 2.0)]
    wall, waiting, amount, requests = scale.simulate([steps], (0.05, 10e6, 1e12, 1e12))
    assert wall == pytest.approx(2 * 0.05 + 3e6 / 10e6 + 1.5)
    assert (waiting, amount, requests) == ([pytest.approx(0.4)], 3e6, 6.0)


def test_workers_share_the_store(scale):
    # Two batches at once take as long as one after the other; with room for both, as long as one.
    steps = [[(0.0, 1e6, 1.0)], [(0.0, 1e6, 1.0)]]
    assert scale.simulate(steps, (0.0, 1e12, 1e6, 1e12))[0] == pytest.approx(2.0)
    assert scale.simulate(steps, (0.0, 1e6, 1e12, 1e12))[0] == pytest.approx(1.0)
    # A shorter one ends first, then the other has all of it: 0.5 MB each in 1 s, then 0.5 MB in 0.5 s.
    steps = [[(0.0, 5e5, 1.0)], [(0.0, 1e6, 1.0)]]
    wall, waiting, *_ = scale.simulate(steps, (0.0, 1e12, 1e6, 1e12))
    assert (wall, waiting) == (pytest.approx(1.5), [pytest.approx(1.0), pytest.approx(1.5)])
    # So many requests a second: the tenth waits for nine others.
    steps = [[(0.0, 1.0, 1.0)] for _ in range(10)]
    assert scale.simulate(steps, (0.0, 1e12, 1e12, 5.0))[0] == pytest.approx(2.0, rel=1e-3)


def test_a_cache_forgets_what_was_not_used_for_longest(scale):
    cache = scale.Cache(2.0, dict.fromkeys("abc", 1.0))
    assert [cache.missing(items) for items in ("ab", "a", "c", "b", "a")] == [
        (2.0, 2),
        (0, 0),
        (1.0, 1),
        (1.0, 1),
        (1.0, 1),
    ]


def test_every_frame_is_in_one_stretch(scale):
    for count, workers, chunk in [(24, 4, 6), (10, 3, 2), (5, 8, 1)]:
        tasks = scale.split(count, workers, chunk)
        assert len(tasks) <= workers
        assert [number for own in tasks for task in own for number in task] == list(range(count))


def test_the_bucket_waits_as_it_says(tmp_path):
    (tmp_path / "a.bin").write_bytes(bytes(range(256)) * 4000)
    line = [sys.executable, str(TOOL), "serve", str(tmp_path), "--latency", "100", "--bandwidth", "2"]
    server = subprocess.Popen(line, stdout=subprocess.PIPE, text=True)
    try:
        address = server.stdout.readline().strip()
        request = urllib.request.Request(f"{address}/a.bin", headers={"Range": "bytes=256-400255"})
        start = time.monotonic()
        with urllib.request.urlopen(request) as answer:
            assert answer.status == 206 and answer.headers["Content-Range"] == "bytes 256-400255/1024000"
            data = answer.read()
        seconds = time.monotonic() - start
        assert data == (bytes(range(256)) * 4000)[256:400256]
        assert seconds >= 0.1 + 400_000 / 2e6
    finally:
        server.kill()
        server.wait()

"""Walks over a cluster have the bytes of one machine's, whoever dies."""

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections import Counter

import psutil
import pytest
from conftest import Elsewhere, frames
from distributed import Future

from brickwalk_cluster import Cluster, Failed, walk
from brickwalk_cluster.cluster import GONE, results
from brickwalk_cluster.command import run as command
from brickwalk_cluster.walk import DONE, identity, is_done, ranges

#: Denoised frames with an automatic exposure: each depends on those before it.
VIEW = ["--frames", "60", "--size", "64x36", "--adapter", "cpu"]


@pytest.fixture(scope="module")
def whole(city, run, tmp_path_factory):
    """What one machine makes."""
    output = tmp_path_factory.mktemp("whole")
    run("walk", city, "-o", output, *VIEW)
    return frames(output)


def words(city, output):
    return [str(city), "-o", str(output), *VIEW]


def test_ranges_have_every_part_once():
    for count, chunk in [(1, 1), (60, 7), (5, 100)]:
        assert sum(ranges(count, chunk), []) == list(range(count))


@pytest.mark.parametrize("workers", [2, 4])
def test_frames_are_those_of_one_machine(city, whole, tmp_path, workers):
    log = tmp_path / "log"
    with Cluster(workers=workers) as cluster:
        done = walk(cluster, words(city, tmp_path), chunk=4, is_quiet=True, log=str(log))
        assert done["frames"] == done["rendered"] == 60
        assert frames(tmp_path) == whole
        assert Counter(log.read_text().split()) == Counter(map(str, range(60)))
        summary = json.loads((tmp_path / "summary.json").read_text())
        rows = summary["parts"]["workers"]
        assert len(rows) == workers and sum(row["parts"] for row in rows) == 60
        assert len((tmp_path / "records.jsonl").read_text().splitlines()) >= 60
        # A rerun finds that all is there; a picture that was changed is made again.
        assert walk(cluster, words(city, tmp_path), is_quiet=True)["rendered"] == 0
        picture = tmp_path / "frames" / "0007.png"
        picture.write_bytes(picture.read_bytes()[:-1])
        assert not is_done(tmp_path, done["key"])
        assert walk(cluster, words(city, tmp_path), is_quiet=True)["rendered"] == 60
        assert frames(tmp_path) == whole


def kill_workers(times, seed, stop):
    """Kills a worker at each of so many random moments; returns the numbers of those that were killed."""
    draw, killed = random.Random(seed), []

    def kill():
        while len(killed) < times and not stop.wait(draw.uniform(0.3, 1.2)):
            # What a nanny of Dask has started, and starts again.
            workers = [child for child in psutil.Process().children() if "spawn_main" in " ".join(child.cmdline())]
            if workers:
                worker = draw.choice(workers)
                worker.kill()
                killed.append(worker.pid)

    thread = threading.Thread(target=kill, daemon=True)
    thread.start()
    return killed, thread


def test_workers_that_are_killed_lose_nothing(city, whole, tmp_path):
    log, stop = tmp_path / "log", threading.Event()
    with Cluster(workers=4) as cluster:
        killed, thread = kill_workers(10, 38, stop)
        # The walk is made until ten have been killed, each time from nothing.
        rounds = 0
        while rounds == 0 or (len(killed) < 10 and rounds < 40):
            output, before = tmp_path / f"out-{rounds}", len(killed)
            walk(cluster, words(city, output), chunk=3, is_quiet=True, log=f"{log}-{rounds}")
            assert frames(output) == whole
            times = Counter((tmp_path / f"log-{rounds}").read_text().split())
            # A worker that is killed may not have told of its last part, which nobody renders again.
            untold = 60 - len(times)
            assert 0 <= untold <= len(killed) - before and max(times.values()) <= 2, times.most_common(3)
            rounds += 1
        stop.set()
        thread.join(20)
        assert len(killed) == 10


def test_a_scheduler_that_is_killed_loses_nothing(city, whole, tmp_path, program):
    """The command and its scheduler are one process here: it is killed, and run again."""
    line = [sys.executable, "-m", "brickwalk_cluster.command", "walk", *words(city, tmp_path), "--workers", "2"]
    line += ["--chunk", "2"]
    parts = tmp_path / "parts"
    process = subprocess.Popen(line, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    deadline = time.monotonic() + 120
    while not parts.is_dir() or len(list(parts.glob("*.part"))) < 10:
        assert process.poll() is None and time.monotonic() < deadline
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    before = {path.name: path.stat().st_mtime_ns for path in parts.glob("*.part")}
    assert before and not (tmp_path / DONE).exists()
    again = subprocess.run(line, capture_output=True, text=True)
    assert again.returncode == 0, again.stderr
    rendered = int(again.stdout.split(" rendered")[0].split()[-1])
    assert rendered <= 60 - len(before) + 2
    assert frames(tmp_path) == whole


def test_a_scheduler_elsewhere_that_goes_away_and_comes_back(city, whole, tmp_path):
    parts = tmp_path / "out" / "parts"
    line = ["walk", *words(city, tmp_path / "out"), "--chunk", "2"]
    with Elsewhere(tmp_path) as cluster:
        status, said = cluster.dies_during(line, lambda: len(list(parts.glob("*.part"))) >= 6)
        assert status == 1 and GONE in said and "Traceback" not in said, said
    with Elsewhere(tmp_path) as cluster:
        assert command([*line, "--scheduler", cluster.address, "-q"]) == 0
    assert frames(tmp_path / "out") == whole


def test_a_connection_that_breaks_is_told_from_a_task_that_fails(monkeypatch):
    def fails():
        raise OSError("of the task")

    with Cluster(workers=1) as cluster:
        with pytest.raises(Failed, match="of the task"):
            list(results(cluster.client, [cluster.client.submit(fails, pure=False)]))

        def broken(self, timeout=None):
            raise ConnectionResetError(104, "Connection reset by peer")

        future = cluster.client.submit(abs, -7, pure=False)
        assert list(results(cluster.client, [future])) == [7]
        future = cluster.client.submit(abs, -8, pure=False)
        monkeypatch.setattr(Future, "result", broken)
        with pytest.raises(Failed, match=GONE):
            list(results(cluster.client, [future]))
        monkeypatch.undo()
        assert len(cluster.addresses()) == 1
        monkeypatch.setattr(type(cluster.client), "scheduler_info", broken)
        with pytest.raises(Failed, match=GONE):
            cluster.addresses()


def test_bands_of_one_picture_are_rendered_by_several_workers(city, run, tmp_path):
    # Of so many samples that one worker cannot have rendered all before the other begins.
    view = ["--size", "128x256", "--bands", "4", "--frames", "2", "--adapter", "cpu", "--aov", "--spp", "64"]
    run("walk", city, "-o", tmp_path / "whole", *view)
    log = tmp_path / "log"
    with Cluster(workers=2) as cluster:
        line = [str(city), "-o", str(tmp_path / "out"), *view]
        done = walk(cluster, line, chunk=1, is_quiet=True, log=str(log))
        assert (done["frames"], done["parts"], done["rendered"]) == (2, 8, 8)
    assert frames(tmp_path / "out") == frames(tmp_path / "whole")
    assert Counter(log.read_text().split()) == Counter(map(str, range(8)))
    rows = json.loads((tmp_path / "out" / "summary.json").read_text())["parts"]["workers"]
    assert sum(row["parts"] for row in rows) == 8 and len(rows) == 2


def test_a_walk_from_a_bucket_is_that_of_the_file(city, whole, run, tmp_path, monkeypatch):
    """By one process, and by workers of a cluster, which fetch for themselves."""
    if "BUCKET" not in os.environ:
        pytest.skip("BUCKET names no server; tools/cluster/test.sh builds one")
    folder = tmp_path / "buckets" / "plant" / "scenes"
    folder.mkdir(parents=True)
    shutil.copy(city, folder / "a b.bricks")
    keys = {"AWS_ACCESS_KEY_ID": "nobody", "AWS_SECRET_ACCESS_KEY": "5ec2e7", "AWS_REGION": "us-east-1"}
    for name, value in {**keys, "AWS_ALLOW_HTTP": "true"}.items():
        monkeypatch.setenv(name, value)
    line = [os.environ["BUCKET"], str(tmp_path / "buckets")]
    with subprocess.Popen(line, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as server:
        monkeypatch.setenv("AWS_ENDPOINT", f"http://127.0.0.1:{int(server.stdout.readline())}")
        scene = "s3://plant/scenes/a%20b.bricks"
        run("walk", scene, "-o", tmp_path / "one", *VIEW)
        with Cluster(workers=2) as cluster:
            done = walk(cluster, [scene, "-o", str(tmp_path / "two"), *VIEW], is_quiet=True)
        server.stdin.close()
    run("walk", city, "-o", tmp_path / "file", *VIEW)
    assert frames(tmp_path / "one") == frames(tmp_path / "two") == frames(tmp_path / "file")
    remote = json.loads((tmp_path / "one" / "summary.json").read_text())["remote"]
    assert remote["bytes_fetched"] <= 1.05 * remote["bytes_needed"] and remote["retries"] == 0
    assert done["requests"] > 2 and done["bytes_fetched"] > 0


def test_what_is_wrong_is_said_in_a_line(city, tmp_path, program, capfd, monkeypatch):
    cases = [
        (["walk", "none.bricks", "-o", str(tmp_path / "a")], "none.bricks"),
        (["walk", str(city), "-o", str(tmp_path / "a"), "--frame-budget", "8M"], "--frame-budget"),
        (["walk", str(city), "-o", str(tmp_path / "a"), "--nonsense"], "--nonsense"),
        (["walk", str(city), "-o", str(tmp_path / "a"), "--scheduler", "tcp://127.0.0.1:9"], "no scheduler of Dask"),
    ]
    for line, named in cases:
        assert command([*line, *([] if "--scheduler" in line else ["--workers", "1"])]) == 1
        said = capfd.readouterr().err.strip().splitlines()
        assert named in said[-1] and said[-1].startswith("brickwalk-cluster: "), said
    assert not (tmp_path / "a").exists()
    monkeypatch.setenv("BRICKWALK", "no-such-program")
    with Cluster(workers=1) as cluster, pytest.raises(Failed, match="BRICKWALK names no program"):
        walk(cluster, words(city, tmp_path))


def test_another_exposure_is_another_walk(city, whole, tmp_path, program):
    """Parts do not depend on it, pictures do."""
    one = identity("k", 'spp = 4\nexposure = "1.0"\ncache = "64M"\n')
    assert one == identity("k", 'spp = 4\nexposure = "1.0"\n') != identity("k", 'spp = 4\nexposure = "2.0"\n')
    with Cluster(workers=1) as cluster:
        short = [*words(city, tmp_path), "--exposure", "1"]
        short[short.index("60")] = "3"
        assert walk(cluster, short, is_quiet=True)["rendered"] == 3
        bright = frames(tmp_path)
        assert walk(cluster, short, is_quiet=True)["rendered"] == 0
        short[-1] = "-1"
        assert walk(cluster, short, is_quiet=True)["rendered"] == 3
        assert frames(tmp_path).keys() == bright.keys() and frames(tmp_path) != bright


def test_a_changed_part_is_noticed(city, whole, tmp_path, program):
    """The control: were parts not checked, a bit that turned in one would show in the pictures."""
    output = tmp_path / "out"
    with Cluster(workers=1) as cluster:
        log = tmp_path / "log"
        walk(cluster, words(city, output), is_quiet=True)
        (output / DONE).unlink()
        parts = output / "parts"
        line = ["walk", *words(city, output), "--part", "0-59"]
        subprocess.run([program, "-q", *line], check=True)
        changed = parts / "0031.part"
        data = bytearray(changed.read_bytes())
        data[len(data) // 2] ^= 16
        changed.write_bytes(data)
        done = walk(cluster, words(city, output), is_quiet=True, log=str(log))
        assert done["rendered"] == 1 and log.read_text().split() == ["31"]
        assert frames(output) == whole

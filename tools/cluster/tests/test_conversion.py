"""Conversions over a cluster of processes: the bytes of one machine, whichever workers are killed."""

from __future__ import annotations

import os
import random
import signal
import subprocess
import sys
import textwrap
import threading
import time
from pathlib import Path

import pytest
from conftest import Elsewhere

import brickwalk

ROOT = Path(__file__).resolve().parents[1]
# Workers and other processes import the package from here, whether it is installed or not.
sys.path.insert(0, str(ROOT))
os.environ["PYTHONPATH"] = os.pathsep.join([str(ROOT), *os.environ.get("PYTHONPATH", "").split(os.pathsep)]).rstrip(":")

import dask  # noqa: E402
from distributed import Client, LocalCluster  # noqa: E402
from distributed.core import Status  # noqa: E402

from brickwalk_cluster import conversion  # noqa: E402
from brickwalk_cluster.cluster import GONE  # noqa: E402
from brickwalk_cluster.command import run as command  # noqa: E402

WORKERS = 4

# Little enough for the model to be cut and distributed in pieces, as large ones are.
LITTLE = {"memory": "90M", "brick_triangles": 4000}


@pytest.fixture(scope="module")
def client():
    with (
        dask.config.set({"distributed.scheduler.allowed-failures": 1000}),
        LocalCluster(
            n_workers=WORKERS, threads_per_worker=1, processes=True, dashboard_address=None, memory_limit=0
        ) as cluster,
        Client(cluster) as connected,
    ):
        yield connected


@pytest.fixture(scope="module")
def model(tmp_path_factory) -> Path:
    """Some hundred thousand triangles without any order, several times what is cut at once."""
    path = tmp_path_factory.mktemp("model") / "soup.stl"
    write_soup(path, 700_000)
    return path


def write_soup(path: Path, triangles: int) -> None:
    import numpy as np

    source = np.random.default_rng(37)
    records = np.zeros(triangles, dtype=[("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("rest", "<u2")])
    centers = source.uniform(-100, 100, (triangles, 1, 3))
    records["corners"] = centers + source.uniform(-0.3, 0.3, (triangles, 3, 3))
    path.write_bytes(bytes(80) + triangles.to_bytes(4, "little") + records.tobytes())


def alone(model: Path, out: Path, **settings) -> bytes:
    brickwalk.convert(model, out, **settings)
    return out.read_bytes()


@pytest.fixture(scope="module")
def made_alone(model, tmp_path_factory):
    """Gives the bytes of the model as one machine converts it with some settings, made once for each."""
    made = {}

    def of(**settings) -> bytes:
        key = tuple(sorted(settings.items()))
        if key not in made:
            made[key] = alone(model, tmp_path_factory.mktemp("alone") / "one.bricks", **settings)
        return made[key]

    return of


class Killer:
    """Kills workers at random moments while it is open; not so many that nothing gets done on a busy machine."""

    MOST = 8

    def __init__(self, client: Client, seed: int, mean: float = 1.5):
        self.client, self.random, self.mean, self.kills = client, random.Random(seed), mean, 0
        self.stop = threading.Event()
        self.thread = threading.Thread(target=self.work)
        print(f"seed {seed}")

    def work(self):
        while self.kills < self.MOST and not self.stop.wait(self.random.uniform(0.3, 2 * self.mean)):
            # Those that run: a nanny gives up a worker that is killed while it starts.
            processes = [nanny.process for nanny in self.client.cluster.workers.values()]
            running = [process for process in processes if process and process.status == Status.running]
            if running:
                try:
                    os.kill(self.random.choice(running).pid, signal.SIGKILL)
                    self.kills += 1
                except (ProcessLookupError, TypeError):
                    pass  # it is gone already

    def __enter__(self):
        self.thread.start()
        return self

    def __exit__(self, *_):
        self.stop.set()
        self.thread.join()


@pytest.mark.parametrize("settings", [{}, {"lod": True, **LITTLE}, {"proxies": False, **LITTLE}])
def test_the_bytes_are_those_of_one_machine(client, model, made_alone, tmp_path, settings):
    one = made_alone(**settings)
    out = tmp_path / "many.bricks"
    said = []

    def watch(done, total):
        said.append((done, total))

    summary = conversion.convert(client, model, out, progress=watch, **settings)
    assert out.read_bytes() == one
    assert sorted(path.name for path in tmp_path.iterdir()) == ["many.bricks"], "nothing else is left"
    assert summary["triangles"] == 700_000 and summary["phases"]["distribute"] > 0
    assert said and all(0 <= done <= total or total == 0 for done, total in said)
    # A byte more and it would not be the same: the comparison can fail.
    other = alone(model, tmp_path / "other.bricks", **{**settings, "brick_triangles": 1999})
    assert other != one


@pytest.mark.parametrize("lod", [False, True])
def test_killed_workers_change_nothing(client, model, made_alone, tmp_path, lod):
    one = made_alone(lod=lod, **LITTLE)
    out, kills, seed = tmp_path / "many.bricks", 0, 370 + lod
    for repeat in range(5):
        with Killer(client, seed + 10 * repeat) as killer:
            conversion.convert(client, model, out, lod=lod, resume=False, **LITTLE)
        kills += killer.kills
        assert out.read_bytes() == one
        if kills >= 3:
            break
    assert kills >= 3, "too few workers were killed for this to show anything"


def test_textures(client, tmp_path):
    scenes = os.environ.get("BRICKWALK_SCENES")
    found = sorted(Path(scenes).glob("sponza/**/*.gl*")) if scenes else []
    if not found:
        pytest.skip("there is no sponza in $BRICKWALK_SCENES")
    model = found[0]
    # Textures are the leader's work, and take long as BC7.
    one = alone(model, tmp_path / "one.bricks", lod=True, textures="raw")
    with Killer(client, 375):
        conversion.convert(client, model, tmp_path / "many.bricks", lod=True, textures="raw")
    assert (tmp_path / "many.bricks").read_bytes() == one


LEADER = """
    import sys
    from brickwalk_cluster import conversion
    from distributed import Client

    address, model, out = sys.argv[1:]
    conversion.convert(Client(address), model, out, lod=True, memory="90M", brick_triangles=4000)
"""


def wait_for(happened, seconds: float = 120) -> None:
    end = time.monotonic() + seconds
    while not happened():
        assert time.monotonic() < end, "it did not happen"
        time.sleep(0.01)


@pytest.mark.parametrize("until", ["items", "triangles", "encoded", "levels"])
def test_a_killed_leader_goes_on_where_it_was(client, model, made_alone, tmp_path, until):
    one = made_alone(lod=True, **LITTLE)
    out, scratch = tmp_path / "many.bricks", tmp_path / ".many.bricks.scratch"
    names = f"{until}-*[0-9]"
    script = textwrap.dedent(LEADER)
    leader = subprocess.Popen([sys.executable, "-c", script, client.scheduler.address, str(model), str(out)])
    try:
        wait_for(lambda: leader.poll() is not None or list(scratch.glob(names)))
    finally:
        leader.kill()
        leader.wait()
    assert not out.exists() and (scratch / "journal").exists()
    # Tasks of the killed leader end, or are taken back; what they leave is whole or does not count.
    journal = (scratch / "journal").stat().st_size
    before = {path.name: path.stat().st_mtime_ns for path in scratch.glob(names)}
    seen = {}

    def watch(done, total):
        for name in before:
            if name not in seen:
                try:
                    seen[name] = (scratch / name).stat().st_mtime_ns
                except FileNotFoundError:
                    pass

    assert journal > 16
    conversion.convert(client, model, out, lod=True, progress=watch, **LITTLE)
    assert out.read_bytes() == one
    assert all(before[name] == time for name, time in seen.items()), "what verifies is not made again"
    assert not scratch.exists()


def test_a_scheduler_that_dies_ends_a_conversion_that_goes_on_later(model, made_alone, tmp_path):
    one = made_alone(lod=False, **LITTLE)
    out, scratch = tmp_path / "many.bricks", tmp_path / ".many.bricks.scratch"
    line = ["convert", str(model), "-o", str(out), "--memory", "90M", "--brick-triangles", "4000"]
    with Elsewhere(tmp_path) as cluster:
        status, said = cluster.dies_during(line, lambda: list(scratch.glob("triangles-*[0-9]")))
        assert status == 1 and GONE in said and "Traceback" not in said, said
    assert not out.exists() and (scratch / "journal").exists()
    with Elsewhere(tmp_path) as cluster:
        assert command([*line, "--scheduler", cluster.address, "-q"]) == 0
    assert out.read_bytes() == one and not scratch.exists()


def test_damaged_outputs_are_made_again(client, model, made_alone, tmp_path):
    one = made_alone(lod=False, **LITTLE)
    out, scratch = tmp_path / "many.bricks", tmp_path / ".many.bricks.scratch"
    stop, damaged = threading.Event(), []

    def damage():
        """Changes a byte in the middle of one shard of triangles and of one encoded chunk, as soon as they appear."""
        for kind in ("triangles-*[0-9]", "encoded-*[0-9]"):
            while not stop.is_set():
                found = [path for path in scratch.glob(kind) if path.stat().st_size > 10_000]
                if found:
                    try:
                        with found[-1].open("r+b") as file:
                            file.seek(5000)
                            byte = file.read(1)[0]
                            file.seek(5000)
                            file.write(bytes([byte ^ 1]))
                        damaged.append(found[-1].name)
                        break
                    except FileNotFoundError:
                        pass
                time.sleep(0.002)

    thread = threading.Thread(target=damage)
    thread.start()
    try:
        conversion.convert(client, model, out, **LITTLE)
    finally:
        stop.set()
        thread.join()
    assert len(damaged) == 2, damaged
    assert out.read_bytes() == one


def test_models_may_name_files_of_a_folder_around_them(client, tmp_path, monkeypatch):
    (tmp_path / "models").mkdir()
    model = tmp_path / "models" / "box.obj"
    model.write_text("mtllib ../paint.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl paint\nf 1 2 3\n")
    (tmp_path / "paint.mtl").write_text("newmtl paint\nKd 1 0 0\n")
    # Relative to this process, not to the workers.
    monkeypatch.chdir(tmp_path)
    done = conversion.convert(client, "models/box.obj", "box.bricks", within=".")
    assert done["warnings"] == []
    assert (tmp_path / "box.bricks").read_bytes() == alone(model, tmp_path / "one.bricks", within=tmp_path)


def test_what_cannot_be_used_is_an_error(client, model, tmp_path):
    out = tmp_path / "a.bricks"
    with pytest.raises(FileNotFoundError):
        conversion.convert(client, tmp_path / "none.glb", out)
    with pytest.raises(FileNotFoundError):
        conversion.convert(client, model, out, scratch=tmp_path / "none")
    with pytest.raises(TypeError, match="no such setting"):
        conversion.convert(client, model, out, speed=3)
    with pytest.raises(ValueError, match="memory"):
        conversion.convert(client, model, out, memory="1M")
    broken = tmp_path / "broken.stl"
    broken.write_bytes(model.read_bytes()[:100] + b"\xff" * 50 + model.read_bytes()[150:])
    with pytest.raises(brickwalk.BrickwalkError, match="not finite"):
        conversion.convert(client, broken, out)
    assert not out.exists()
    conversion.convert(client, broken, out, drop_non_finite=True, resume=False)
    assert out.read_bytes() == alone(broken, tmp_path / "one.bricks", drop_non_finite=True)

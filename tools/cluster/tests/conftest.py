import faulthandler
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import pytest

import brickwalk

# A call that never returns is told with its stacks.
faulthandler.dump_traceback_later(1500, exit=True)


@pytest.fixture(scope="session")
def program():
    found = shutil.which(os.environ.get("BRICKWALK") or "brickwalk")
    assert found, "the tests need the program brickwalk: set BRICKWALK, or put it on the path"
    os.environ["BRICKWALK"] = os.path.abspath(found)
    return os.environ["BRICKWALK"]


@pytest.fixture(scope="session")
def city(tmp_path_factory):
    """A generated city that is no larger than it must be."""
    path = tmp_path_factory.mktemp("city") / "city.bricks"
    brickwalk.generate("city", path, triangles=20_000)
    return path


@pytest.fixture(scope="session")
def run(program):
    """Runs the program ``brickwalk``."""

    def run(*words):
        done = subprocess.run([program, "-q", *map(str, words)], stderr=subprocess.PIPE)
        assert done.returncode == 0, done.stderr.decode()

    return run


class Elsewhere:
    """A scheduler of Dask and two workers as processes of their own; ``address`` is the scheduler's."""

    def __init__(self, folder):
        file = folder / f"scheduler-{time.monotonic_ns()}.json"
        dask = [sys.executable, "-m"]
        own = ["--scheduler-file", str(file), "--no-dashboard"]
        words = [*dask, "distributed.cli.dask_scheduler", "--port", "0", *own]
        self.scheduler = subprocess.Popen(words, stderr=subprocess.DEVNULL)
        words = [*dask, "distributed.cli.dask_worker", *own, "--nworkers", "2", "--nthreads", "1"]
        words += ["--memory-limit", "0", "--death-timeout", "20"]
        self._workers = subprocess.Popen(words, stderr=subprocess.DEVNULL, start_new_session=True)
        deadline = time.monotonic() + 60
        while not file.exists() or not file.read_text().strip():
            assert time.monotonic() < deadline and self.scheduler.poll() is None
            time.sleep(0.05)
        self.address = json.loads(file.read_text())["address"]

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.scheduler.kill()
        self.scheduler.wait()
        try:
            os.killpg(self._workers.pid, signal.SIGKILL)
        except ProcessLookupError:
            pass
        self._workers.wait()

    def dies_during(self, line, when):
        """Runs the command ``line`` and kills the scheduler once ``when()``; returns exit status and what was said."""
        line = [sys.executable, "-m", "brickwalk_cluster.command", *line, "--scheduler", self.address]
        process = subprocess.Popen(line, stderr=subprocess.PIPE, text=True)
        deadline = time.monotonic() + 120
        while not when():
            assert process.poll() is None and time.monotonic() < deadline
            time.sleep(0.02)
        self.scheduler.kill()
        _, said = process.communicate(timeout=120)
        return process.returncode, said


def frames(output):
    """The pictures of a walk, by their names."""
    return {path.name: path.read_bytes() for path in sorted((output / "frames").iterdir())}

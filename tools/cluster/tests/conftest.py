import faulthandler
import os
import shutil
import subprocess

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


def frames(output):
    """The pictures of a walk, by their names."""
    return {path.name: path.read_bytes() for path in sorted((output / "frames").iterdir())}

import faulthandler

import pytest

import brickwalk
import meshes

# A call that never returns is told with its stacks.
faulthandler.dump_traceback_later(300, exit=True)


@pytest.fixture(scope="session")
def soup():
    return meshes.soup(400)


@pytest.fixture(scope="session")
def scene(soup):
    # Small bricks, so that rays pass many.
    with brickwalk.Scene.from_arrays(*soup, adapter="cpu", brick_triangles=32) as scene:
        yield scene


@pytest.fixture(scope="session")
def box():
    with brickwalk.Scene.from_arrays(*meshes.box(), adapter="cpu") as scene:
        yield scene

"""Threads, processes, pickles, and Ctrl-C."""

import copy
import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import threading
import time
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import brickwalk
import meshes

RAY = [[0.25, 0.5, 3.0, 0.0, 0.0, -1.0]]


def test_threads_share_a_scene(scene):
    batches = [meshes.random_rays(300, seed=100 + i) for i in range(8)]
    expected = [scene.cast_rays(rays) for rays in batches]
    with ThreadPoolExecutor(8) as pool:
        for _ in range(3):
            for hits, truth in zip(pool.map(scene.cast_rays, batches), expected, strict=True):
                np.testing.assert_array_equal(hits["t"], truth["t"])
                np.testing.assert_array_equal(hits["triangle"], truth["triangle"])


def test_pythons_lock_is_free_meanwhile(scene):
    rays = meshes.random_rays(150_000, seed=3)
    steps, done = [], threading.Event()

    def count():
        while not done.is_set():
            steps.append(time.monotonic())
            time.sleep(0.002)

    counter = threading.Thread(target=count)
    counter.start()
    start = time.monotonic()
    scene.cast_rays(rays)
    seconds = time.monotonic() - start
    done.set()
    counter.join()
    assert len(steps) > 20 * seconds, f"{len(steps)} steps in {seconds} s"


def test_closing_while_others_work():
    scene = brickwalk.Scene.from_arrays(*meshes.soup(300), adapter="cpu")
    rays, outcomes = meshes.random_rays(5000), []

    def work():
        for _ in range(20):
            try:
                outcomes.append(scene.cast_rays(rays)["t"].shape)
            except ValueError as error:
                outcomes.append(str(error))

    threads = [threading.Thread(target=work) for _ in range(3)]
    for thread in threads:
        thread.start()
    time.sleep(0.2)
    scene.close()
    for thread in threads:
        thread.join()
    assert set(outcomes) <= {(5000,), "the scene is closed"}


def test_pickles_by_path(box):
    again = pickle.loads(pickle.dumps(box))
    assert again.info["path"] == box.info["path"]
    np.testing.assert_array_equal(again.cast_rays(RAY)["t"], [2.0])
    again.close()
    other = copy.deepcopy(box)
    other.close()
    assert os.path.exists(box.info["path"]), "what was pickled does not remove the file"


def cast(scene):
    return float(scene.cast_rays(RAY)["t"][0])


@pytest.mark.parametrize("how", ["spawn", "fork"])
@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_processes(box, how):
    assert cast(box) == 2.0
    with multiprocessing.get_context(how).Pool(2) as pool:
        assert pool.map_async(cast, [box] * 4).get(60) == [2.0] * 4


@pytest.mark.filterwarnings("ignore:This process .* is multi-threaded:DeprecationWarning")
def test_a_forked_process_uses_what_it_was_given(box):
    assert cast(box) == 2.0
    child = os.fork()
    if child == 0:
        status = 1
        try:
            status = 0 if cast(box) == 2.0 and cast(box) == 2.0 else 2
        finally:
            os._exit(status)
    deadline = time.monotonic() + 30
    while (found := os.waitpid(child, os.WNOHANG)) == (0, 0):
        assert time.monotonic() < deadline, "the forked process hangs"
        time.sleep(0.01)
    assert os.waitstatus_to_exitcode(found[1]) == 0
    assert cast(box) == 2.0


def interrupted(call, after):
    """How long `call` takes to end by Ctrl-C that comes after so many seconds."""

    def handler(*_):
        interrupted.at = time.monotonic()
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, handler)
    try:
        signal.setitimer(signal.ITIMER_REAL, after)
        with pytest.raises(KeyboardInterrupt):
            call()
        return time.monotonic() - interrupted.at
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_ctrl_c_ends_rays(scene):
    rays = meshes.random_rays(20_000, seed=6)
    many = np.broadcast_to(rays[:, None], (20_000, 1000, 6))[:, :400].reshape(-1, 6)
    expected = scene.cast_rays(rays)
    assert interrupted(lambda: scene.cast_rays(many), 0.3) < 1.0
    # And the scene is as it was.
    np.testing.assert_array_equal(scene.cast_rays(rays)["t"], expected["t"])


def test_ctrl_c_ends_queries(scene):
    points = np.random.default_rng(0).uniform(-8, 8, (3_000_000, 3))
    assert interrupted(lambda: scene.distance(points), 0.3) < 1.0
    assert scene.distance(points[:10]).shape == (10,)


def test_ctrl_c_ends_pictures(box):
    assert interrupted(lambda: box.render(size="640x480", spp=1000, effects="path"), 0.5) < 1.0
    assert box.cast_rays(RAY)["t"] == 2.0
    assert box.render(size="16x16", spp=1)["picture"].shape == (16, 16, 3)


def test_ctrl_c_ends_conversions(tmp_path):
    # Fast machines convert some 200,000 triangles before the signal comes.
    vertices, faces = meshes.soup(1_500_000)
    before = set(os.listdir(os.environ.get("TMPDIR", "/tmp")))
    assert interrupted(lambda: brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu"), 0.15) < 1.0
    time.sleep(1.5)
    left = set(os.listdir(os.environ.get("TMPDIR", "/tmp"))) - before
    assert not [name for name in left if name.startswith("brickwalk-")]


def test_temporary_files_go_with_the_process(tmp_path):
    program = (
        "import brickwalk, numpy\n"
        "scene = brickwalk.Scene.from_arrays(numpy.eye(3), [[0, 1, 2]], adapter='cpu')\n"
        "print(scene.info['path'], scene.cast_rays([[1, 1, 1, -1, -1, -1.0]])['triangle'][0])\n"
    )
    told = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60)
    assert told.returncode == 0 and told.stderr == "", told.stderr
    path, triangle = told.stdout.split()
    assert triangle == "0" and not os.path.exists(os.path.dirname(path))

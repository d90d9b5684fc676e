"""What is wrong is said by an exception that names it. Nothing panics."""

import pathlib
import pickle

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as arrays

import brickwalk
import meshes

QUICK = settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture]
)
ALLOWED = (TypeError, ValueError, OSError, brickwalk.BrickwalkError)


@pytest.mark.parametrize(
    "rays, error, text",
    [
        (np.zeros((4, 5)), ValueError, r"\(\.\.\., 6\) or \(\.\.\., 8\).*\(4, 5\)"),
        (np.zeros(()), ValueError, "shape"),
        (np.zeros((4, 6), np.float16), TypeError, "float16"),
        (np.zeros((4, 6), np.complex128), TypeError, "complex128"),
        (np.zeros((4, 6), int), TypeError, "int"),
        (np.zeros((4, 6), bool), TypeError, "bool"),
        (np.zeros((4, 6), object), TypeError, "object"),
        (np.ma.zeros((4, 6)), TypeError, "masked"),
        ("rays", TypeError, "rays"),
        (None, TypeError, "rays"),
        ([[1, 2, 3], [1, 2]], TypeError, "rays"),
        ([[0, 0, 0, 0, 0, 1], [0, 0, 0, 0, 0, 0.0]], ValueError, "ray 1: the direction has no length"),
        ([[0, 0, float("nan"), 0, 0, 1]], ValueError, "ray 0: .*finite"),
        ([[0, 0, 0, 0, float("inf"), 1]], ValueError, "ray 0: .*finite"),
        ([[0, 0, 0, 0, 0, 1, -0.5, 1]], ValueError, "ray 0: t_min is -0.5"),
        ([[0, 0, 0, 0, 0, 1, 0, float("nan")]], ValueError, "ray 0: t_min and t_max"),
        ([0, 0, 0, 0, 0, 0.0], ValueError, "the ray: "),
    ],
)
def test_rays(scene, rays, error, text):
    for call in (scene.cast_rays, scene.test_occlusions):
        with pytest.raises(error, match=text):
            call(rays)


def test_a_ray_is_named_by_its_indices(scene):
    rays = np.tile([0, 0, 9, 0, 0, -1.0], (3, 4, 5, 1))
    rays[2, 1, 3, 0] = np.inf
    with pytest.raises(ValueError, match=r"ray \(2, 1, 3\)"):
        scene.cast_rays(rays)


@pytest.mark.parametrize(
    "vertices, faces, error, text",
    [
        (np.zeros((3, 2)), [[0, 1, 2]], ValueError, r"\(3, 2\)"),
        (np.zeros((2, 3, 3)), [[0, 1, 2]], ValueError, r"\(n, 3\)"),
        (np.zeros((3, 3), int), [[0, 1, 2]], TypeError, "int"),
        (np.zeros((3, 3)), [[0, 1, 3]], ValueError, "face 0 names vertex 3; there are 3"),
        (np.zeros((3, 3)), [[0, 1, 2], [0, -1, 2]], ValueError, "face 1 names vertex -1"),
        (np.zeros((3, 3)), np.array([[0, 1, 2**64 - 1]], np.uint64), ValueError, "face 0"),
        (np.zeros((3, 3)), [[0, 1]], ValueError, r"\(1, 2\)"),
        (np.zeros((3, 3)), [[0, 1, 2.0]], TypeError, "float64"),
        (np.float64([[0, 0, 0], [1, 0, 0], [0, np.nan, 0]]), [[0, 1, 2]], ValueError, "vertex 2: .*finite"),
        (np.float64([[0, 0, 0], [1e300, 0, 0], [0, 1, 0]]), [[0, 1, 2]], brickwalk.BrickwalkError, "vertex 1"),
    ],
)
def test_meshes(vertices, faces, error, text):
    with pytest.raises(error, match=text):
        brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu")


@pytest.mark.parametrize(
    "options, error, text",
    [
        ({"cache": "much"}, ValueError, "cache"),
        ({"cache": "0"}, ValueError, "cache"),
        ({"cache": -1}, ValueError, "cache"),
        ({"cache": "120%"}, ValueError, "cache"),
        ({"cache": 2.5}, TypeError, "cache"),
        ({"cache": None}, TypeError, "cache"),
        ({"adapter": 3}, TypeError, "adapter"),
        ({"brick_triangles": 0}, ValueError, "brick"),
    ],
)
def test_options(options, error, text):
    with pytest.raises(error, match=text):
        brickwalk.Scene.from_arrays(*meshes.box(), **options)


def test_an_adapter_that_there_is_not():
    with brickwalk.Scene.from_arrays(*meshes.box(), adapter="no such device") as scene:
        assert scene.info["triangles"] == 12
        for _ in range(2):
            with pytest.raises(brickwalk.BrickwalkError, match="no such device"):
                scene.render(size=(16, 16))
        # Which rays do not need.
        assert scene.test_occlusions([[0.5, 0.25, 9, 0, 0, -1.0]])


def test_a_cache_too_small_for_a_brick():
    with brickwalk.Scene.from_arrays(*meshes.soup(2000), cache=16, adapter="cpu") as scene:
        with pytest.raises(brickwalk.BrickwalkError, match="too small"):
            scene.render(size=(16, 16))
        # Queries take what they need of it.
        assert not scene.test_occlusions([[900.0, 0, 9, 0, 0, -1.0]])


def test_files(tmp_path, box):
    with pytest.raises(FileNotFoundError) as caught:
        brickwalk.Scene.open(tmp_path / "none.bricks")
    assert caught.value.filename == str(tmp_path / "none.bricks")
    with pytest.raises(IsADirectoryError):
        brickwalk.Scene.open(tmp_path)
    (tmp_path / "text.bricks").write_text("no scene")
    with pytest.raises(brickwalk.BrickwalkError, match="text.bricks"):
        brickwalk.Scene.open(tmp_path / "text.bricks")
    (tmp_path / "model.glb").write_text("")
    with pytest.raises(ValueError, match="brickwalk.convert"):
        brickwalk.Scene.open(tmp_path / "model.glb")
    assert issubclass(brickwalk.BrickwalkError, RuntimeError)


def test_damaged_files(tmp_path, box):
    good = pathlib.Path(box.info["path"]).read_bytes()
    rng = np.random.default_rng(0)
    refused = 0
    for _ in range(60):
        bytes_ = bytearray(good)
        bytes_[rng.integers(len(good))] ^= 1 << int(rng.integers(8))
        (tmp_path / "bad.bricks").write_bytes(bytes_)
        try:
            with brickwalk.Scene.open(tmp_path / "bad.bricks", adapter="cpu") as scene:
                scene.cast_rays([[0.25, 0.5, 3.0, 0.0, 0.0, -1.0]])
        except brickwalk.BrickwalkError as error:
            refused += "bad.bricks" in str(error)
    assert refused > 10
    (tmp_path / "bad.bricks").write_bytes(good[: len(good) // 2])
    with pytest.raises(brickwalk.BrickwalkError, match="bad.bricks"):
        brickwalk.Scene.open(tmp_path / "bad.bricks")


def test_a_closed_scene():
    scene = brickwalk.Scene.from_arrays(*meshes.box(), adapter="cpu")
    path = scene.info["path"]
    pickled = pickle.dumps(scene)
    scene.close()
    scene.close()
    assert scene.closed and "closed" in repr(scene)
    for call in (
        lambda: scene.cast_rays([[0, 0, 9, 0, 0, -1.0]]),
        lambda: scene.test_occlusions([[0, 0, 9, 0, 0, -1.0]]),
        lambda: scene.count_intersections([[0, 0, 9, 0, 0, -1.0]]),
        lambda: scene.list_intersections([[0, 0, 9, 0, 0, -1.0]]),
        lambda: scene.closest_points([[0, 0, 9.0]]),
        lambda: scene.visibility([0, 0, 9.0], [0, 0, 8.0]),
        lambda: scene.render(size="8x8"),
        lambda: scene.info,
        lambda: scene.stats(),
        lambda: scene.__enter__(),
    ):
        with pytest.raises(ValueError, match="closed"):
            call()
    with pytest.raises(FileNotFoundError, match="arrays.bricks"):
        pickle.loads(pickled)
    assert not pathlib.Path(path).exists()


anything = st.one_of(
    st.none(),
    st.text(max_size=5),
    st.floats(),
    st.lists(st.lists(st.floats(), max_size=9), max_size=4),
    arrays.arrays(
        dtype=st.one_of(
            arrays.floating_dtypes(), arrays.integer_dtypes(), arrays.boolean_dtypes(), arrays.complex_number_dtypes()
        ),
        shape=arrays.array_shapes(min_dims=0, max_dims=4, min_side=0, max_side=9),
    ),
)
numbers = st.one_of(
    st.floats(width=32), st.sampled_from([0.0, -0.0, 1.0, 5e-324, 1e-310, 1e308, -1e308, 3e38, np.inf, -np.inf, np.nan])
)
some_rays = st.one_of(
    arrays.arrays(np.float64, st.tuples(st.integers(0, 5), st.sampled_from([6, 8])), elements=numbers),
    arrays.arrays(np.float32, st.tuples(st.integers(0, 5), st.sampled_from([6, 8])), elements=st.floats(width=32)),
)


@QUICK
@given(anything)
def test_anything_for_rays(box, given_rays):
    try:
        hits = box.cast_rays(given_rays)
    except ALLOWED:
        return
    assert not np.isnan(hits["t"]).any()


@QUICK
@given(some_rays)
def test_any_numbers_for_rays(box, given_rays):
    try:
        hits = box.cast_rays(given_rays)
        hit = box.test_occlusions(given_rays)
    except ValueError as error:
        assert "ray " in str(error)
        return
    assert (hit == np.isfinite(hits["t"])).all()
    assert (hits["t"] >= 0).all()


@settings(parent=QUICK, max_examples=40)
@given(
    st.one_of(anything, arrays.arrays(np.float64, (4, 3), elements=numbers)),
    st.one_of(anything, arrays.arrays(np.int64, (2, 3), elements=st.integers(-1, 4))),
)
def test_anything_for_meshes(vertices, faces):
    try:
        scene = brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu")
    except ALLOWED:
        return
    scene.close()


@settings(parent=QUICK, max_examples=40)
@given(
    st.dictionaries(
        st.text(max_size=6),
        st.one_of(
            st.none(),
            st.booleans(),
            st.floats(),
            st.integers(),
            st.text(max_size=6),
            st.lists(st.integers(), max_size=3),
        ),
        min_size=1,
        max_size=3,
    )
)
def test_anything_for_settings(box, chosen):
    with pytest.raises(ALLOWED):
        box.render(**{"size": "no size", **chosen})

"""Shapes, dtypes, strides, and where results go."""

import numpy as np
import pytest

import brickwalk
import meshes

KINDS = {"t": np.float64, "triangle": np.uint32, "uv": np.float32, "normal": np.float32}
TAILS = {"t": (), "triangle": (), "uv": (2,), "normal": (3,)}


@pytest.fixture(scope="module")
def rays():
    return meshes.random_rays(120, seed=7)


@pytest.fixture(scope="module")
def expected(scene, rays):
    return scene.cast_rays(rays)


def same(hits, expected, shape=(120,)):
    for name, kind in KINDS.items():
        assert hits[name].dtype == kind and hits[name].shape == (*shape, *TAILS[name]), name
        np.testing.assert_array_equal(hits[name], expected[name].reshape(hits[name].shape))


@pytest.mark.parametrize("shape", [(120,), (10, 12), (2, 3, 4, 5), (120, 1), (1, 120)])
def test_any_leading_shape(scene, rays, expected, shape):
    same(scene.cast_rays(rays.reshape(*shape, 6)), expected, shape)
    assert scene.test_occlusions(rays.reshape(*shape, 6)).shape == shape


@pytest.mark.parametrize("shape", [(0,), (3, 0), (0, 3)])
def test_no_rays(scene, shape):
    hits = scene.cast_rays(np.zeros((*shape, 6)))
    assert {name: hits[name].shape for name in hits} == {name: (*shape, *TAILS[name]) for name in TAILS}


def test_one_ray(scene, rays, expected):
    hits = scene.cast_rays(rays[3])
    assert hits["t"].shape == () and hits["uv"].shape == (2,)
    assert hits["t"] == expected["t"][3]


@pytest.mark.parametrize(
    "given",
    [
        lambda r: np.asfortranarray(r),
        lambda r: r[::-1][::-1],
        lambda r: np.repeat(r, 2, axis=0)[::2],
        lambda r: np.repeat(r, 3, axis=1)[:, ::3],
        lambda r: r[:, ::-1].copy()[:, ::-1],
        lambda r: r.astype(">f8"),
        lambda r: np.frombuffer(b"x" + r.tobytes(), np.uint8)[1:].view(np.float64).reshape(r.shape),
        lambda r: np.moveaxis(np.moveaxis(r.reshape(10, 12, 6), -1, 0).copy(), 0, -1).reshape(120, 6),
    ],
    ids=[
        "fortran",
        "turned",
        "every other row",
        "every third column",
        "columns turned",
        "big endian",
        "unaligned",
        "moved",
    ],
)
def test_any_strides(scene, rays, expected, given):
    same(scene.cast_rays(given(rays)), expected)


def test_broadcast_origins(scene, rays):
    origin = np.broadcast_to(np.float64([0, 0, 9]), (120, 3))
    given = np.concatenate([origin, rays[:, 3:]], axis=1)
    same(scene.cast_rays(given), scene.cast_rays(given.copy()))
    one = np.broadcast_to(rays[5], (120, 6))
    assert (scene.cast_rays(one)["t"] == scene.cast_rays(rays[5])["t"]).all()


def test_float32_is_the_same_numbers(scene, rays):
    single = rays.astype(np.float32)
    same(scene.cast_rays(single), scene.cast_rays(single.astype(np.float64)))


def test_lists_interfaces_and_dlpack(scene, rays, expected):
    class Interface:
        def __init__(self, array):
            self.array = array
            self.__array_interface__ = array.__array_interface__

    class Dlpack:
        def __init__(self, array):
            self.array = array

        def __dlpack__(self, **how):
            return self.array.__dlpack__(**how)

        def __dlpack_device__(self):
            return self.array.__dlpack_device__()

    for given in (rays.tolist(), Interface(rays), Dlpack(rays.copy())):
        same(scene.cast_rays(given), expected)
    hits = scene.cast_rays([[0, 0, 9, 0, 0, -1]])
    assert hits["t"].shape == (1,)


def test_memory_maps(scene, rays, expected, tmp_path):
    np.save(tmp_path / "rays.npy", rays)
    mapped = np.load(tmp_path / "rays.npy", mmap_mode="r")
    t = np.lib.format.open_memmap(tmp_path / "t.npy", "w+", np.float64, (120,))
    hits = scene.cast_rays(mapped, out={"t": t})
    assert hits["t"] is t
    t.flush()
    np.testing.assert_array_equal(np.load(tmp_path / "t.npy"), expected["t"])


def test_out_is_filled(scene, rays, expected):
    out = {name: np.full((10, 12, *TAILS[name]), 7, kind) for name, kind in KINDS.items()}
    hits = scene.cast_rays(rays.reshape(10, 12, 6), out=out)
    assert all(hits[name] is out[name] for name in KINDS)
    same(hits, expected, (10, 12))
    # Arrays that are not of one piece, and only some of them.
    wide = np.full((240, 3), 7, np.float32)
    turned = np.full((2, 120), 7, np.float32)
    hits = scene.cast_rays(rays, out={"normal": wide[::2], "uv": turned.T})
    np.testing.assert_array_equal(wide[::2], expected["normal"])
    assert (wide[1::2] == 7).all()
    np.testing.assert_array_equal(turned.T, expected["uv"])
    same(hits, expected)
    hit = np.zeros(120, bool)
    assert scene.test_occlusions(rays, out=hit) is hit and hit.any()
    assert set(scene.cast_rays(rays, any=True)) == {"hit"}


def test_out_that_does_not_fit(scene, rays):
    read_only = np.zeros(120)
    read_only.flags.writeable = False
    for out, error, text in [
        ({"t": np.zeros(120, np.float32)}, TypeError, "float64"),
        ({"t": np.zeros(119)}, ValueError, r"\(120,\)"),
        ({"uv": np.zeros((120, 3), np.float32)}, ValueError, r"\(120, 2\)"),
        ({"t": [0.0] * 120}, TypeError, "array"),
        ({"depth": np.zeros(120)}, ValueError, "depth"),
        ({"t": read_only}, ValueError, "read-only"),
        (np.zeros(120), TypeError, "dict"),
    ]:
        with pytest.raises(error, match=text):
            scene.cast_rays(rays, out=out)


def test_nothing_is_written_when_a_ray_is_bad(scene, rays):
    t = np.full(120, 7.0)
    bad = rays.copy()
    bad[119, 2] = np.nan
    with pytest.raises(ValueError, match="ray 119"):
        scene.cast_rays(bad, out={"t": t})
    assert (t == 7).all()


def test_vertices_of_any_kind():
    vertices, faces = meshes.box()
    ray = [0.25, 0.5, 3.0, 0.0, 0.0, -1.0]
    for v, f in [
        (vertices.astype(np.float32), faces.astype(np.uint32)),
        (vertices.tolist(), faces.tolist()),
        (np.asfortranarray(vertices), faces.astype(np.uint64)),
        (vertices[::-1], 7 - faces.astype(np.int16)),
    ]:
        with brickwalk.Scene.from_arrays(v, f, adapter="cpu") as scene:
            assert scene.cast_rays(ray)["t"] == 2.0


def test_progress_is_told(scene, rays):
    told = []
    scene.cast_rays(rays, progress=lambda *so_far: told.append(so_far))
    assert told[-1] == (120, 120)

    def fails(done, total):
        raise KeyError("no more")

    with pytest.raises(KeyError, match="no more"):
        scene.cast_rays(rays, progress=fails)
    assert scene.cast_rays(rays)["t"].shape == (120,)


def test_batches_beside_each_other_change_nothing(scene):
    rays, told = meshes.random_rays(200_000, seed=9), []
    together = scene.cast_rays(rays, progress=lambda done, total: told.append((done, total)))
    assert told == sorted(told) and len(told) > 2 and told[-1] == (200_000, 200_000)
    apart = [scene.cast_rays(rays[first : first + 33_333]) for first in range(0, 200_000, 33_333)]
    for name in KINDS:
        np.testing.assert_array_equal(together[name], np.concatenate([part[name] for part in apart]))

    def fails(done, total):
        if done > 65_536:
            raise KeyError("no more")

    with pytest.raises(KeyError, match="no more"):
        scene.cast_rays(rays, progress=fails)
    np.testing.assert_array_equal(scene.cast_rays(rays)["t"], together["t"])
    # Nothing is written where one of the last is bad.
    out = {"t": np.full(200_000, 7.0)}
    rays[199_999, 3:] = 0
    with pytest.raises(ValueError, match="ray 199999: the direction has no length"):
        scene.cast_rays(rays, out=out)
    assert (out["t"] == 7).all()

"""Rendered pictures."""

import zlib

import numpy as np
import pytest

import brickwalk
import meshes

SIZE = {"size": (48, 32), "spp": 1}
CAMERA = brickwalk.Camera((0.4, 0.6, 4.0), (0.5, 0.5, 0.5), fov=30)


def test_arrays_of_a_picture(box):
    picture = box.render(CAMERA, **SIZE)
    shapes = {name: (array.dtype, array.shape) for name, array in picture.items()}
    assert shapes == {
        "radiance": (np.float32, (32, 48, 3)),
        "depth": (np.float32, (32, 48)),
        "normal": (np.float32, (32, 48, 3)),
        "triangle": (np.uint32, (32, 48)),
        "albedo": (np.float32, (32, 48, 3)),
        "picture": (np.uint8, (32, 48, 3)),
    }
    assert isinstance(picture, dict) and np.isfinite(picture["radiance"]).all()


def test_pictures_see_what_rays_hit(box):
    picture = box.render(CAMERA, **SIZE)
    rays = brickwalk.pinhole(CAMERA, 48, 32)
    hits = box.cast_rays(rays)
    length = np.linalg.norm(rays[..., 3:], axis=-1)
    # Pixels whose rays pass an edge may differ.
    same = picture["triangle"] == hits["triangle"]
    assert same.mean() > 0.99 and 0.1 < np.isfinite(picture["depth"]).mean() < 0.9
    hit = same & np.isfinite(hits["t"])
    np.testing.assert_allclose(picture["depth"][hit], (hits["t"] * length)[hit], rtol=1e-5)
    np.testing.assert_allclose(picture["normal"][hit], hits["normal"][hit], atol=1e-6)
    turned = brickwalk.pinhole(brickwalk.Camera((0.4, 0.6, 4.0), (0.5, 0.5, 0.5), fov=60), 48, 32)
    assert (box.cast_rays(turned)["triangle"] == picture["triangle"]).mean() < 0.95, "the control: another view"


def test_the_same_call_gives_the_same_picture(box):
    first = box.render(CAMERA, **SIZE, seed=3)
    box.render(None, size="32x16", spp=2)
    again = box.render({"position": (0.4, 0.6, 4.0), "target": (0.5, 0.5, 0.5), "fov": 30}, **SIZE, seed=3)
    for name in first:
        np.testing.assert_array_equal(first[name], again[name])
    narrow, wide = (box.render(**SIZE, fov=fov)["depth"] for fov in (20, 80))
    assert np.isfinite(narrow).sum() > np.isfinite(wide).sum()
    other = box.render(CAMERA, **SIZE, seed=3, sun=(-1, 0.2, 0.3))
    assert (other["radiance"] != first["radiance"]).any()


def test_notebooks_show_it(box):
    picture = box.render(CAMERA, **SIZE)
    data = picture._repr_png_()
    assert data.startswith(b"\x89PNG\r\n\x1a\n")
    start = data.index(b"IDAT") + 4
    rows = np.frombuffer(zlib.decompress(data[start:]), np.uint8).reshape(32, 1 + 3 * 48)
    np.testing.assert_array_equal(rows[:, 1:].reshape(32, 48, 3), picture["picture"])


def test_settings_by_name(box):
    assert set(box.render(CAMERA, **SIZE, taa=True)) == {"radiance", "picture"}
    told = []
    box.render(CAMERA, **SIZE, effects="path", bounces=2, exposure=1.0, progress=lambda *so_far: told.append(so_far))
    for wrong, text in [
        ({"sizes": "8x8"}, "sizes"),
        ({"size": "8"}, "size"),
        ({"spp": 0}, "spp"),
        ({"effects": "magic"}, "effects"),
        ({"frames": 3}, "frames"),
        ({"fov": 50}, "fov"),
        ({"secondary": "auto"}, "auto"),
        ({"roma": {"no": 3}}, "no"),
        ({"secondary": "roma", "lod": 1.0, "clip": "0,0,0,0,1,0"}, "exclude"),
    ]:
        with pytest.raises(ValueError, match=text):
            box.render(CAMERA, **{**SIZE, **wrong})
    with pytest.raises(TypeError, match="spp"):
        box.render(CAMERA, spp=object())
    with pytest.raises(TypeError, match="camera"):
        box.render(7)
    assert box.render(CAMERA, **SIZE)["picture"].shape == (32, 48, 3)


def test_rays_and_pictures_take_turns():
    with brickwalk.Scene.from_arrays(*meshes.soup(500), adapter="cpu", brick_triangles=64, cache="30%") as scene:
        rays = meshes.random_rays(500)
        before = scene.cast_rays(rays)
        scene.render(**SIZE)
        np.testing.assert_array_equal(scene.cast_rays(rays)["t"], before["t"])
        assert scene.stats()["pictures"] == 1

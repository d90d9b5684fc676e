"""Hits against brute force in float64, and closed forms. Each has a control that fails."""

import numpy as np
import pytest

import brickwalk
import meshes


def agree(hits, truth, rays, vertices, faces):
    """Which certain rays have the hit of the truth."""
    t, triangle, uv, certain = truth
    found = np.where(hits["triangle"] == brickwalk.INVALID_ID, -1, hits["triangle"].astype(np.int64))
    same = (found == triangle) & certain
    with np.errstate(invalid="ignore"):
        same &= np.isclose(hits["t"], t, rtol=1e-9, atol=1e-9)
    same &= np.abs(hits["uv"] - uv).max(1) < 1e-4
    normal = np.where((triangle < 0)[:, None], 0, meshes.normals(vertices, faces)[triangle])
    return same & (np.abs(hits["normal"] - normal).max(1) < 1e-6)


@pytest.mark.parametrize("columns", [6, 8])
@pytest.mark.parametrize("dtype", [np.float32, np.float64])
def test_closest_hits_are_those_of_brute_force(scene, soup, columns, dtype):
    rays = meshes.random_rays(3000, seed=columns).astype(dtype)
    if columns == 8:
        rng = np.random.default_rng(2)
        rays = np.hstack([rays, rng.uniform(0, 1, (len(rays), 1)), rng.uniform(0.5, 2, (len(rays), 1))]).astype(dtype)
    truth = meshes.brute_force(rays, *soup)
    certain = truth[3]
    assert certain.mean() > 0.95
    hits = scene.cast_rays(rays)
    same = agree(hits, truth, rays, *soup)
    assert same[certain].all(), f"{(certain & ~same).sum()} rays of {certain.sum()} hit something else"
    assert (truth[1] >= 0).sum() > 500 and (truth[1] < 0).sum() > 500
    # The control: rays that are moved a little hit something else.
    moved = rays.copy()
    moved[:, :3] += 0.05
    assert agree(scene.cast_rays(moved), truth, rays, *soup)[certain & (truth[1] >= 0)].mean() < 0.1


def test_occlusion_is_whether_there_is_a_hit(scene, soup):
    rays = meshes.random_rays(3000, seed=5)
    bounded = np.hstack([rays, np.zeros((3000, 1)), np.full((3000, 1), 0.5)])
    for given in (rays, bounded):
        _, triangle, _, certain = meshes.brute_force(given, *soup)
        hit = scene.test_occlusions(given)
        assert hit.dtype == np.bool_ and hit.shape == (3000,)
        assert (hit == (triangle >= 0))[certain].all()
        assert 0.1 < hit.mean() < 0.9
    # The control: with an end more rays go free.
    assert scene.test_occlusions(bounded).sum() < scene.test_occlusions(rays).sum()


def test_a_small_cache_finds_the_same(soup, tmp_path):
    rays = meshes.random_rays(2000, seed=9)
    vertices, faces = meshes.soup(4000, seed=3)
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu", brick_triangles=64, cache="100%") as scene:
        whole, bricks = scene.cast_rays(rays), scene.info["bricks"]
        held, twice = scene.stats(), scene.cast_rays(rays)
        assert scene.stats()["query_bytes_read"] == held["query_bytes_read"], "what it holds is not read again"
    assert bricks > 50
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu", brick_triangles=64, cache="10%") as scene:
        small, before = scene.cast_rays(rays), scene.stats()
        assert before["query_payloads_read"] <= 2 * bricks, "geometry and attributes of each brick, once"
        scene.cast_rays(rays)
        assert scene.stats()["query_bytes_read"] > before["query_bytes_read"], "the control: it does not hold all"
    for name in whole:
        np.testing.assert_array_equal(whole[name], small[name])
        np.testing.assert_array_equal(whole[name], twice[name])


def test_distances_count_in_lengths_of_the_direction(box):
    for length in (1.0, 2.0, 1e-3, 1e20, 1e-30):
        hits = box.cast_rays(np.array([[0.25, 0.5, 3.0, 0.0, 0.0, -length]]))
        assert hits["t"][0] * length == pytest.approx(2.0, rel=1e-12)
        np.testing.assert_array_equal(hits["normal"], [[0, 0, 1]])
    assert box.cast_rays(np.array([[0.25, 0.5, 3.0, 0.0, 0.0, 1.0]]))["t"][0] == np.inf


def test_weights_give_the_point(box):
    vertices, faces = meshes.box()
    rays = meshes.random_rays(500, seed=4, reach=3.0)
    rays[:, 3:6] = np.random.default_rng(0).uniform(0.05, 0.95, (500, 3)) - rays[:, :3]
    hits = box.cast_rays(rays)
    assert (hits["triangle"] != brickwalk.INVALID_ID).all()
    corners = vertices[faces[hits["triangle"]]]
    u, v = hits["uv"].astype(np.float64).T
    points = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    expected = rays[:, :3] + rays[:, 3:6] * hits["t"][:, None]
    assert np.abs(points - expected).max() < 1e-6
    swapped = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 2] * u[:, None] + corners[:, 1] * v[:, None]
    assert np.abs(swapped - expected).max() > 0.1, "the control"


def test_far_origins_keep_their_digits(box):
    rays = np.array([[1e9 + 0.5, 0.5, 0.25, -1.0, 0.0, 0.0], [0.25, 2.0**40, 0.5, 0.0, -1.0, 0.0]])
    np.testing.assert_array_equal(box.cast_rays(rays)["t"], [1e9 - 0.5, 2.0**40 - 1])


def test_triangles_without_area_keep_their_numbers():
    vertices = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float64)
    faces = np.array([[0, 0, 0], [0, 1, 1], [0, 1, 2]])
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu") as scene:
        hits = scene.cast_rays([[0.25, 0.25, 1, 0, 0, -1]])
        assert hits["triangle"].tolist() == [2]
        info = scene.info
    assert (info["triangles"], info["triangle_ids"]) == (1, 3)


def test_a_scene_without_triangles():
    with brickwalk.Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int), adapter="cpu") as scene:
        assert scene.info["bounds"] is None and scene.info["bricks"] == 0
        assert scene.cast_rays([[0, 0, 0, 0, 0, 1.0]])["t"].tolist() == [np.inf]
        assert scene.test_occlusions([0, 0, 0, 0, 0, 1.0]).item() is False


def test_facts_and_counts(box):
    info = box.info
    assert (info["triangles"], info["instances"], info["bricks"]) == (12, 0, 1)
    np.testing.assert_array_equal(info["bounds"], [[0, 0, 0], [1, 1, 1]])
    before = box.stats()
    box.cast_rays(np.tile([[0.25, 0.5, 3.0, 0.0, 0.0, -1.0]], (7, 1)))
    box.test_occlusions(np.tile([[0.25, 0.5, 3.0, 0.0, 0.0, 1.0]], (5, 1)))
    after = box.stats()
    changed = {name: after[name] - before[name] for name in ("rays", "occlusion_rays", "hits")}
    assert changed == {"rays": 7, "occlusion_rays": 5, "hits": 7}
    assert after["query_bytes_read"] > 0 and after["seconds"] > 0


def test_pinhole_rays():
    camera = brickwalk.Camera((1, 2, 3), (1, 2, -7), fov=90)
    rays = brickwalk.pinhole(camera, 4, 2)
    assert rays.shape == (2, 4, 6) and rays.dtype == np.float64
    np.testing.assert_allclose(rays[..., :3], np.broadcast_to([1, 2, 3], (2, 4, 3)))
    # Half the height is one unit at distance 1, and pixels are square.
    np.testing.assert_allclose(rays[0, 0, 3:], [-1.5, 0.5, -1], atol=1e-15)
    np.testing.assert_allclose(rays[1, 3, 3:], [1.5, -0.5, -1], atol=1e-15)
    np.testing.assert_array_equal(
        rays, brickwalk.Scene.pinhole({"position": (1, 2, 3), "target": (1, 2, -7), "fov": 90}, 4, 2)
    )


@pytest.mark.parametrize(
    "camera, text",
    [
        ({"position": (0, 0, 0), "target": (0, 0, 0)}, "same point"),
        ({"position": (0, 0, 0), "target": (0, 0, 1), "fov": 180}, "field of view"),
        ({"position": (0, 0, 0), "target": (0, 0, 1), "up": (0, 0, 0)}, "up"),
        ({"position": (0, 0, float("nan")), "target": (0, 0, 1)}, "finite"),
        ({"position": (0, 0), "target": (0, 0, 1)}, "three numbers"),
    ],
)
def test_cameras_without_a_view(camera, text):
    with pytest.raises(ValueError, match=text):
        brickwalk.pinhole(camera, 4, 4)
    with pytest.raises(ValueError, match="width"):
        brickwalk.pinhole({"position": (0, 0, 0), "target": (0, 0, 1)}, 0, 4)

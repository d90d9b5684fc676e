"""Queries of geometry against brute force in float64 and closed forms, each with a control."""

import numpy as np
import pytest

import brickwalk
import meshes


@pytest.fixture(scope="module")
def shell():
    vertices, faces = meshes.sphere()
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu", brick_triangles=64) as scene:
        yield scene, vertices, faces


def all_hits(rays, vertices, faces):
    """Every hit of each ray by brute force, and which rays pass no edge closely."""
    t, u, v = meshes.crossings(rays, vertices, faces)
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    hit = (t >= 0) & (least >= 0)
    certain = ~((np.abs(least) < 1e-9) & (t > -1e-9)).any(1) & ~((least > 0) & (np.abs(t) < 1e-9)).any(1)
    return t, hit, certain


def test_all_intersections_are_those_of_brute_force(scene, soup):
    rays = meshes.random_rays(1500, seed=21)
    t, hit, certain = all_hits(rays, *soup)
    assert certain.mean() > 0.99 and hit.sum() > 1500
    counts = scene.count_intersections(rays)
    assert counts.dtype == np.uint32
    np.testing.assert_array_equal(counts[certain], hit.sum(1)[certain])
    assert (counts != hit[::-1].sum(1)).mean() > 0.2, "the control: other rays"
    listed = scene.list_intersections(rays)
    kinds = {"ray_splits": "i8", "ray_ids": "i8", "t": "f8", "triangle": "u4", "uv": "f4", "normal": "f4"}
    assert {name: array.dtype for name, array in listed.items()} == {n: np.dtype(k) for n, k in kinds.items()}
    splits = listed["ray_splits"]
    np.testing.assert_array_equal(np.diff(splits), counts)
    np.testing.assert_array_equal(listed["ray_ids"], np.repeat(np.arange(1500), counts))
    for ray in np.flatnonzero(certain):
        own = slice(splits[ray], splits[ray + 1])
        order = np.argsort(np.where(hit[ray], t[ray], np.inf), kind="stable")[: hit[ray].sum()]
        np.testing.assert_allclose(listed["t"][own], t[ray, order], rtol=1e-9, atol=1e-12)
        np.testing.assert_array_equal(listed["triangle"][own], order)
    np.testing.assert_allclose(listed["normal"], meshes.normals(*soup)[listed["triangle"]], atol=1e-6)


def test_intervals_bound_intersections(scene, soup):
    rays = meshes.random_rays(300, seed=22)
    whole = scene.list_intersections(rays)
    bounded = np.hstack([rays, np.full((300, 1), 0.25), np.full((300, 1), 0.75)])
    kept = (whole["t"] >= 0.25) & (whole["t"] <= 0.75)
    part = scene.list_intersections(bounded)
    np.testing.assert_array_equal(part["triangle"], whole["triangle"][kept])
    assert 0 < kept.sum() < len(kept)


def test_the_first_intersection_is_the_closest_hit(scene):
    rays = meshes.random_rays(1000, seed=23)
    listed, hits = scene.list_intersections(rays), scene.cast_rays(rays)
    starts = listed["ray_splits"][:-1][np.diff(listed["ray_splits"]) > 0]
    rows = listed["ray_ids"][starts]
    same = hits["triangle"][rows] == listed["triangle"][starts]
    assert same.mean() > 0.995
    np.testing.assert_allclose(hits["t"][rows][same], listed["t"][starts][same], rtol=1e-9)


def test_closest_points_are_those_of_brute_force(scene, soup):
    points = np.random.default_rng(31).uniform(-8, 8, (600, 3))
    truth, distance = meshes.closest(points, *soup)
    found = scene.closest_points(points)
    np.testing.assert_allclose(found["distance"], distance, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(found["points"], truth, atol=1e-9)
    assert np.abs(found["distance"][::-1] - distance).max() > 1, "the control: other points"
    np.testing.assert_array_equal(scene.distance(points), found["distance"])
    corners = soup[0][soup[1][found["triangle"]]]
    u, v = found["uv"].astype(np.float64).T
    by_weights = corners[:, 0] * (1 - u - v)[:, None] + corners[:, 1] * u[:, None] + corners[:, 2] * v[:, None]
    assert np.abs(by_weights - found["points"]).max() < 1e-6
    np.testing.assert_allclose(found["normal"], meshes.normals(*soup)[found["triangle"]], atol=1e-6)


def test_distances_of_a_box(box):
    points = np.random.default_rng(32).uniform(-2, 3, (3000, 3))
    outside = np.maximum(np.maximum(-points, points - 1), 0)
    inside = np.minimum(points, 1 - points).min(1)
    is_inside = inside > 0
    signed = np.where(is_inside, -inside, np.linalg.norm(outside, axis=1))
    np.testing.assert_allclose(box.signed_distance(points), signed, atol=1e-12)
    np.testing.assert_array_equal(box.occupancy(points), is_inside)
    assert 10 < is_inside.sum() < 2000
    assert (box.occupancy(points + 0.3) != is_inside).any(), "the control: other points"


def test_a_sphere_contains_what_is_within_its_radius(shell):
    scene, _, _ = shell
    points = np.random.default_rng(33).uniform(-3, 3, (20, 10, 15, 3))
    radius = np.linalg.norm(points, axis=-1)
    inside = scene.occupancy(points)
    assert inside.shape == (20, 10, 15) and inside.dtype == np.bool_
    # Between the polyhedron and the sphere it is not said.
    assert inside[radius < 1.96].all() and not inside[radius > 2.002].any()
    signed = scene.signed_distance(points)
    assert np.abs(signed - (radius - 2))[radius > 0.2].max() < 0.05
    assert ((signed < 0) == inside).all()


def test_open_surfaces_are_refused():
    vertices, faces = meshes.box()
    with brickwalk.Scene.from_arrays(vertices, faces[1:], adapter="cpu") as scene:
        for query in (scene.occupancy, scene.signed_distance):
            with pytest.raises(brickwalk.BrickwalkError, match="closed"):
                query(np.zeros((1, 3)))
        assert scene.occupancy([[0.5, 0.5, 0.5], [5, 5, 5]], allow_open=True).shape == (2,)


def test_visibility_is_whether_a_segment_goes_free(scene, soup):
    rng = np.random.default_rng(34)
    a, b = rng.uniform(-6, 6, (2, 800, 3))
    t, u, v = meshes.crossings(np.hstack([a, b - a]), *soup)
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    blocked = ((t > 1e-4) & (t < 1 - 1e-4) & (least > 0)).any(1)
    certain = ~((np.abs(least) < 1e-6) & (t > -1e-3) & (t < 1.001)).any(1)
    certain &= ~((least > -1e-6) & (np.minimum(np.abs(t), np.abs(t - 1)) < 1e-3)).any(1)
    free = scene.visibility(a, b)
    np.testing.assert_array_equal(free[certain], ~blocked[certain])
    assert 0.1 < free.mean() < 0.9
    assert (free != scene.visibility(a, b[::-1])).any(), "the control: other ends"


def test_visibility_broadcasts(box):
    eye = [0.5, 0.5, 3.0]
    points = np.float64([[[0.5, 0.5, 1.0], [0.5, 0.5, 0.0]], [[0.5, 0.5, 2.0], [0.5, 3.0, 3.0]]])
    expected = [[True, False], [True, True]]
    assert box.visibility(eye, points).tolist() == expected
    assert box.visibility(points, eye).tolist() == expected
    assert box.visibility(np.float32([eye]), points[:, :1]).tolist() == [[True], [True]]
    assert box.visibility(eye, [0.5, 0.5, 2.0]).shape == ()
    with pytest.raises(ValueError, match="together"):
        box.visibility(np.zeros((2, 3)), np.zeros((5, 3)))
    with pytest.raises(ValueError, match=r"pair \(1, 0\)"):
        bad = points.copy()
        bad[1, 0, 2] = np.nan
        box.visibility(eye, bad)


@pytest.mark.parametrize("shape", [(), (0,), (7,), (2, 3), (2, 0, 3)])
def test_shapes(box, shape):
    points = np.full((*shape, 3), 0.25, np.float32)
    assert box.distance(points).shape == box.occupancy(points).shape == shape
    found = box.closest_points(points)
    assert found["points"].shape == (*shape, 3) and found["uv"].shape == (*shape, 2)
    rays = np.ones((*shape, 6))
    assert box.count_intersections(rays).shape == shape
    assert len(box.list_intersections(rays)["ray_splits"]) == rays.size // 6 + 1


@pytest.mark.parametrize(
    "points, error, text",
    [
        (np.zeros((3, 2)), ValueError, r"\(\.\.\., 3\)"),
        (np.zeros((3, 3), int), TypeError, "int"),
        (np.float64([[0, 0, 0], [0, np.nan, 0]]), ValueError, "point 1: .*finite"),
        ("points", TypeError, "points"),
    ],
)
def test_bad_points(box, points, error, text):
    for query in (box.closest_points, box.distance, box.signed_distance, box.occupancy):
        with pytest.raises(error, match=text):
            query(points)


def test_queries_read_through_a_cache():
    vertices, faces = meshes.soup(3000, seed=5)
    points = np.random.default_rng(35).uniform(-6, 6, (2000, 3))
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu", brick_triangles=64, cache="100%") as scene:
        whole = scene.distance(points)
    with brickwalk.Scene.from_arrays(vertices, faces, adapter="cpu", brick_triangles=64, cache="10%") as scene:
        np.testing.assert_array_equal(scene.distance(points), whole)
        stats = scene.stats()
    assert stats["queries"] == 1 and stats["query_bytes_read"] > 0


def test_an_empty_scene():
    with brickwalk.Scene.from_arrays(np.zeros((0, 3)), np.zeros((0, 3), int), adapter="cpu") as scene:
        point = [[1.0, 2.0, 3.0]]
        found = scene.closest_points(point)
        assert np.isnan(found["points"]).all() and found["triangle"].tolist() == [brickwalk.INVALID_ID]
        assert scene.distance(point).tolist() == [np.inf] and scene.occupancy(point).tolist() == [False]
        assert scene.count_intersections([0, 0, 0, 0, 0, 1.0]) == 0
        assert scene.visibility([0, 0, 0.0], [1, 1, 1.0]).item() is True


def test_results_go_where_they_are_wanted(shell):
    scene, *_ = shell
    rays, points = meshes.random_rays(50, seed=31).reshape(5, 10, 6), meshes.random_rays(50, seed=32)[:, :3]
    for call, given, dtype in [
        (scene.count_intersections, (rays,), np.uint32),
        (scene.distance, (points,), np.float64),
        (scene.signed_distance, (points,), np.float64),
        (scene.occupancy, (points,), np.bool_),
        (scene.visibility, (points, points[::-1]), np.bool_),
    ]:
        expected = call(*given)
        # Of one piece, and with strides.
        for out in (np.zeros(expected.shape, dtype), np.zeros((*expected.shape, 2), dtype)[..., 0]):
            assert call(*given, out=out) is out
            np.testing.assert_array_equal(out, expected)
        with pytest.raises(TypeError, match="out"):
            call(*given, out=np.zeros(expected.shape, np.complex64))
        with pytest.raises(ValueError, match="shape"):
            call(*given, out=np.zeros((3, *expected.shape), dtype))
    whole = scene.closest_points(points)
    some = {"distance": np.zeros(50), "normal": np.zeros((50, 3), np.float32)}
    found = scene.closest_points(points, out=some)
    assert found["distance"] is some["distance"]
    for name in whole:
        np.testing.assert_array_equal(found[name], whole[name])

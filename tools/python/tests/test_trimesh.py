"""The intersector with trimesh's methods."""

import types

import numpy as np
import pytest

import brickwalk
import meshes
from brickwalk.trimesh import RayMeshIntersector

ORIGINS = np.array([[0.5, 0.25, 9], [9, 9, 9], [0.25, 0.5, -3.0]])
DIRECTIONS = np.array([[0, 0, -2], [0, 0, 1], [0, 0, 1.0]])


@pytest.fixture
def ray():
    vertices, faces = meshes.box()
    return RayMeshIntersector(types.SimpleNamespace(vertices=vertices, faces=faces), adapter="cpu")


def test_locations_of_all_hits(ray):
    locations, index_ray, index_tri = ray.intersects_location(ORIGINS, DIRECTIONS)
    assert (locations.dtype, index_ray.dtype, index_tri.dtype) == (np.float64, np.int64, np.int64)
    assert index_ray.tolist() == [0, 0, 2, 2]
    np.testing.assert_allclose(locations, [[0.5, 0.25, 1], [0.5, 0.25, 0], [0.25, 0.5, 0], [0.25, 0.5, 1]])
    vertices, faces = meshes.box()
    assert np.abs(vertices[faces[index_tri]][:, :, 2] - locations[:, 2:]).max() == 0
    index_tri_2, index_ray_2 = ray.intersects_id(ORIGINS, DIRECTIONS)
    assert (index_tri_2 == index_tri).all() and (index_ray_2 == index_ray).all()
    assert ray.intersects_id(ORIGINS, DIRECTIONS, max_hits=1)[1].tolist() == [0, 2]


def test_first_hits(ray):
    locations, index_ray, index_tri = ray.intersects_location(ORIGINS, DIRECTIONS, multiple_hits=False)
    assert index_ray.tolist() == [0, 2]
    np.testing.assert_allclose(locations, [[0.5, 0.25, 1], [0.25, 0.5, 0]])
    first = ray.intersects_first(ORIGINS, DIRECTIONS)
    assert first.dtype == np.int64 and first[1] == -1 and first[[0, 2]].tolist() == index_tri.tolist()
    assert ray.intersects_any(ORIGINS, DIRECTIONS).tolist() == [True, False, True]


def test_nothing_is_hit(ray):
    locations, index_ray, index_tri = ray.intersects_location(ORIGINS[1:2], DIRECTIONS[1:2])
    assert locations.shape == (0, 3) and len(index_ray) == len(index_tri) == 0
    assert ray.intersects_first(np.zeros((0, 3)), np.zeros((0, 3))).shape == (0,)


def test_contained_points(ray):
    assert ray.contains_points([[0.5, 0.5, 0.5], [0.5, 0.5, 1.5]]).tolist() == [True, False]
    open_box = RayMeshIntersector(meshes.box()[0], meshes.box()[1][:-1], adapter="cpu")
    # A hole is no error, as it is none there.
    assert open_box.contains_points([[0.5, 0.5, 1.5]]).tolist() == [False]


def test_a_point_where_triangles_touch_counts_once(ray):
    origins, directions = [[0.5, 0.5, 3.0], [0.0, 0.0, 3.0]], [[0.0, 0.0, -1.0]] * 2
    triangle, which = ray.intersects_id(origins, directions)
    assert np.bincount(which).tolist() == [2, 2]
    assert len(triangle) < len(ray.scene.list_intersections(np.hstack([origins, directions]))["t"]), "the control"
    assert len(ray.intersects_id(origins, directions, max_hits=1)[0]) == 2


def test_arrays_that_do_not_go_together(ray):
    for origins, directions in [(ORIGINS, DIRECTIONS[:2]), (ORIGINS[0], DIRECTIONS[0]), (ORIGINS[:, :2], DIRECTIONS)]:
        with pytest.raises(ValueError):
            ray.intersects_any(origins, directions)
    with pytest.raises(ValueError, match="ray 1: the direction"):
        ray.intersects_first(ORIGINS, DIRECTIONS * [[1], [0], [1]])


def test_against_trimesh():
    trimesh = pytest.importorskip("trimesh")
    pytest.importorskip("rtree")
    vertices, faces = meshes.sphere(8, 10)
    mesh = trimesh.Trimesh(vertices, faces, process=False)
    rays = meshes.random_rays(200, seed=8, reach=4.0)
    ours, theirs = RayMeshIntersector(mesh, adapter="cpu"), trimesh.ray.ray_triangle.RayMeshIntersector(mesh)
    first, expected = (one.intersects_first(rays[:, :3], rays[:, 3:]) for one in (ours, theirs))
    assert (first == expected).mean() > 0.98
    found, expected = (one.intersects_location(rays[:, :3], rays[:, 3:]) for one in (ours, theirs))
    counts = [np.bincount(ray, minlength=200) for _, ray, _ in (found, expected)]
    same = counts[0] == counts[1]
    assert same.mean() > 0.98
    sums = [np.stack([np.bincount(ray, place[:, k], 200) for k in range(3)]) for place, ray, _ in (found, expected)]
    np.testing.assert_allclose(sums[0][:, same], sums[1][:, same], atol=1e-6)
    points = np.random.default_rng(0).uniform(-3, 3, (100, 3))
    np.testing.assert_array_equal(ours.contains_points(points), theirs.contains_points(points))

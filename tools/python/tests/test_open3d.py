"""The scene with Open3D's names: dtypes, ids and conventions."""

import copy
import pickle

import numpy as np
import pytest

import brickwalk
import meshes


@pytest.fixture
def scene():
    scene = brickwalk.RaycastingScene(adapter="cpu")
    assert scene.add_triangles(*meshes.box()) == 0
    vertices, faces = meshes.box((2, 0, 0), (3, 1, 1))
    assert scene.add_triangles(np.float32(vertices), np.uint32(faces)) == 1
    return scene


RAYS = np.float32([[0.5, 0.25, 9, 0, 0, -2], [2.5, 0.25, 9, 0, 0, -1], [9, 9, 9, 0, 0, 1]])


def test_cast_rays(scene):
    hits = scene.cast_rays(RAYS)
    assert {name: (a.dtype, a.shape) for name, a in hits.items()} == {
        "t_hit": (np.float32, (3,)),
        "geometry_ids": (np.uint32, (3,)),
        "primitive_ids": (np.uint32, (3,)),
        "primitive_uvs": (np.float32, (3, 2)),
        "primitive_normals": (np.float32, (3, 3)),
    }
    np.testing.assert_array_equal(hits["t_hit"], np.float32([4, 8, np.inf]))
    invalid = brickwalk.RaycastingScene.INVALID_ID
    assert invalid == 2**32 - 1
    np.testing.assert_array_equal(hits["geometry_ids"], np.uint32([0, 1, invalid]))
    assert hits["primitive_ids"][0] == hits["primitive_ids"][1] < 12 and hits["primitive_ids"][2] == invalid
    np.testing.assert_array_equal(hits["primitive_normals"], [[0, 0, 1], [0, 0, 1], [0, 0, 0]])
    assert scene.cast_rays(RAYS.reshape(1, 3, 6))["primitive_uvs"].shape == (1, 3, 2)


def test_occlusions_have_ends(scene):
    assert scene.test_occlusions(RAYS).tolist() == [True, True, False]
    assert scene.test_occlusions(RAYS, tfar=5.0).tolist() == [True, False, False]
    assert scene.test_occlusions(RAYS, tnear=6.0).tolist() == [False, True, False]


def test_meshes_may_come_later(scene):
    before = scene.cast_rays(RAYS)
    assert scene.add_triangles(np.zeros((0, 3), np.float32), np.zeros((0, 3), np.uint32)) == 2
    assert scene.add_triangles(*meshes.box((8, 8, 10), (10, 10, 12))) == 3
    after = scene.cast_rays(RAYS)
    assert after["geometry_ids"].tolist() == [0, 1, 3] and before["geometry_ids"][2] == scene.INVALID_ID


def test_meshes_of_others(scene):
    class Mesh:
        vertices, faces = meshes.box((8, 8, 10), (10, 10, 12))

    class Tensors:
        class vertex:
            positions = np.float32(Mesh.vertices)

        class triangle:
            indices = Mesh.faces

    assert (scene.add_triangles(Mesh()), scene.add_triangles(Tensors())) == (2, 3)
    for wrong, error in [((7,), TypeError), ((np.zeros((3, 3)), [[0, 1, 3]]), ValueError)]:
        with pytest.raises(error):
            scene.add_triangles(*wrong)


def test_copies(scene):
    for again in (copy.deepcopy(scene), brickwalk.RaycastingScene(scene), pickle.loads(pickle.dumps(scene))):
        assert again.add_triangles(*meshes.box((8, 8, 10), (10, 10, 12))) == 2
        assert again.cast_rays(RAYS)["geometry_ids"].tolist() == [0, 1, 2]
    assert scene.cast_rays(RAYS)["geometry_ids"][2] == scene.INVALID_ID


def test_a_scene_without_meshes():
    scene = brickwalk.RaycastingScene(adapter="cpu")
    assert np.isinf(scene.cast_rays(RAYS)["t_hit"]).all()


def test_pinhole_rays():
    # In the middle the view; columns toward up x view, rows toward up; the field of view is that of the width.
    rays = brickwalk.RaycastingScene.create_rays_pinhole(
        fov_deg=90, center=[0, 0, 0], eye=[0, 0, -2], up=[0, 1, 0], width_px=4, height_px=2
    )
    assert rays.shape == (2, 4, 6) and rays.dtype == np.float32
    np.testing.assert_allclose(rays[..., :3], np.broadcast_to([0, 0, -2], (2, 4, 3)))
    np.testing.assert_allclose(rays[0, 0, 3:], [-0.75, -0.25, 1], atol=1e-6)
    np.testing.assert_allclose(rays[1, 3, 3:], [0.75, 0.25, 1], atol=1e-6)
    intrinsic = [[2, 0, 2], [0, 2, 1], [0, 0, 1]]
    extrinsic = np.eye(4)
    extrinsic[2, 3] = 2
    again = brickwalk.RaycastingScene.create_rays_pinhole(intrinsic, extrinsic, 4, 2)
    np.testing.assert_allclose(rays, again, atol=1e-6)
    with pytest.raises(TypeError, match="intrinsic_matrix"):
        brickwalk.RaycastingScene.create_rays_pinhole(intrinsic, 4, 2)
    with pytest.raises(ValueError, match="inverse"):
        brickwalk.RaycastingScene.create_rays_pinhole(np.zeros((3, 3)), extrinsic, 4, 2)


def test_only_six_numbers(scene):
    with pytest.raises(ValueError, match=r"\(\.\.\., 6\)"):
        scene.cast_rays(np.zeros((3, 8), np.float32))


def test_intersections(scene):
    counts = scene.count_intersections(RAYS)
    assert counts.dtype == np.int32 and counts.tolist() == [2, 2, 0]
    listed = scene.list_intersections(RAYS)
    assert {name: (a.dtype, a.shape) for name, a in listed.items()} == {
        "ray_splits": (np.uint32, (4,)),
        "ray_ids": (np.uint32, (4,)),
        "t_hit": (np.float32, (4,)),
        "geometry_ids": (np.uint32, (4,)),
        "primitive_ids": (np.uint32, (4,)),
        "primitive_uvs": (np.float32, (4, 2)),
    }
    assert listed["ray_splits"].tolist() == [0, 2, 4, 4] and listed["ray_ids"].tolist() == [0, 0, 1, 1]
    assert listed["t_hit"].tolist() == [4.0, 4.5, 8.0, 9.0] and listed["geometry_ids"].tolist() == [0, 0, 1, 1]


def test_points(scene):
    points = np.float32([[0.5, 0.5, 0.5], [-0.5, -0.5, -0.5], [2.5, 0.5, 4.0]])
    found = scene.compute_closest_points(points)
    assert {name: (a.dtype, a.shape) for name, a in found.items()} == {
        "points": (np.float32, (3, 3)),
        "geometry_ids": (np.uint32, (3,)),
        "primitive_ids": (np.uint32, (3,)),
        "primitive_uvs": (np.float32, (3, 2)),
        "primitive_normals": (np.float32, (3, 3)),
    }
    assert found["geometry_ids"].tolist() == [0, 0, 1]
    np.testing.assert_allclose(found["points"][1:], [[0, 0, 0], [2.5, 0.5, 1]])
    distance = [0.5, np.sqrt(0.75), 3]
    for array, expected in [
        (scene.compute_distance(points), distance),
        (scene.compute_signed_distance(points, nsamples=3), [-0.5, *distance[1:]]),
        (scene.compute_occupancy(points), [1, 0, 0]),
    ]:
        assert array.dtype == np.float32
        np.testing.assert_allclose(array, expected, rtol=1e-6)
    assert scene.compute_occupancy(points.reshape(3, 1, 3)).shape == (3, 1)

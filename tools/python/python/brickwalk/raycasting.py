"""A scene with the names and conventions of Open3D's ``open3d.t.geometry.RaycastingScene``, for NumPy arrays.

Programs written for that class run with this one, once what they pass and get are NumPy arrays. Numbers are float32 as
there; :class:`brickwalk.Scene` has distances in float64. Arguments for threads and samples are taken without effect.
"""

from __future__ import annotations

import copy
import threading
from typing import Any

import numpy as np

from ._arrays import as_array, floats, once
from ._arrays import faces as as_faces
from ._scene import INVALID_ID, Scene


class RaycastingScene:
    """Meshes that are added one by one, each with a geometry id, 0 for the first.

    The scene is built by the first query after a mesh was added, in a temporary file. ``cache`` and ``adapter`` are
    those of :meth:`brickwalk.Scene.from_arrays`. ``nthreads`` and ``device`` have no effect. With another
    RaycastingScene as the first argument it is a copy of that.
    """

    #: Geometry and primitive of a ray that hits nothing.
    INVALID_ID = INVALID_ID

    def __init__(self, nthreads: Any = 0, device: Any = None, *, cache: str | int = "auto", adapter: str = "auto"):
        self._lock = threading.RLock()
        self._meshes: list[tuple[np.ndarray, np.ndarray]] = []
        self._options: dict[str, Any] = {"cache": cache, "adapter": adapter}
        self._scene: Scene | None = None
        self._starts = np.zeros(1, np.int64)
        if isinstance(nthreads, RaycastingScene):
            self._meshes, self._options = list(nthreads._meshes), dict(nthreads._options)

    def __deepcopy__(self, memo: dict[int, Any]) -> RaycastingScene:
        return RaycastingScene(self)

    def __getstate__(self) -> dict[str, Any]:
        return {"meshes": self._meshes, "options": self._options}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__init__()  # type: ignore[misc]
        self._meshes, self._options = copy.copy(state["meshes"]), state["options"]

    def add_triangles(self, vertex_positions: Any, triangle_indices: Any = None) -> int:
        """Adds a mesh and returns its geometry id.

        ``vertex_positions`` float32 or float64 (n, 3), ``triangle_indices`` integers (m, 3); or a mesh as the only
        argument, which has either of ``vertex.positions`` and ``triangle.indices``, ``vertices`` and ``triangles``,
        ``vertices`` and ``faces``.

        Raises ValueError for an index out of range or another shape, TypeError for another dtype.
        """
        if triangle_indices is None:
            vertex_positions, triangle_indices = _of_mesh(vertex_positions)
        points, lead = floats(vertex_positions, "vertex_positions", (3,))
        if len(lead) != 1:
            raise ValueError(f"vertex_positions must have shape (n, 3), not {(*lead, 3)}")
        triangles = as_faces(triangle_indices)
        bad = ((triangles < 0) | (triangles >= len(points))).any(axis=1)
        if bad.any():
            row = int(np.argmax(bad))
            raise ValueError(f"triangle {row} is {triangles[row].tolist()}; there are {len(points)} vertices, from 0")
        if not np.isfinite(points).all():
            row = int(np.argmin(np.isfinite(points).all(axis=1)))
            raise ValueError(f"vertex {row} is {points[row].tolist()}; coordinates must be finite")
        with self._lock:
            self._meshes.append((points.copy(), triangles.copy()))
            self._give_up()
            return len(self._meshes) - 1

    def _give_up(self) -> None:
        if self._scene is not None:
            self._scene.close()
            self._scene = None

    def _built(self) -> tuple[Scene, np.ndarray]:
        with self._lock:
            if self._scene is None:
                counts = [len(points) for points, _ in self._meshes]
                firsts = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
                starts = np.cumsum([0, *(len(triangles) for _, triangles in self._meshes)])
                kind = np.result_type(np.float32, *(points.dtype for points, _ in self._meshes))
                points = np.concatenate([np.zeros((0, 3), kind), *(points for points, _ in self._meshes)])
                parts = [triangles + first for (_, triangles), first in zip(self._meshes, firsts[:-1], strict=True)]
                triangles = np.concatenate([np.zeros((0, 3), np.int64), *parts])
                self._scene = Scene.from_arrays(points.astype(kind, copy=False), triangles, **self._options)
                self._starts = starts
            return self._scene, self._starts

    def _ids(self, triangles: np.ndarray, starts: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Geometry and primitive of triangles of the whole scene."""
        hit = triangles != INVALID_ID
        # Of meshes without triangles, which begin where the next one does, none is meant.
        geometry = np.searchsorted(starts, triangles, side="right") - 1
        geometry = np.where(hit, geometry, 0)
        primitive = triangles.astype(np.int64) - starts[geometry]
        invalid = np.int64(INVALID_ID)
        return (
            np.where(hit, geometry, invalid).astype(np.uint32),
            np.where(hit, primitive, invalid).astype(np.uint32),
        )

    def cast_rays(self, rays: Any, nthreads: int = 0) -> dict[str, np.ndarray]:
        """The closest hits of rays (..., 6).

        Returns ``t_hit`` float32 (...), inf on a miss; ``geometry_ids`` and ``primitive_ids`` uint32 (...), INVALID_ID
        on a miss; ``primitive_uvs`` float32 (..., 2); ``primitive_normals`` float32 (..., 3).
        """
        scene, starts = self._built()
        hits = scene.cast_rays(_rays(rays))
        geometry, primitive = self._ids(hits["triangle"], starts)
        return {
            "t_hit": hits["t"].astype(np.float32),
            "geometry_ids": geometry,
            "primitive_ids": primitive,
            "primitive_uvs": hits["uv"],
            "primitive_normals": hits["normal"],
        }

    def test_occlusions(
        self, rays: Any, tnear: float = 0.0, tfar: float = float("inf"), nthreads: int = 0
    ) -> np.ndarray:
        """Whether rays (..., 6) hit anything from ``tnear`` to ``tfar``, in lengths of their directions: bool (...)."""
        scene, _ = self._built()
        given = _rays(rays)
        bounded = np.empty((*given.shape[:-1], 8), np.float64)
        bounded[..., :6], bounded[..., 6], bounded[..., 7] = given, tnear, tfar
        return scene.test_occlusions(bounded)

    def count_intersections(self, rays: Any, nthreads: int = 0) -> np.ndarray:
        """How often each of rays (..., 6) meets the meshes: int32 (...). Where triangles of a mesh touch it counts
        once.
        """
        splits = self.list_intersections(rays)["ray_splits"]
        return np.diff(splits.astype(np.int64)).astype(np.int32).reshape(np.shape(_rays(rays))[:-1])

    def list_intersections(self, rays: Any, nthreads: int = 0) -> dict[str, np.ndarray]:
        """All that rays (..., 6) meet, h hits of n rays.

        Returns ``ray_splits`` uint32 (n + 1), ``ray_ids`` uint32 (h,), ``t_hit`` float32 (h,), ``geometry_ids`` and
        ``primitive_ids`` uint32 (h,), ``primitive_uvs`` float32 (h, 2). Along a ray hits are in the order of distance.
        Where triangles of a mesh touch a ray meets one of them.
        """
        scene, starts = self._built()
        given = _rays(rays)
        hits = scene.list_intersections(given)
        geometry, primitive = self._ids(hits["triangle"], starts)
        kept = once(given.reshape(-1, 6).astype(np.float64), hits["ray_ids"], hits["t"])
        kept[1:] |= geometry[1:] != geometry[:-1]
        ray = hits["ray_ids"][kept]
        return {
            "ray_splits": np.searchsorted(ray, np.arange(len(hits["ray_splits"]))).astype(np.uint32),
            "ray_ids": ray.astype(np.uint32),
            "t_hit": hits["t"][kept].astype(np.float32),
            "geometry_ids": geometry[kept],
            "primitive_ids": primitive[kept],
            "primitive_uvs": hits["uv"][kept],
        }

    def compute_closest_points(self, query_points: Any, nthreads: int = 0) -> dict[str, np.ndarray]:
        """The nearest points of the scene to points (..., 3).

        Returns ``points`` float32 (..., 3), ``geometry_ids`` and ``primitive_ids`` uint32 (...), ``primitive_uvs``
        float32 (..., 2), ``primitive_normals`` float32 (..., 3).
        """
        scene, starts = self._built()
        found = scene.closest_points(query_points)
        geometry, primitive = self._ids(found["triangle"], starts)
        return {
            "points": found["points"].astype(np.float32),
            "geometry_ids": geometry,
            "primitive_ids": primitive,
            "primitive_uvs": found["uv"],
            "primitive_normals": found["normal"],
        }

    def compute_distance(self, query_points: Any, nthreads: int = 0) -> np.ndarray:
        """The distances of points (..., 3) from the scene: float32 (...)."""
        return self._built()[0].distance(query_points).astype(np.float32)

    def compute_signed_distance(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> np.ndarray:
        """The distances of points (..., 3) from the scene, negative inside: float32 (...). What is inside is exact, so
        that ``nsamples`` has no effect. Surfaces that are not closed are taken as Open3D takes them: as they are."""
        return self._built()[0].signed_distance(query_points, allow_open=True).astype(np.float32)

    def compute_occupancy(self, query_points: Any, nthreads: int = 0, nsamples: int = 1) -> np.ndarray:
        """1 for points (..., 3) inside, 0 for those outside: float32 (...). As :meth:`compute_signed_distance`."""
        return self._built()[0].occupancy(query_points, allow_open=True).astype(np.float32)

    @staticmethod
    def create_rays_pinhole(*args: Any, **kwargs: Any) -> np.ndarray:
        """Rays of a pinhole camera: float32 (height_px, width_px, 6).

        Either ``(intrinsic_matrix, extrinsic_matrix, width_px, height_px)``: an upper triangular (3, 3), and a (4, 4)
        that takes the world to the camera. Or ``(fov_deg, center, eye, up, width_px, height_px)``: the horizontal field
        of view in degrees, the point looked at, the camera's position, and a direction. Rows then go toward ``up`` and
        columns toward ``up`` x view, as Open3D has it.
        """
        names = _BY_VIEW if len(args) == 6 or "fov_deg" in kwargs else _BY_MATRICES
        if len(args) > len(names):
            raise TypeError(f"{len(args)} arguments were given; there are {', '.join(names)}")
        given = dict(zip(names, args, strict=False))
        if set(given) & set(kwargs) or set(given) | set(kwargs) != set(names):
            raise TypeError(f"the arguments are {', '.join(names)}")
        given.update(kwargs)
        width, height = int(given["width_px"]), int(given["height_px"])
        if width < 1 or height < 1:
            raise ValueError(f"a picture of {width} x {height} has no pixels")
        if names is _BY_VIEW:
            inverse, origin = _view(given, width, height)
        else:
            inverse, origin = _matrices(given)
        pixels = np.ones((height, width, 3))
        pixels[..., 0] = np.arange(width) + 0.5
        pixels[..., 1] = (np.arange(height) + 0.5)[:, None]
        rays = np.empty((height, width, 6), np.float32)
        rays[..., :3], rays[..., 3:] = origin, pixels @ inverse.T
        return rays


_BY_MATRICES = ("intrinsic_matrix", "extrinsic_matrix", "width_px", "height_px")
_BY_VIEW = ("fov_deg", "center", "eye", "up", "width_px", "height_px")


def _matrix(given: dict[str, Any], name: str, shape: tuple[int, ...]) -> np.ndarray:
    matrix = as_array(given[name], name).astype(np.float64)
    if matrix.shape != shape or not np.isfinite(matrix).all():
        raise ValueError(f"{name} must be finite and of shape {shape}, not {matrix.shape}")
    return matrix


def _matrices(given: dict[str, Any]) -> tuple[np.ndarray, np.ndarray]:
    intrinsic = _matrix(given, "intrinsic_matrix", (3, 3))
    extrinsic = _matrix(given, "extrinsic_matrix", (4, 4))
    turn, shift = extrinsic[:3, :3], extrinsic[:3, 3]
    try:
        return turn.T @ np.linalg.inv(intrinsic), -turn.T @ shift
    except np.linalg.LinAlgError as error:
        raise ValueError("intrinsic_matrix has no inverse") from error


def _view(given: dict[str, Any], width: int, height: int) -> tuple[np.ndarray, np.ndarray]:
    center, eye, up = (_matrix(given, name, (3,)) for name in ("center", "eye", "up"))
    fov = float(given["fov_deg"])
    if not 0 < fov < 180:
        raise ValueError(f"fov_deg is {fov}; it must be between 0 and 180")
    view = center - eye
    across = np.cross(up, view)
    if not np.linalg.norm(view) or not np.linalg.norm(across):
        raise ValueError("center and eye must differ, and up must not lie along the view")
    view, across = view / np.linalg.norm(view), across / np.linalg.norm(across)
    focal = 0.5 * width / np.tan(np.radians(0.5 * fov))
    axes = np.stack([across, np.cross(view, across), view], axis=1)
    lens = np.array([[1 / focal, 0, -0.5 * width / focal], [0, 1 / focal, -0.5 * height / focal], [0, 0, 1]])
    return axes @ lens, eye


def _rays(rays: Any) -> np.ndarray:
    rows, lead = floats(rays, "rays", (6,))
    return rows.reshape((*lead, 6))


def _of_mesh(mesh: Any) -> tuple[Any, Any]:
    """Vertices and triangles of a mesh of Open3D's or trimesh's."""
    if hasattr(mesh, "vertex") and hasattr(mesh, "triangle"):
        return mesh.vertex.positions, mesh.triangle.indices
    for name in ("triangles", "faces"):
        if hasattr(mesh, "vertices") and hasattr(mesh, name):
            return np.asarray(mesh.vertices, dtype=np.float64), np.asarray(getattr(mesh, name), dtype=np.int64)
    raise TypeError(f"{type(mesh).__name__} is no mesh: give vertex_positions and triangle_indices")

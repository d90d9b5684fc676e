"""An intersector with the methods of trimesh's ``RayMeshIntersector``, so that it can take its place.

    mesh.ray = brickwalk.trimesh.RayMeshIntersector(mesh)

Locations are float64 and indices int64. Directions may have any length but none of 0.
"""

from __future__ import annotations

import threading
from typing import Any

import numpy as np

from ._arrays import floats, once
from ._scene import INVALID_ID, Scene


class RayMeshIntersector:
    """Rays and a mesh.

    ``geometry`` has ``vertices`` (n, 3) and ``faces`` (m, 3); or it is the vertices, and ``faces`` is given. The scene
    is built by the first query, in a temporary file; what becomes of the mesh later is not noticed. ``scale_to_box``
    has no effect. ``cache`` and ``adapter`` are those of :meth:`brickwalk.Scene.from_arrays`.
    """

    def __init__(
        self,
        geometry: Any,
        faces: Any = None,
        scale_to_box: bool = True,
        *,
        cache: str | int = "auto",
        adapter: str = "auto",
    ):
        self.mesh = geometry if faces is None else None
        self._given, self._options = (geometry, faces), {"cache": cache, "adapter": adapter}
        self._lock, self._scene = threading.Lock(), None

    @property
    def scene(self) -> Scene:
        """What answers."""
        with self._lock:
            if self._scene is None:
                vertices, faces = self._given
                if faces is None:
                    vertices, faces = np.asarray(vertices.vertices, np.float64), np.asarray(vertices.faces, np.int64)
                self._scene = Scene.from_arrays(vertices, faces, **self._options)
            return self._scene

    def intersects_id(
        self,
        ray_origins: Any,
        ray_directions: Any,
        multiple_hits: bool = True,
        max_hits: int | None = None,
        return_locations: bool = False,
    ) -> tuple[np.ndarray, ...]:
        """The triangles that rays hit: ``index_tri`` (h,), ``index_ray`` (h,), and with ``return_locations`` the points
        (h, 3). Hits are in the order of rays, and of distance along each.

        ``ray_origins`` and ``ray_directions`` have shape (n, 3). With ``multiple_hits`` all hits of a ray count, at
        most the first ``max_hits`` where that is given; else the first. Where triangles touch a ray hits one of them.
        """
        rays = _rays(ray_origins, ray_directions)
        if multiple_hits:
            hits = self.scene.list_intersections(rays)
            kept = once(rays, hits["ray_ids"], hits["t"])
            ray, t, triangle = (hits[name][kept] for name in ("ray_ids", "t", "triangle"))
            if max_hits is not None:
                kept = np.arange(len(ray)) - np.searchsorted(ray, ray) < max_hits
                ray, t, triangle = ray[kept], t[kept], triangle[kept]
        else:
            first = self.scene.cast_rays(rays)
            ray = np.flatnonzero(first["triangle"] != INVALID_ID)
            t, triangle = first["t"][ray], first["triangle"][ray]
        found = (triangle.astype(np.int64), ray.astype(np.int64))
        return (*found, rays[ray, :3] + rays[ray, 3:] * t[:, None]) if return_locations else found

    def intersects_location(
        self, ray_origins: Any, ray_directions: Any, multiple_hits: bool = True, **kwargs: Any
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Where rays hit: ``locations`` (h, 3), ``index_ray`` (h,), ``index_tri`` (h,). As :meth:`intersects_id`."""
        triangle, ray, locations = self.intersects_id(
            ray_origins, ray_directions, multiple_hits, return_locations=True, **kwargs
        )
        return locations, ray, triangle

    def intersects_first(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """The first triangle that each ray hits, -1 where there is none: int64 (n,)."""
        triangle = self.scene.cast_rays(_rays(ray_origins, ray_directions))["triangle"].astype(np.int64)
        return np.where(triangle == INVALID_ID, -1, triangle)

    def intersects_any(self, ray_origins: Any, ray_directions: Any) -> np.ndarray:
        """Whether each ray hits anything: bool (n,)."""
        return self.scene.test_occlusions(_rays(ray_origins, ray_directions))

    def contains_points(self, points: Any) -> np.ndarray:
        """Whether the mesh contains points (n, 3): bool (n,). It should be closed; near holes points may be taken for
        inside or outside.
        """
        return self.scene.occupancy(_points("points", points), allow_open=True)


def _points(name: str, given: Any) -> np.ndarray:
    given = np.asarray(given)
    rows, lead = floats(given.astype(np.float64) if given.dtype.kind in "iu" else given, name, (3,))
    if len(lead) != 1:
        raise ValueError(f"{name} must have shape (n, 3), not {(*lead, 3)}")
    return rows


def _rays(origins: Any, directions: Any) -> np.ndarray:
    starts, ways = _points("ray_origins", origins), _points("ray_directions", directions)
    if starts.shape != ways.shape:
        raise ValueError(f"there are {len(starts)} origins and {len(ways)} directions")
    return np.concatenate([starts, ways], axis=1, dtype=np.float64)

"""Scenes: rays, and pictures."""

from __future__ import annotations

import errno
import json
import os
import shutil
import subprocess
import tempfile
import warnings
import weakref
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from . import _brickwalk
from ._arrays import Results, check_progress, floats, whole
from ._arrays import faces as as_faces
from ._camera import Camera, arguments, pinhole
from ._convert import MODELS
from ._picture import Picture

#: The triangle of a ray that hits nothing.
INVALID_ID = 0xFFFFFFFF

#: What is no path of a file.
URLS = ("s3://", "gs://", "az://", "http://", "https://")

Progress = Callable[[int, int], Any]

# What is known of a point on a triangle: dtypes, and shapes beside those of the rays or points.
_HIT: dict[str, tuple[Any, tuple[int, ...]]] = {
    "triangle": (np.uint32, ()),
    "uv": (np.float32, (2,)),
    "normal": (np.float32, (3,)),
}

# Settings that mean nothing for one picture, or that the call sets itself.
_NOT_OF_PICTURES = (
    "aov checkpoints frames interactive measure_error measure_left_out measure_needed motion path progressive "
    "reference requests_out video video_fps"
).split()


class Scene:
    """A scene that is open.

    Made by :meth:`open` and :meth:`from_arrays`; a context manager. Threads may share it: their calls are done in turn,
    and Python's lock is free meanwhile. Ctrl-C ends a call within a second, and the scene stays usable. It pickles as
    its path and options, so that each process opens it for itself.

    Rays are arrays of float32 or float64 of shape (..., 6), origin and direction, or (..., 8), which have ``t_min`` and
    ``t_max`` as well, 0 or greater. Any strides do, and whatever has ``__array_interface__`` or DLPack. Distances count
    in lengths of the direction that was given.
    """

    def __init__(self, *, _core: _brickwalk.Core, _options: tuple[Any, ...], _folder: str | None = None):
        self._core, self._options = _core, _options
        # A forked process does not remove what its parent uses.
        self._remove = _folder and weakref.finalize(self, _remove, _folder, os.getpid())

    @classmethod
    def open(
        cls,
        path: str | os.PathLike[str],
        cache: str | int = "2G",
        adapter: str = "auto",
        *,
        disk_cache: str | None = None,
    ) -> Scene:
        """Opens a scene file, or the URL of one: ``s3://``, ``gs://``, ``az://``, ``http://``, ``https://``.

        Only its resident part is read; a device is opened by the first picture.

        ``cache`` is the memory for bricks: a size as "2G", a share as "25%", bytes, or "auto". Queries take it in host
        memory, pictures as much again on their device. ``adapter``, which renders pictures, is "auto", "cpu", or a part
        of the name of a graphics adapter. ``disk_cache`` keeps parts of a scene by URL: "DIR,SIZE". Credentials come
        from the environment, see docs/remote.md.

        Raises FileNotFoundError, ValueError for a cache that is none or a model that is not converted, BrickwalkError
        for a file that is damaged.
        """
        text = os.fsdecode(os.fspath(path))
        disk = None if disk_cache is None else _text("disk_cache", disk_cache)
        if text.lower().startswith(URLS):
            options = (text, _size(cache), _text("adapter", adapter), disk)
            return cls(_core=_brickwalk.Core(*options), _options=options)
        name = os.path.abspath(text)
        is_model = name.lower().endswith(MODELS) or os.path.basename(name) == "tileset.json"
        if is_model and os.path.exists(name):
            raise ValueError(f"{name}: this is a model; make a scene file of it by brickwalk.convert")
        options = (name, _size(cache), _text("adapter", adapter), disk)
        return cls(_core=_brickwalk.Core(*options), _options=options)

    @classmethod
    def from_arrays(
        cls,
        vertices: Any,
        faces: Any,
        *,
        cache: str | int = "auto",
        adapter: str = "auto",
        brick_triangles: int = 16384,
        progress: Progress | None = None,
    ) -> Scene:
        """A scene of one mesh.

        ``vertices`` float32 or float64 (n, 3), finite; ``faces`` integers (m, 3), each less than n. The triangle of a
        hit is the row of ``faces``. Positions are rounded to a lattice of 2^-24 of the size of a brick or finer.
        Triangles without area are left out, their numbers are not. ``brick_triangles`` is the most triangles of a
        brick, 1 to 1048576. The scene lies in a temporary file, which is removed when it is closed: keep it open while
        processes that it was sent to use it.

        Raises ValueError that names the row of a vertex or face at fault, TypeError for another dtype.
        """
        points, lead = floats(vertices, "vertices", (3,))
        if len(lead) != 1:
            raise ValueError(f"vertices must have shape (n, 3), not {(*lead, 3)}")
        indices = as_faces(faces)
        check_progress(progress)
        most = whole("brick_triangles", brick_triangles, 1, 1 << 20)
        options = (_size(cache), _text("adapter", adapter))
        folder = tempfile.mkdtemp(prefix="brickwalk-")
        try:
            path = os.path.join(folder, "arrays.bricks")
            _brickwalk.build_mesh(points, indices, path, most, progress)
            core = _brickwalk.Core(path, *options)
            return cls(_core=core, _options=(path, *options), _folder=folder)
        except BaseException:
            shutil.rmtree(folder, ignore_errors=True)
            raise

    def close(self) -> None:
        """Closes the scene and its device. What comes after raises ValueError, but for another ``close``."""
        self._core.close()
        if self._remove:
            self._remove()

    @property
    def closed(self) -> bool:
        """Whether it is closed."""
        return self._core.closed

    def __enter__(self) -> Scene:
        self._check()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __reduce__(self) -> tuple[Any, ...]:
        return _reopen, self._options

    def __repr__(self) -> str:
        state = "closed" if self.closed else f"{self._core.info()['triangles']} triangles"
        # Of a URL without what is secret.
        return f"<brickwalk.Scene {self._core.info()['path']!r}, {state}>"

    def _check(self) -> _brickwalk.Core:
        if self._core.closed:
            raise ValueError("the scene is closed")
        return self._core

    @property
    def info(self) -> dict[str, Any]:
        """Facts of the scene.

        ``triangles`` with every instance multiplied out, ``triangles_stored``, ``triangle_ids`` (hits name triangles
        below it), ``instances``, ``bricks``, ``levels``, ``materials``, ``textures``; ``bytes`` of the file,
        ``bytes_resident`` of the part that is always in memory, ``bytes_bricks`` of all that goes through the cache;
        ``bounds`` float64 (2, 3), least and greatest coordinates, None of an empty scene; ``path``, ``sources``,
        ``warnings``.
        """
        return self._check().info()

    def stats(self) -> dict[str, Any]:
        """What was done since the scene was opened.

        ``queries``; ``rays`` whose closest hit was looked for, ``occlusion_rays``, ``hits`` of both;
        ``query_payloads_read`` and ``query_bytes_read`` from the file, ``query_most_bytes`` of those in memory at a
        time. ``pictures``; ``bricks_loaded``, ``bricks_evicted``, ``bytes_loaded`` and ``round_trips`` of their device,
        ``device``, its name once it is open, else None. ``seconds`` spent on all of it.
        """
        return self._check().stats()

    def cast_rays(
        self,
        rays: Any,
        *,
        any: bool = False,
        out: Mapping[str, np.ndarray] | None = None,
        progress: Progress | None = None,
    ) -> dict[str, np.ndarray]:
        """The closest hits of rays (..., 6) or (..., 8).

        Returns a dict of arrays: ``t`` float64 (...), distance in lengths of the direction, +inf on a miss;
        ``triangle`` uint32 (...), 4294967295 on a miss; ``uv`` float32 (..., 2), weights of vertices 1 and 2;
        ``normal`` float32 (..., 3), unit, right-handed about the order of vertices, 0 on a miss. With ``any`` there is
        ``hit`` alone, bool (...): whether the ray hits anything, which takes less time.

        ``out`` may have arrays of these names, dtypes and shapes, which are filled and returned. ``progress(done,
        total)`` is told rays.

        Raises ValueError that names the ray at fault, TypeError for another dtype. Nothing is written then.
        """
        rows, lead = floats(rays, "rays", (6, 8))
        check_progress(progress)
        core = self._check()
        if any:
            results = Results(out, lead, {"hit": (np.bool_, ())})
            core.occluded(rows, lead, results.flat["hit"], progress)
            return results.finish()
        kinds = {"t": (np.float64, ()), **_HIT}
        results = Results(out, lead, kinds)
        flat = results.flat
        core.cast(rows, lead, flat["t"], flat["triangle"], flat["uv"], flat["normal"], progress)
        return results.finish()

    def test_occlusions(
        self, rays: Any, *, out: np.ndarray | None = None, progress: Progress | None = None
    ) -> np.ndarray:
        """Whether rays (..., 6) or (..., 8) hit anything: bool (...), or ``out``, which is of that dtype and shape.

        Raises as :meth:`cast_rays`.
        """
        return self.cast_rays(rays, any=True, out=_one("hit", out), progress=progress)["hit"]

    def count_intersections(
        self, rays: Any, *, out: np.ndarray | None = None, progress: Progress | None = None
    ) -> np.ndarray:
        """How many triangles each of rays (..., 6) or (..., 8) meets: uint32 (...), or ``out``, which is of that dtype
        and shape.

        Opacity does not matter. Raises as :meth:`cast_rays`.
        """
        rows, lead = floats(rays, "rays", (6, 8))
        check_progress(progress)
        core = self._check()
        results = Results(_one("count", out), lead, {"count": (np.uint32, ())})
        core.count(rows, lead, results.flat["count"], progress)
        return results.finish()["count"]

    def list_intersections(self, rays: Any, *, progress: Progress | None = None) -> dict[str, np.ndarray]:
        """All that rays (..., 6) or (..., 8) meet, h hits of n rays: ray by ray in the order of the array, and along a
        ray by distance.

        Returns ``ray_splits`` int64 (n + 1): the hits of ray i are those from ``ray_splits[i]`` to before
        ``ray_splits[i + 1]``. ``ray_ids`` int64 (h,), the ray of each; ``t`` float64 (h,), ``triangle`` uint32 (h,),
        ``uv`` float32 (h, 2), ``normal`` float32 (h, 3), as of :meth:`cast_rays`. Opacity does not matter.

        Raises as :meth:`cast_rays`.
        """
        rows, lead = floats(rays, "rays", (6, 8))
        check_progress(progress)
        splits, t, triangle, uv, normal = self._check().intersections(rows, lead, progress)
        ids = np.repeat(np.arange(len(rows), dtype=np.int64), np.diff(splits))
        return {"ray_splits": splits, "ray_ids": ids, "t": t, "triangle": triangle, "uv": uv, "normal": normal}

    def closest_points(
        self,
        points: Any,
        *,
        out: Mapping[str, np.ndarray] | None = None,
        progress: Progress | None = None,
    ) -> dict[str, np.ndarray]:
        """The nearest points of the scene to points (..., 3), in its units.

        Returns ``points`` float64 (..., 3); ``distance`` float64 (...); ``triangle`` uint32 (...); ``uv`` float32
        (..., 2), weights of its vertices 1 and 2; ``normal`` float32 (..., 3), its unit normal. In a scene without
        triangles points are NaN, distances +inf and triangles 4294967295. ``out`` as of :meth:`cast_rays`.

        Raises ValueError that names a point that is not finite, TypeError for another dtype.
        """
        rows, lead = floats(points, "points", (3,))
        check_progress(progress)
        kinds = {"points": (np.float64, (3,)), "distance": (np.float64, ()), **_HIT}
        core = self._check()
        results = Results(out, lead, kinds)
        flat = results.flat
        core.closest(
            rows, lead, flat["points"], flat["distance"], flat["triangle"], flat["uv"], flat["normal"], progress
        )
        return results.finish()

    def distance(
        self, points: Any, *, out: np.ndarray | None = None, progress: Progress | None = None
    ) -> np.ndarray:
        """The distances of points (..., 3) from the scene, in its units: float64 (...), or ``out``, which is of that
        dtype and shape. Raises as :meth:`closest_points`.
        """
        return self._of_points("distance", np.float64, points, out, progress)

    def signed_distance(
        self,
        points: Any,
        *,
        allow_open: bool = False,
        out: np.ndarray | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """The distances of points (..., 3) from the scene, in its units, negative inside: float64 (...), or ``out``,
        which is of that dtype and shape.

        Raises as :meth:`occupancy`.
        """
        return self._of_points("signed_distance", np.float64, points, out, progress, bool(allow_open))

    def occupancy(
        self,
        points: Any,
        *,
        allow_open: bool = False,
        out: np.ndarray | None = None,
        progress: Progress | None = None,
    ) -> np.ndarray:
        """Whether points (..., 3) are inside the closed surfaces of the scene: bool (...), or ``out``, which is of that
        dtype and shape.

        Of points on a surface it is not said. With ``allow_open`` surfaces may have holes; points near those may be
        taken for inside or outside.

        Raises BrickwalkError that names a surface that is not closed, ValueError that names a point that is not finite.
        """
        return self._of_points("occupancy", np.bool_, points, out, progress, bool(allow_open))

    def _of_points(
        self, query: str, dtype: Any, points: Any, out: np.ndarray | None, progress: Progress | None, *options: bool
    ) -> np.ndarray:
        """What a query says of each of points (..., 3): a number each."""
        rows, lead = floats(points, "points", (3,))
        check_progress(progress)
        core = self._check()
        results = Results(_one(query, out), lead, {query: (dtype, ())})
        getattr(core, query)(rows, lead, results.flat[query], *options, progress)
        return results.finish()[query]

    def visibility(
        self, a: Any, b: Any, *, out: np.ndarray | None = None, progress: Progress | None = None
    ) -> np.ndarray:
        """Whether the ways from points ``a`` (..., 3) to points ``b`` (..., 3) are free: bool of the shape that the two
        broadcast to, without their last axis, or ``out``, which is of that dtype and shape. A hair at either end is
        left out, so that points on surfaces see what is before them.

        Raises ValueError that names a pair that is not finite, or shapes that do not go together.
        """
        check_progress(progress)
        ends = [floats(points, name, (3,)) for points, name in ((a, "a"), (b, "b"))]
        try:
            shape = np.broadcast_shapes(*((*lead, 3) for _, lead in ends))
        except ValueError as error:
            raise ValueError(f"a and b do not go together: {ends[0][1]} and {ends[1][1]}") from error
        pairs = np.empty((*shape[:-1], 6), np.float64)
        for k, (rows, lead) in enumerate(ends):
            pairs[..., 3 * k : 3 * k + 3] = rows.reshape(*lead, 3)
        core = self._check()
        results = Results(_one("free", out), shape[:-1], {"free": (np.bool_, ())})
        core.visibility(pairs.reshape(-1, 6), shape[:-1], results.flat["free"], progress)
        return results.finish()["free"]

    def view(self, *options: str) -> subprocess.Popen[bytes]:
        """Opens a window to fly through the scene, and returns its process while the person looks.

        The window is the program ``brickwalk``, which is installed beside this package; the environment variable
        ``BRICKWALK`` names it where it is not on the path. ``options`` are those of ``brickwalk view``, as
        ``"--size", "1280x720"``. A scene that was made of arrays is to stay open until the window is closed.

        Raises FileNotFoundError where the program is not found.
        """
        self._check()
        program = os.environ.get("BRICKWALK") or shutil.which("brickwalk")
        if not program or not shutil.which(program):
            where = "BRICKWALK names no program" if program else "the program brickwalk is not on the path"
            raise FileNotFoundError(errno.ENOENT, f"{where}: install it from its sources with cargo install --path .")
        words = [_text("an option", option) for option in options]
        return subprocess.Popen([program, "view", self._options[0], *words])

    pinhole = staticmethod(pinhole)

    def render(
        self,
        camera: Camera | Mapping[str, Any] | None = None,
        *,
        progress: Progress | None = None,
        **settings: Any,
    ) -> Picture:
        """Renders a picture.

        ``camera`` is a :class:`Camera` or a dict of its fields; None takes the scene's own view, for which the setting
        ``fov`` is. ``settings`` are those of ``brickwalk walk``, by their names in a settings file: ``size="640x360"``
        or a pair, ``spp=16``, ``effects="path"``, ``denoise=True``; a dict is a table, ``roma={"k": 4}``. The same
        arguments give the same picture. ``progress(done, total)`` is told passes.

        Returns a :class:`Picture`, a dict of arrays that a notebook shows.

        Raises ValueError for a setting that there is not, or settings that do not go together.
        """
        check_progress(progress)
        core = self._check()
        for name in _NOT_OF_PICTURES:
            if name in settings:
                raise ValueError(f"{name}: this setting has no meaning for one picture")
        view = None if camera is None else arguments(camera)
        chosen = {name: value for name, value in settings.items() if value is not None}
        arrays, notes = core.render(_toml(chosen), list(chosen), view, progress)
        for note in notes:
            warnings.warn(note, stacklevel=2)
        return Picture(arrays)


def _one(name: str, out: np.ndarray | None) -> dict[str, np.ndarray] | None:
    """What a call fills that returns one array."""
    return None if out is None else {name: out}


def _reopen(path: str, cache: str, adapter: str, disk_cache: str | None = None) -> Scene:
    return Scene.open(path, cache, adapter, disk_cache=disk_cache)


def _remove(folder: str, process: int) -> None:
    if os.getpid() == process:
        shutil.rmtree(folder, ignore_errors=True)


def _text(name: str, value: Any) -> str:
    if not isinstance(value, str):
        raise TypeError(f"{name} must be text, not {type(value).__name__}")
    return value


def _size(cache: Any) -> str:
    if isinstance(cache, bool) or not isinstance(cache, (str, int, np.integer)):
        raise TypeError(f'cache must be a size as "2G", a share as "25%", or bytes, not {type(cache).__name__}')
    return str(cache)


def _toml(settings: Mapping[str, Any]) -> str:
    """Settings as the text of a settings file."""
    tables = {name: value for name, value in settings.items() if isinstance(value, Mapping)}
    lines = [f"{json.dumps(name)} = {_value(name, value)}" for name, value in settings.items() if name not in tables]
    for name, table in tables.items():
        lines.append(f"[{json.dumps(name)}]")
        lines += [f"{json.dumps(key)} = {_value(f'{name}.{key}', value)}" for key, value in table.items()]
    return "\n".join(lines)


def _value(name: str, value: Any) -> str:
    if isinstance(value, (np.generic, np.ndarray)):
        value = value.tolist()
    if isinstance(value, os.PathLike):
        value = os.fsdecode(value)
    if name == "size" and isinstance(value, (list, tuple)) and len(value) == 2:
        value = f"{value[0]}x{value[1]}"
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, (int, float)):
        return repr(value)
    if isinstance(value, str):
        return json.dumps(value).replace("\x7f", "\\u007f")
    if isinstance(value, (list, tuple)):
        return f"[{', '.join(_value(name, item) for item in value)}]"
    raise TypeError(f"{name}: a setting is text, a number, True, False or a list of these, not {type(value).__name__}")

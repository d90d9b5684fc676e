"""Cameras, and the rays of their pixels."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from . import _brickwalk
from ._arrays import whole

#: Most pixels of a side.
MOST_PIXELS = 1 << 20

Arguments = tuple[list[float], list[float], list[float], float]


@dataclass(frozen=True)
class Camera:
    """A pinhole camera: right-handed, in units of the scene.

    ``position`` is where rays start, ``target`` a point on the axis of view, ``up`` a direction that appears upward in
    the picture, of any length. ``fov`` is the vertical field of view in degrees, 1e-6 to 179.99.
    """

    position: Sequence[float]
    target: Sequence[float]
    up: Sequence[float] = (0.0, 1.0, 0.0)
    fov: float = 45.0


def arguments(camera: Any) -> Arguments:
    """A camera, or a dict of its fields, as the module takes it.

    Raises TypeError for what is none, ValueError for points that have not three coordinates.
    """
    if isinstance(camera, Mapping):
        camera = Camera(**camera)
    if not isinstance(camera, Camera):
        raise TypeError(f"camera must be a brickwalk.Camera or a dict of its fields, not {type(camera).__name__}")

    def point(name: str) -> list[float]:
        try:
            values = np.asarray(getattr(camera, name), dtype=np.float64)
        except (TypeError, ValueError) as error:
            raise TypeError(f"camera: {name} must be three numbers: {error}") from error
        if values.shape != (3,):
            raise ValueError(f"camera: {name} must be three numbers; its shape is {values.shape}")
        return [float(value) for value in values]

    return point("position"), point("target"), point("up"), float(camera.fov)


def pinhole(camera: Camera | Mapping[str, Any], width: int, height: int) -> np.ndarray:
    """Rays through the centres of a picture's pixels.

    ``camera`` is a :class:`Camera` or a dict of its fields; ``width`` and ``height`` are in pixels, 1 to 1048576.
    Pixels are square, and row 0 is the upper edge. Returns float64 of shape (height, width, 6): origins and directions.
    The component of each direction along the axis of view is 1, so that distances are depths.

    Raises ValueError for a camera without a view, or a picture without pixels.
    """
    size = whole("width", width, 1, MOST_PIXELS), whole("height", height, 1, MOST_PIXELS)
    return _brickwalk.pinhole(arguments(camera), *size)

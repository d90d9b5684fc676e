"""Ray and distance queries on meshes larger than memory, from NumPy.

A scene is a ``.bricks`` file, written once by :func:`convert`, by the program ``brickwalk``, or from arrays. It is read
piece by piece as rays need it, through a cache of a size that you choose. The answers do not depend on that size.

    import brickwalk
    with brickwalk.Scene.open("city.bricks", cache="2G") as scene:
        rays = brickwalk.pinhole(brickwalk.Camera((0, 2, 9), (0, 1, 0)), 640, 360)
        hits = scene.cast_rays(rays)
        print(hits["t"].shape, hits["triangle"].dtype)  # (360, 640) uint32

Lengths are in units of the scene, metres where it came from glTF. Angles are in degrees.
"""

# First, so that its absence is an ordinary ImportError.
import numpy as _numpy  # noqa: F401

from . import trimesh
from ._brickwalk import BrickwalkError, WalkParts, __version__
from ._camera import Camera, pinhole
from ._convert import convert, generate
from ._picture import Picture
from ._scene import INVALID_ID, Scene
from .raycasting import RaycastingScene

__all__ = [
    "INVALID_ID",
    "BrickwalkError",
    "Camera",
    "Picture",
    "RaycastingScene",
    "Scene",
    "WalkParts",
    "__version__",
    "convert",
    "generate",
    "pinhole",
    "trimesh",
]

"""Models into scene files."""

from __future__ import annotations

import errno
import os
from collections.abc import Callable, Iterable
from typing import Any

from . import _brickwalk
from ._arrays import check_progress, whole

Path = str | os.PathLike[str]

MODELS = (".gltf", ".glb", ".obj", ".ply", ".stl")


def convert(
    inputs: Path | Iterable[Path],
    out: Path,
    *,
    progress: Callable[[int, int], Any] | None = None,
    brick_triangles: int | None = None,
    memory: str | int | None = None,
    threads: int | None = None,
    lattice: int | str | None = None,
    fast: bool | None = None,
    proxies: bool | None = None,
    lod: bool | None = None,
    textures: str | None = None,
    scratch: Path | None = None,
    resume: bool | None = None,
    drop_non_finite: bool | None = None,
    movable: Iterable[str] | None = None,
    instance_min_triangles: int | None = None,
    bake_budget: int | None = None,
    up: str | None = None,
    metres: float | None = None,
    within: Path | None = None,
) -> dict[str, Any]:
    """Converts models into one scene file, which appears whole or not at all.

    ``inputs`` is a path or several, of ``.gltf .glb .obj .ply .stl`` or ``tileset.json``; ``out`` ends in ``.bricks``.
    ``progress(done, total)`` is told the steps of the phase at hand; a total of 0 is not known. What is None is as the
    command ``brickwalk convert`` has it:

    ``brick_triangles`` most triangles of a brick, 1 to 1048576. ``memory`` bytes to get by with, as "4G"; what does not
    fit goes to ``scratch``. ``threads`` 1 to 4096. ``lattice`` log2 of the step that positions are rounded to, -126 to
    96, or "finest". ``fast`` builds trees sooner, for rays that take longer. ``proxies`` stores what stands for bricks
    (True). ``lod`` stores levels of detail (False). ``textures`` "bc7" or "raw". ``resume`` continues an interrupted
    conversion. ``drop_non_finite`` leaves out triangles that are not finite. ``movable`` names nodes that stay
    instances. ``instance_min_triangles`` least triangles of a mesh that is stored once for all its places.
    ``bake_budget`` most triangles of smaller meshes that are copied. ``up`` "y" or "z", and ``metres`` a unit stands
    for, of OBJ, PLY and STL. ``within`` a folder around the inputs: what they name is read there and below, and nowhere
    else; by default in each one's own folder.

    Returns a dict of counts: triangles, triangles_stored, instances, bricks, levels, bytes, dropped_zero_area,
    dropped_non_finite, and warnings, a list.

    Raises FileNotFoundError for a missing input, ValueError for a setting out of its range, BrickwalkError for a model
    that is damaged.
    """
    settings = {name: value for name, value in locals().items() if name not in ("inputs", "out", "progress")}
    names, target, settings = checked(inputs, out, progress, settings)
    return _brickwalk.convert(names, target, settings, progress)


def checked(
    inputs: Path | Iterable[Path],
    out: Path,
    progress: Callable[[int, int], Any] | None,
    settings: dict[str, Any],
) -> tuple[list[str], str, dict[str, Any]]:
    """The arguments of a conversion, as the extension takes them.

    Raises as :func:`convert` for what can be known before anything is read.
    """
    settings = {name: value for name, value in settings.items() if value is not None}
    check_progress(progress)
    paths = [inputs] if isinstance(inputs, (str, os.PathLike)) else list(inputs)
    if not paths:
        raise ValueError("there are no inputs")
    names = [os.fsdecode(os.fspath(path)) for path in paths]
    target = os.fsdecode(os.fspath(out))
    for name in names:
        if not os.path.exists(name):
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), name)
        if os.path.isdir(name):
            raise IsADirectoryError(errno.EISDIR, "this is a folder; name the models in it", name)
        if os.path.exists(target) and os.path.samefile(name, target):
            raise ValueError(f"{target}: the output would overwrite this input")
    if os.path.splitext(target)[1].lower() != ".bricks":
        raise ValueError(f"{target}: what is written is a scene file; end its name in .bricks")
    if os.path.isdir(target):
        raise IsADirectoryError(errno.EISDIR, "this is a folder; give the name of a file", target)
    folder = os.path.dirname(target) or "."
    if not os.path.isdir(folder):
        raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT), folder)
    if "movable" in settings:
        movable = settings["movable"]
        settings["movable"] = [movable] if isinstance(movable, str) else list(movable)
    return names, target, settings


def generate(
    kind: str,
    out: Path,
    *,
    triangles: int = 1_000_000,
    seed: int = 0,
    progress: Callable[[int, int], Any] | None = None,
) -> int:
    """Writes a generated scene, which appears whole or not at all. Equal arguments make equal scenes.

    ``kind`` is "city", "pipes" (a plant), "terrain" (woods), "stadium" or "cornell"; ``out`` ends in ``.bricks``.
    ``triangles`` is about how many there are with instances, at least 10,000 to 500,000 by kind, up to 150,000,000;
    ``seed`` 0 or greater.

    Returns the number of triangles with instances.

    Raises ValueError for a kind or a number that there is not, or for the name of ``out``.
    """
    check_progress(progress)
    target = os.fsdecode(os.fspath(out))
    if os.path.splitext(target)[1].lower() != ".bricks":
        raise ValueError(f"{target}: what is written is a scene file; end its name in .bricks")
    count, start = whole("triangles", triangles, 1, 150_000_000), whole("seed", seed, 0, (1 << 64) - 1)
    if not isinstance(kind, str):
        raise TypeError(f"kind must be text, not {type(kind).__name__}")
    return _brickwalk.generate(kind, target, count, start, progress)

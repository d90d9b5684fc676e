"""Arguments as arrays, and arrays that results go into."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

Shape = tuple[int, ...]


def as_array(given: Any, name: str) -> np.ndarray:
    """What was given as an array, without a copy where that is possible: arrays, what has ``__array_interface__`` or
    ``__array__``, DLPack, and nested lists of numbers.

    Raises TypeError for what is no array.
    """
    if isinstance(given, np.ma.MaskedArray):
        raise TypeError(f"{name}: masked arrays are not taken; fill them or leave the masked rows out")
    if isinstance(given, np.ndarray):
        return np.asarray(given)
    try:
        if hasattr(given, "__array_interface__") or hasattr(given, "__array__"):
            return np.asarray(given)
        if hasattr(given, "__dlpack__"):
            return np.from_dlpack(given)
        if callable(getattr(given, "numpy", None)):
            return np.asarray(given.numpy())
        array = np.asarray(given)
    except (TypeError, ValueError, RuntimeError, BufferError, OverflowError) as error:
        raise TypeError(f"{name} cannot be taken as an array: {error}") from error
    # Whole numbers in lists are numbers like others.
    return array.astype(np.float64) if array.dtype.kind in "iu" and array.size else array


def floats(given: Any, name: str, columns: tuple[int, ...]) -> tuple[np.ndarray, Shape]:
    """Rows of float32 or float64, shape (n, columns), and the shape that they had without the last axis.

    Raises TypeError for another dtype, ValueError for another shape.
    """
    array = as_array(given, name)
    if array.dtype.kind != "f" or array.dtype.itemsize not in (4, 8):
        raise TypeError(f"{name} must be float32 or float64, not {array.dtype}")
    if array.ndim == 0 or array.shape[-1] not in columns:
        wanted = " or ".join(f"(..., {count})" for count in columns)
        raise ValueError(f"{name} must have shape {wanted}, not {array.shape}")
    array = array.astype(array.dtype.newbyteorder("="), copy=False)
    if not array.flags.aligned:
        array = array.copy()
    lead = array.shape[:-1]
    return array.reshape(math.prod(lead), array.shape[-1]), lead


def faces(given: Any) -> np.ndarray:
    """Faces as int64 of shape (m, 3).

    Raises TypeError for a dtype that is not of integers, ValueError for another shape.
    """
    array = given if isinstance(given, np.ndarray) else np.asarray(as_list(given))
    if array.dtype.kind not in "iu":
        raise TypeError(f"faces must be integers, not {array.dtype}")
    if array.ndim != 2 or array.shape[1] != 3:
        raise ValueError(f"faces must have shape (m, 3), not {array.shape}")
    if array.dtype == np.uint64 and array.size and array.max() > np.iinfo(np.int64).max:
        row = int(np.argmax((array > np.iinfo(np.int64).max).any(axis=1)))
        raise ValueError(f"face {row} names vertex {array[row].max()}, which there is not")
    return np.ascontiguousarray(array, dtype=np.int64)


def as_list(given: Any) -> Any:
    """What was given, as NumPy takes it: lists of whole numbers stay whole."""
    return given if isinstance(given, (list, tuple)) else as_array(given, "faces")


class Results:
    """Arrays for results of ``lead`` shape: those of ``out`` where it has them, else new ones."""

    def __init__(self, out: Mapping[str, np.ndarray] | None, lead: Shape, rows: dict[str, tuple[Any, Shape]]):
        if out is not None and not isinstance(out, Mapping):
            raise TypeError("out must be a dict of arrays")
        unknown = set(out or {}) - set(rows)
        if unknown:
            raise ValueError(f"out: there is no result {sorted(map(str, unknown))[0]!r}; there are {', '.join(rows)}")
        self._lead, self._given = lead, dict(out or {})
        self._arrays = {name: self._array(name, np.dtype(dtype), tail) for name, (dtype, tail) in rows.items()}
        count = math.prod(lead)
        #: What is filled, of shape (n, ...): new arrays where those given are not of one piece.
        self.flat = {name: self._flat(array, (count, *rows[name][1])) for name, array in self._arrays.items()}

    def _array(self, name: str, dtype: np.dtype, tail: Shape) -> np.ndarray:
        shape = (*self._lead, *tail)
        array = self._given.get(name)
        if array is None:
            return np.empty(shape, dtype)
        if not isinstance(array, np.ndarray):
            raise TypeError(f"out[{name!r}] must be an array, not {type(array).__name__}")
        if array.dtype != dtype:
            raise TypeError(f"out[{name!r}] must be {dtype}, not {array.dtype}")
        if array.shape != shape:
            raise ValueError(f"out[{name!r}] must have shape {shape}, not {array.shape}")
        if not array.flags.writeable:
            raise ValueError(f"out[{name!r}] is read-only")
        return array

    @staticmethod
    def _flat(array: np.ndarray, shape: Shape) -> np.ndarray:
        return np.asarray(array).reshape(shape) if _is_whole(array) else np.empty(shape, array.dtype)

    def finish(self) -> dict[str, np.ndarray]:
        """The arrays, filled."""
        for name, array in self._arrays.items():
            if not _is_whole(array):
                array[...] = self.flat[name].reshape(array.shape)
        return self._arrays


#: Of a distance, and of the distance of a ray's origin from that of the scene: hits that are no farther apart are of
#: one point.
_SAME = 1e-11


def once(rays: np.ndarray, ray: np.ndarray, t: np.ndarray) -> np.ndarray:
    """Which hits to keep so that a point where triangles touch counts once: bool (h,). ``ray`` (h,) names those of
    ``rays`` (n, 6), and with ``t`` (h,) is in their order and that of distance. At an edge that two triangles share a
    ray meets both.
    """
    kept = np.ones(len(t), np.bool_)
    reach = np.abs(rays[:, :3]).max(axis=1, initial=0) / np.abs(rays[:, 3:6]).max(axis=1, initial=0)
    near = _SAME * (np.abs(t) + reach[ray])
    kept[1:] = (ray[1:] != ray[:-1]) | (t[1:] - t[:-1] > near[1:])
    return kept


def _is_whole(array: np.ndarray) -> bool:
    return bool(array.flags.c_contiguous and array.flags.aligned)


def check_progress(progress: Any) -> None:
    """Raises TypeError for what cannot be called."""
    if progress is not None and not callable(progress):
        raise TypeError("progress must be callable: it is given what is done, and the total")


def whole(name: str, value: Any, least: int, most: int) -> int:
    """A whole number of a range.

    Raises TypeError for what is no whole number, ValueError for one out of the range.
    """
    if isinstance(value, bool) or not hasattr(value, "__index__"):
        raise TypeError(f"{name} must be a whole number, not {type(value).__name__}")
    if not least <= int(value) <= most:
        raise ValueError(f"{name} is {value}; it must be from {least} to {most}")
    return int(value)

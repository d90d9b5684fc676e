"""Rendered pictures."""

from __future__ import annotations

import struct
import zlib
from typing import Any

import numpy as np


class Picture(dict[str, np.ndarray]):
    """Arrays of a rendered picture, by their names; a notebook shows it.

    ``radiance`` float32 (h, w, 3), linear Rec. 709; ``picture`` uint8 (h, w, 3), sRGB; and unless ``taa`` was on
    ``depth`` float32 (h, w), the distance along the ray of the pixel's centre, +inf on a miss; ``normal`` float32
    (h, w, 3), unit, toward the camera, 0 on a miss; ``triangle`` uint32 (h, w), 4294967295 on a miss; ``albedo``
    float32 (h, w, 3), linear. With ``frame_budget`` also ``state`` uint8 (h, w): 0 exact, 1 bounded, 2 unresolved.
    """

    def _repr_png_(self) -> bytes:
        return png(self["picture"])


def png(pixels: Any) -> bytes:
    """A PNG of uint8 pixels of shape (h, w, 3)."""
    height, width, _ = pixels.shape
    rows = np.zeros((height, 1 + 3 * width), np.uint8)
    rows[:, 1:] = pixels.reshape(height, 3 * width)

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    data = zlib.compress(rows.tobytes(), 6)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", data) + chunk(b"IEND", b"")

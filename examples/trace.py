#!/usr/bin/env python3
"""Measures a scene from above with rays: a map of heights, by NumPy and `brickwalk trace`.

    python3 trace.py rays SIDE rays.npy            a grid of rays straight down, over SIDE metres each way
    python3 trace.py heights hits.npy heights.png  what they hit, as a picture: bright is high
"""

import struct
import sys
import zlib

import numpy as np

GRID = 512
FROM = 1000.0


def rays(side):
    """(GRID * GRID, 8) of float64, a row a ray: origin, direction, t_min, t_max."""
    steps = (np.arange(GRID) + 0.5) / GRID * 2 * side - side
    x, z = np.meshgrid(steps, steps)
    rays = np.zeros((GRID * GRID, 8))
    rays[:, 0], rays[:, 1], rays[:, 2] = x.ravel(), FROM, z.ravel()
    rays[:, 4] = -1  # Straight down, so that t is in metres.
    rays[:, 7] = np.inf
    return rays


def heights(hits):
    """Heights in metres, NaN where there is nothing. The fields of a hit: t, triangle, u, v."""
    t = hits["t"].reshape(GRID, GRID)
    return np.where(np.isfinite(t), FROM - t, np.nan)


def write_png(path, grey):
    """Writes rows of bytes as a grey picture."""

    def chunk(name, data):
        return struct.pack(">I", len(data)) + name + data + struct.pack(">I", zlib.crc32(name + data))

    rows = b"".join(b"\0" + row.tobytes() for row in grey)
    head = struct.pack(">IIBBBBB", grey.shape[1], grey.shape[0], 8, 0, 0, 0, 0)
    with open(path, "wb") as file:
        chunks = chunk(b"IHDR", head) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
        file.write(b"\x89PNG\r\n\x1a\n" + chunks)


def main():
    command, first, second = sys.argv[1:]
    if command == "rays":
        np.save(second, rays(float(first)))
        return
    hits = np.load(first)
    found = heights(hits)
    low, high = np.nanmin(found), np.nanmax(found)
    print(f"{np.isfinite(found).mean():.0%} of the rays hit; heights from {low:.2f} to {high:.2f} m")
    print(f"{len(np.unique(hits['triangle'][np.isfinite(hits['t'])]))} triangles are seen")
    grey = np.nan_to_num((found - low) / max(high - low, 1e-9)) * 255
    write_png(second, grey.astype(np.uint8))


if __name__ == "__main__":
    main()

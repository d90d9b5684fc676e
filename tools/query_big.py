#!/usr/bin/env python3
"""Asks a scene larger than the cache from Python, and tells what was read and how much memory was held.

    pip install numpy target/python/wheels/brickwalk-*.whl
    brickwalk scene city --triangles 139M -o big.bricks
    tools/query_big.py big.bricks rays 10000000 --cache 256M
    tools/query_big.py big.bricks points 1000000 --cache 256M

Rays go from a random point of the scene's box to another. What the process holds is its greatest resident memory less
that before the scene was opened and less the caller's arrays, which are touched before. Times are of the whole call.
"""

import argparse
import resource
import time

import brickwalk
import numpy as np

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("scene", help="a .bricks file, or the URL of one")
parser.add_argument("what", choices=["rays", "points"])
parser.add_argument("count", type=int, help="rays or points")
parser.add_argument("--cache", default="256M", help="as of Scene.open [default: 256M]")
args = parser.parse_args()


def resident():
    """Bytes of memory that this process has now."""
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize()


with brickwalk.Scene.open(args.scene, adapter="cpu") as scene:
    low, high = np.asarray(scene.info["bounds"], float)
    bricks = scene.info["bricks"]
rng = np.random.default_rng(1)


def within(count):
    return (low + (high - low) * rng.random((count, 3))).astype(np.float32)


given = within(args.count)
if args.what == "rays":
    targets = within(args.count)
    given = np.concatenate([given, targets - given], axis=1)
    del targets
    dtype = [("t", "f8"), ("triangle", "u4"), ("uv", "f4", 2), ("normal", "f4", 3)]
else:
    dtype = [("points", "f8", 3), ("distance", "f8"), ("triangle", "u4"), ("uv", "f4", 2), ("normal", "f4", 3)]
results = {}
for name, kind, *shape in dtype:
    results[name] = np.zeros((args.count, *shape), kind)
    results[name].fill(1)
# The greatest memory so far counts from here.
with open("/proc/self/clear_refs", "w") as file:
    file.write("5")
before = resident()
with brickwalk.Scene.open(args.scene, cache=args.cache, adapter="cpu") as scene:
    start = time.perf_counter()
    (scene.cast_rays if args.what == "rays" else scene.closest_points)(given, out=results)
    seconds = time.perf_counter() - start
    stats = scene.stats()
with open("/proc/self/status") as file:
    peak = next(int(line.split()[1]) * 1024 for line in file if line.startswith("VmHWM"))
print(f"{args.count} {args.what}, {bricks} bricks, cache {args.cache}: {seconds:.1f} s, {(peak - before) / 1e6:.0f} MB held")
for name, value in stats.items():
    print(f"  {name}: {value}")

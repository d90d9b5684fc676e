#!/usr/bin/env python3
"""Compares queries of the Python package with Open3D's and embreex's on the same triangles, in turns, and judges where
they differ.

    pip install open3d embreex trimesh numpy target/python/wheels/brickwalk-*.whl
    brickwalk scene city --triangles 1M -o city.glb
    tools/query_peers.py city.glb [--rays 1000000] [--points 100000] [--turns 7]

A row is a query: medians of seconds over the turns, and how often a peer is as fast. Which of two answers is right is
found by brute force over all triangles in f64, for at most --judged of those that differ. Excused is a ray that meets
an edge to a thousandth of a triangle, or to two steps of the lattice that positions are rounded to. Hits that are as
near to a part in 10^5 do not differ. The exit status is 1 where ours is neither right nor excused.
--threads 1 has brickwalk and Open3D use one thread; embreex always does.
"""

import argparse
import os
import statistics
import sys
import time

import numpy as np

parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
parser.add_argument("mesh", help="a model that trimesh reads")
parser.add_argument("--rays", type=int, default=1_000_000)
parser.add_argument("--points", type=int, default=100_000)
parser.add_argument("--turns", type=int, default=7)
parser.add_argument("--threads", type=int, default=0, help="0: all")
parser.add_argument("--judged", type=int, default=100, help="differences that are judged, of each query")
parser.add_argument("--only", default="", help="queries whose names have one of these words, as hits,distance")
args = parser.parse_args()
if args.threads:
    os.environ["RAYON_NUM_THREADS"] = str(args.threads)

import brickwalk  # noqa: E402
import open3d as o3d  # noqa: E402
import trimesh  # noqa: E402
from trimesh.ray.ray_pyembree import RayMeshIntersector  # noqa: E402

mesh = trimesh.load(args.mesh, force="mesh", process=False)
vertices, faces = np.asarray(mesh.vertices, np.float32), np.asarray(mesh.faces, np.uint32)
low, high = vertices.min(0).astype(float), vertices.max(0).astype(float)
peer = o3d.t.geometry.RaycastingScene(nthreads=args.threads)
peer.add_triangles(vertices, faces)
embree = RayMeshIntersector(mesh, scale_to_box=False)
ours = brickwalk.Scene.from_arrays(vertices, faces, cache="100%", adapter="cpu")

rng = np.random.default_rng(1)


def within(count):
    return low + (high - low) * rng.random((count, 3))


def rays_of(origins, targets):
    return np.concatenate([origins, targets - origins], axis=1).astype(np.float32)


width = int((args.rays * 16 / 9) ** 0.5)
middle = 0.5 * (low + high)
eye = middle + 0.35 * (high - low).max() * np.array([0.6, 0.35, 1.0])
coherent = brickwalk.pinhole(brickwalk.Camera(tuple(eye), tuple(middle), fov=45), width, args.rays // width)
coherent = coherent.reshape(-1, 6).astype(np.float32)
random = rays_of(within(args.rays), within(args.rays))
points = within(args.points).astype(np.float32)

# Shares of a triangle's size and of a distance within which answers may differ.
EDGE, NEAR = 1e-3, 1e-5
corners = vertices[faces].astype(np.float64)
# A step of the lattice that positions are rounded to, at most, and the longest sides of triangles.
STEP = 2.0 ** (np.ceil(np.log2(np.abs(corners).max())) - 24)
sides = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=2).max(axis=1)


def brute(ray):
    """Distances, triangles and least weights, in margins, of all that a ray meets, in f64."""
    a, b, c = (corners[:, k] - ray[:3].astype(float) for k in range(3))
    d = ray[3:].astype(float)
    edges = np.stack([np.cross(b, c) @ d, np.cross(c, a) @ d, np.cross(a, b) @ d], axis=1)
    total = edges.sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        weights = edges / total[:, None]
        t = np.einsum("ij,ij->i", a, np.cross(b, c)) / total
    # What two steps are of a triangle's least height, as the ray sees it.
    with np.errstate(divide="ignore"):
        margins = EDGE + 2 * STEP * sides * np.linalg.norm(d) / np.abs(total)
    least = weights.min(1) / margins
    near = (least > -1) & np.isfinite(t) & (t > -NEAR)
    order = np.argsort(t[near])
    return t[near][order], np.flatnonzero(near)[order], least[near][order]


def meet(rays, triangles):
    """Where each ray meets the triangle at its place, and the least of the weights, in margins, in f64."""
    a, b, c = (corners[triangles, k] - rays[:, :3].astype(float) for k in range(3))
    d = rays[:, 3:].astype(float)
    edges = np.stack([(np.cross(u, v) * d).sum(1) for u, v in ((b, c), (c, a), (a, b))], axis=1)
    total = edges.sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        margins = EDGE + 2 * STEP * sides[triangles] * np.linalg.norm(d, axis=1) / np.abs(total)
        return (a * np.cross(b, c)).sum(1) / total, (edges / total[:, None]).min(1) / margins


def judge_hits(rays, mine, theirs):
    """Hits that differ and are not as near, how many of them were judged, and of how many ours and theirs are those of
    brute force."""
    differ = np.flatnonzero(mine != theirs)
    both = differ[(mine[differ] != brickwalk.INVALID_ID) & (theirs[differ] != brickwalk.INVALID_ID)]
    (t, least), (other_t, other_least) = (meet(rays[both], found[both]) for found in (mine, theirs))
    tied = both[(np.abs(t - other_t) <= NEAR) & (least > -1) & (other_least > -1)]
    differ = np.setdiff1d(differ, tied)
    chosen = differ if len(differ) <= args.judged else rng.choice(differ, args.judged, replace=False)
    right = [0, 0]
    for ray in chosen:
        t, triangles, least = brute(rays[ray])
        surely = np.flatnonzero((least > 1) & (t > NEAR))
        limit = t[surely[0]] if len(surely) else np.inf
        # Edges before the first certain hit, and what lies as near as that.
        allowed = set(triangles[t <= limit * (1 + NEAR) + NEAR])
        if not len(surely):
            allowed.add(np.uint32(brickwalk.INVALID_ID))
        for side, found in enumerate((mine[ray], theirs[ray])):
            right[side] += found in allowed
    return len(differ), len(chosen), right


def judge_counts(rays, mine, theirs):
    differ = np.flatnonzero(mine != theirs)
    chosen = differ if len(differ) <= args.judged else rng.choice(differ, args.judged, replace=False)
    right = [0, 0]
    for ray in chosen:
        t, _, least = brute(rays[ray])
        certain = ((least > 1) & (t > NEAR)).sum()
        for side, found in enumerate((mine[ray], theirs[ray])):
            right[side] += certain <= found <= len(t)
    return len(differ), len(chosen), right


def judge_any(rays, mine, theirs):
    differ = np.flatnonzero(mine != theirs)
    chosen = differ[: args.judged]
    right = [0, 0]
    for ray in chosen:
        t, _, least = brute(rays[ray])
        allowed = {bool(len(t)), bool(((least > 1) & (t > NEAR)).any())}
        for side, found in enumerate((mine[ray], theirs[ray])):
            right[side] += bool(found) in allowed
    return len(differ), len(chosen), right


def nearest(point):
    """The distance of a point from the nearest triangle: from its plane's point where that is inside, or its edges."""
    p = point.astype(float)
    best = np.inf
    for k in range(3):
        a, along = corners[:, k] - p, corners[:, (k + 1) % 3] - corners[:, k]
        with np.errstate(divide="ignore", invalid="ignore"):
            part = np.clip(np.nan_to_num(-(a * along).sum(1) / (along * along).sum(1)), 0, 1)
        best = min(best, np.linalg.norm(a + along * part[:, None], axis=1).min())
    a, b, c = (corners[:, k] - p for k in range(3))
    normal = np.cross(b - a, c - a)
    area = (normal * normal).sum(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        foot = normal * ((a * normal).sum(1) / area)[:, None]
    weights = [(np.cross(u - foot, v - foot) * normal).sum(1) for u, v in ((b, c), (c, a), (a, b))]
    inside = (np.min(weights, axis=0) >= 0) & (area > 0)
    return min(best, np.linalg.norm(foot[inside], axis=1).min(initial=np.inf))


def judge_distances(mine, theirs):
    bound = NEAR * (1 + np.abs(vertices).max())
    differ = np.flatnonzero(np.abs(mine - theirs) > bound)
    right = [0, 0]
    for point in differ[: args.judged]:
        truth = nearest(points[point])
        for side, found in enumerate((mine[point], theirs[point])):
            right[side] += bool(abs(found - truth) <= bound)
    return len(differ), min(len(differ), args.judged), right


def embree_first(rays):
    return embree.intersects_first(rays[:, :3].astype(float), rays[:, 3:].astype(float))


def of_embree(first):
    return np.where(first < 0, brickwalk.INVALID_ID, first).astype(np.uint32)


def open3d_cast(rays):
    return peer.cast_rays(o3d.core.Tensor(rays), nthreads=args.threads)["primitive_ids"].numpy()


rows = []
for name, rays in (("closest hits, coherent", coherent), ("closest hits, random", random)):
    rows.append((
        name,
        lambda rays=rays: ours.cast_rays(rays)["triangle"],
        {"Open3D": lambda rays=rays: open3d_cast(rays), "embreex": lambda rays=rays: embree_first(rays)},
        lambda mine, theirs, who, rays=rays: judge_hits(rays, mine, of_embree(theirs) if who == "embreex" else theirs),
    ))
rows += [
    (
        "occlusion, random",
        lambda: ours.test_occlusions(random),
        {
            "Open3D": lambda: peer.test_occlusions(o3d.core.Tensor(random), nthreads=args.threads).numpy(),
            "embreex": lambda: embree.intersects_any(random[:, :3].astype(float), random[:, 3:].astype(float)),
        },
        lambda mine, theirs, who: judge_any(random, mine, theirs),
    ),
    (
        "count, random",
        lambda: ours.count_intersections(random),
        {"Open3D": lambda: peer.count_intersections(o3d.core.Tensor(random), nthreads=args.threads).numpy()},
        lambda mine, theirs, who: judge_counts(random, mine, theirs),
    ),
    (
        "distance",
        lambda: ours.distance(points),
        {"Open3D": lambda: peer.compute_distance(o3d.core.Tensor(points), nthreads=args.threads).numpy()},
        lambda mine, theirs, who: judge_distances(mine, theirs),
    ),
]
print(f"{len(faces):,} triangles, {len(random):,} rays, {len(points):,} points, {args.threads or 'all'} threads")
print("| query | brickwalk, s | peer | s | peer / brickwalk | differ | judged | ours right | theirs right |")
print("| --- | --- | --- | --- | --- | --- | --- | --- | --- |")
wrong = False
for name, mine, peers, judge in rows:
    if not any(word in name for word in args.only.split(",")):
        continue
    answers, seconds = {}, {who: [] for who in ("ours", *peers)}
    for _ in range(args.turns):
        for who, call in (("ours", mine), *peers.items()):
            start = time.perf_counter()
            answers[who] = call()
            seconds[who].append(time.perf_counter() - start)
    own = statistics.median(seconds["ours"])
    for who in peers:
        theirs = statistics.median(seconds[who])
        differ, judged, right = judge(answers["ours"], answers[who], who)
        wrong |= right[0] != judged
        times = f"{own:.3g} | {who} | {theirs:.3g} | {theirs / own:.2f}"
        print(f"| {name} | {times} | {differ} | {judged} | {right[0]} | {right[1]} |", flush=True)
sys.exit(int(wrong))

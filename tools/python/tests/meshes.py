"""Generated meshes, and what rays hit by brute force in float64: Möller and Trumbore, without any of brickwalk's code.

Coordinates are multiples of 1/1024, which a scene file stores as they are.
"""

import numpy as np

#: Weights closer to an edge than this leave open which triangle is hit: the decision is made in float32.
EDGE = 1e-4


def on_lattice(points):
    return np.round(np.asarray(points, np.float64) * 1024) / 1024


def soup(count, seed=0):
    """Triangles anywhere in a box of side 10, of sizes about 1."""
    rng = np.random.default_rng(seed)
    centres = rng.uniform(-5, 5, (count, 1, 3))
    vertices = on_lattice(centres + rng.uniform(-1, 1, (count, 3, 3))).reshape(-1, 3)
    return vertices, np.arange(3 * count).reshape(count, 3)


def sphere(rings=24, sectors=32, radius=2.0, centre=(0.0, 0.0, 0.0)):
    """A closed sphere of latitudes and longitudes, turned outward."""
    theta = np.linspace(0, np.pi, rings + 1)[1:-1]
    phi = np.linspace(0, 2 * np.pi, sectors, endpoint=False)
    ring = np.stack(
        [
            np.sin(theta)[:, None] * np.cos(phi),
            np.cos(theta)[:, None] * np.ones_like(phi),
            np.sin(theta)[:, None] * np.sin(phi),
        ],
        axis=-1,
    ).reshape(-1, 3)
    vertices = on_lattice(np.vstack([ring, [[0, 1, 0], [0, -1, 0]]]) * radius + np.asarray(centre))
    faces = []
    for i in range(rings - 2):
        for j in range(sectors):
            a, b = i * sectors + j, i * sectors + (j + 1) % sectors
            faces += [[a, b, a + sectors], [b, b + sectors, a + sectors]]
    top, bottom = len(ring), len(ring) + 1
    last = (rings - 2) * sectors
    for j in range(sectors):
        faces += [[top, (j + 1) % sectors, j], [bottom, last + j, last + (j + 1) % sectors]]
    return vertices, np.array(faces)


def box(low=(0.0, 0.0, 0.0), high=(1.0, 1.0, 1.0)):
    """A closed box of twelve triangles, turned outward."""
    corners = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], np.float64)
    vertices = np.asarray(low) + corners * (np.asarray(high, np.float64) - np.asarray(low))
    quads = [[0, 1, 3, 2], [4, 6, 7, 5], [0, 4, 5, 1], [2, 3, 7, 6], [0, 2, 6, 4], [1, 5, 7, 3]]
    return vertices, np.array([t for a, b, c, d in quads for t in ([a, b, c], [a, c, d])])


def random_rays(count, seed=1, reach=8.0):
    rng = np.random.default_rng(seed)
    origins = rng.uniform(-reach, reach, (count, 3))
    return np.hstack([origins, rng.uniform(-5, 5, (count, 3)) - origins])


def crossings(rays, vertices, faces):
    """Distances and weights of all rays at all triangles' planes: t, u, v of shape (rays, triangles)."""
    a, b, c = (vertices[faces[:, k]].astype(np.float64) for k in range(3))
    origins, directions = rays[:, None, :3].astype(np.float64), rays[:, None, 3:6].astype(np.float64)
    e, f = (b - a)[None], (c - a)[None]
    p = np.cross(directions, f)
    determinant = (e * p).sum(-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        s = origins - a[None]
        u = (s * p).sum(-1) / determinant
        q = np.cross(s, e)
        v = (directions * q).sum(-1) / determinant
        t = (f * q).sum(-1) / determinant
    return t, u, v


def brute_force(rays, vertices, faces):
    """The closest hits of rays: t, triangle (-1 on a miss), uv; and whether each is certain, which rays by an edge or
    at nearly equal distances are not."""
    t, u, v = crossings(rays, vertices, faces)
    near, far = (rays[:, 6:7], rays[:, 7:8]) if rays.shape[1] == 8 else (0.0, np.inf)
    least = np.minimum(np.minimum(u, v), 1 - u - v)
    # NaN compares as false.
    in_range = (t >= near) & (t <= far)
    hit = in_range & (least >= 0)
    distance = np.where(hit, t, np.inf)
    triangle = distance.argmin(1)
    best = distance.min(1)
    margin = 1e-5 * (1 + np.abs(np.where(np.isfinite(best), best, 0)))[:, None]
    open_edge = (np.abs(least) <= EDGE) & (t >= near - margin) & (t <= np.minimum(far, best[:, None] + margin))
    with np.errstate(invalid="ignore"):
        at_ends = (least > -EDGE) & ((np.abs(t - near) < margin) | (np.abs(t - far) < margin))
        close = (hit & (np.abs(t - best[:, None]) < margin)).sum(1) > 1
    certain = ~(open_edge.any(1) | at_ends.any(1) | close)
    rows = np.arange(len(rays))
    uv = np.stack([u[rows, triangle], v[rows, triangle]], -1)
    missed = np.isinf(best)
    triangle = np.where(missed, -1, triangle)
    return best, triangle, np.where(missed[:, None], 0, uv), certain


def normals(vertices, faces):
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    n = np.cross(b - a, c - a)
    return n / np.linalg.norm(n, axis=1, keepdims=True)


def closest(points, vertices, faces):
    """The nearest points of a mesh to points, and their distances: the foot on each plane where it is within the
    triangle, else the nearest on its edges."""
    a, b, c = (vertices[faces[:, k]] for k in range(3))
    p = points[:, None]
    n = np.cross(b - a, c - a)
    foot = p - ((p - a) * n).sum(-1, keepdims=True) / (n * n).sum(-1)[None, :, None] * n
    within = np.ones(foot.shape[:2], bool)
    for s, t in ((a, b), (b, c), (c, a)):
        within &= (np.cross(t - s, foot - s) * n).sum(-1) >= 0
    candidates = [np.where(within[..., None], foot, np.inf)]
    for s, t in ((a, b), (b, c), (c, a)):
        along = np.clip(((p - s) * (t - s)).sum(-1) / ((t - s) ** 2).sum(-1), 0, 1)
        candidates.append(s + along[..., None] * (t - s))
    candidates = np.stack(candidates)
    with np.errstate(invalid="ignore"):
        distances = np.linalg.norm(candidates - p, axis=-1)
    flat = np.moveaxis(distances, 1, 0).reshape(len(points), -1)
    best = flat.argmin(1)
    found = np.moveaxis(candidates, 1, 0).reshape(len(points), -1, 3)[np.arange(len(points)), best]
    return found, flat[np.arange(len(points)), best]

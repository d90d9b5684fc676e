//! Where secondary rays start: no hit of the surface they leave, no way out of a closed box.

use crate::math::exact::tests::*;

/// How a secondary ray leaves its surface.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Leave {
    /// [`surface_point`] and [`offset_origin`].
    Offset,
    /// The offset, from barycentrics that are not inset.
    NoInset,
    /// The point itself; only the triangle's id is excluded.
    IdOnly,
}

/// Nearest triangle other than `except` along a ray from `origin`.
fn trace(triangles: &[Triangle], origin: [f32; 3], d: [f32; 3], except: usize) -> Option<(usize, TriangleHit)> {
    let f = ray_frame(d);
    let relative = |v: [f32; 3]| zip(v, origin, |v, o| v - o);
    let mut best: Option<(usize, TriangleHit)> = None;
    for (id, t) in triangles.iter().enumerate().filter(|&(id, _)| id != except) {
        let hit = intersect_triangle(&f, relative(t[0]), relative(t[1]), relative(t[2]), 0.0);
        if hit.hit && best.is_none_or(|(_, b)| hit.t < b.t) {
            best = Some((id, hit));
        }
    }
    best
}

fn leave(how: Leave, t: &Triangle, hit: &TriangleHit, d: [f32; 3]) -> ([f32; 3], [f32; 3]) {
    let mut s = surface_point(t[0], t[1], t[2], hit, d);
    if how != Leave::Offset {
        s.p = weighted([hit.u, hit.v, hit.w].map(|x| divide(x, hit.det)), t[0], t[1], t[2]);
    }
    let origin = if how == Leave::IdOnly { s.p } else { offset_origin(&s) };
    (origin, s.n)
}

/// A direction on the side of n, one in four nearly along the surface.
fn direction(rng: &mut Rng, n: [f32; 3]) -> [f32; 3] {
    let mut r = [rng.signed(), rng.signed(), rng.signed()];
    let along = dot(r, n);
    if rng.below(4) == 0 {
        let lift = 1e-3 * rng.unit() + 1e-5;
        r = zip(r, n, |r, n| r - (along - lift) * n);
    } else if along < 0.0 {
        r = r.map(|x| -x);
    }
    r
}

/// Vectors of a lattice of 2^-14 that span a skewed box, and its origin away from the frame's.
fn span(rng: &mut Rng) -> ([f32; 3], [[f32; 3]; 3]) {
    let lattice = |x: f32| (x * 16_384.0).round() / 16_384.0;
    let base = [rng.signed() * 200.0, rng.signed() * 200.0, rng.signed() * 200.0].map(lattice);
    let mut axes = [[0.0; 3]; 3];
    for (k, axis) in axes.iter_mut().enumerate() {
        *axis = [rng.signed() * 0.4, rng.signed() * 0.4, rng.signed() * 0.4];
        axis[k] += 1.0 + rng.unit();
        *axis = axis.map(lattice);
    }
    (base, axes)
}

fn corner(base: [f32; 3], axes: &[[f32; 3]; 3], i: [f32; 3]) -> [f32; 3] {
    [0, 1, 2].map(|k| base[k] + i[0] * axes[0][k] + i[1] * axes[1][k] + i[2] * axes[2][k])
}

fn two_triangles(q: [[f32; 3]; 4]) -> [Triangle; 2] {
    [[q[0], q[1], q[2]], [q[0], q[2], q[3]]]
}

/// Secondary rays from a flat 4x4 grid of quads that hit the grid again, of about 80,000.
fn self_hits(how: Leave) -> usize {
    let mut rng = Rng(9);
    let mut count = 0;
    for _ in 0..400 {
        let (base, axes) = span(&mut rng);
        let mut triangles = Vec::new();
        for (i, j) in (0..16).map(|k| ((k / 4) as f32, (k % 4) as f32)) {
            let at = |i: f32, j: f32| corner(base, &axes, [i, j, 0.0]);
            triangles.extend(two_triangles([at(i, j), at(i + 1.0, j), at(i + 1.0, j + 1.0), at(i, j + 1.0)]));
        }
        for _ in 0..200 {
            let above = if rng.below(2) == 0 { 3.0 } else { -3.0 };
            let origin = corner(base, &axes, [4.0 * rng.unit(), 4.0 * rng.unit(), above]);
            let aim = corner(base, &axes, [4.0 * rng.unit(), 4.0 * rng.unit(), 0.0]);
            let d = zip(aim, origin, |a, o| a - o);
            let Some((id, hit)) = trace(&triangles, origin, d, usize::MAX) else { continue };
            let (o, n) = leave(how, &triangles[id], &hit, d);
            count += usize::from(trace(&triangles, o, direction(&mut rng, n), id).is_some());
        }
    }
    count
}

#[test]
fn no_ray_hits_the_plane_it_leaves() {
    assert_eq!(self_hits(Leave::Offset), 0);
    let control = self_hits(Leave::IdOnly);
    assert!(control > 100, "the control must show: {control}");
}

/// Secondary rays from points near the edges of a closed box that leave it without a hit, of about 80,000.
fn leaks(how: Leave) -> usize {
    let mut rng = Rng(10);
    let mut count = 0;
    for _ in 0..400 {
        let (base, axes) = span(&mut rng);
        let mut triangles = Vec::new();
        for axis in 0..3 {
            for side in [0.0, 1.0] {
                let quad = [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]].map(|[x, y]| {
                    let mut i = [side; 3];
                    (i[(axis + 1) % 3], i[(axis + 2) % 3]) = (x, y);
                    corner(base, &axes, i)
                });
                triangles.extend(two_triangles(quad));
            }
        }
        for _ in 0..200 {
            let inside = [0, 1, 2].map(|_| 0.2 + 0.6 * rng.unit());
            let origin = corner(base, &axes, inside);
            // On an edge of the box or within a millionth of it.
            let mut edge = [0, 1, 2].map(|_| rng.below(2) as f32 + 1e-6 * rng.signed() * rng.below(2) as f32);
            edge[rng.below(3) as usize] = rng.unit();
            let d = zip(corner(base, &axes, edge), origin, |a, o| a - o);
            let Some((id, hit)) = trace(&triangles, origin, d, usize::MAX) else {
                count += 1;
                continue;
            };
            let (o, n) = leave(how, &triangles[id], &hit, d);
            count += usize::from(trace(&triangles, o, direction(&mut rng, n), id).is_none());
        }
    }
    count
}

#[test]
fn no_ray_leaves_a_closed_box() {
    assert_eq!(leaks(Leave::Offset), 0);
    let control = leaks(Leave::NoInset);
    assert!(control > 20, "the control must show: {control}");
}

#[test]
fn normals_are_unit_and_face_the_ray() {
    let mut rng = Rng(11);
    for _ in 0..20_000 {
        let mut vertex = || [rng.signed(), rng.signed(), 3.0 + rng.unit()];
        let (t, d) = ([vertex(), vertex(), vertex()], [rng.signed() * 0.2, rng.signed() * 0.2, 1.0]);
        let hit = intersect_triangle(&ray_frame(d), t[0], t[1], t[2], 0.0);
        if !hit.hit {
            continue;
        }
        let s = surface_point(t[0], t[1], t[2], &hit, d);
        let length: f64 = s.n.iter().map(|&x| f64::from(x).powi(2)).sum::<f64>().sqrt();
        assert!((length - 1.0).abs() < 3e-7, "{length}");
        assert!(dot(s.n, d) <= 0.0);
        // On the plane, within the distance that the offset clears.
        let plane: f64 = (0..3).map(|k| f64::from(s.n[k]) * (f64::from(s.p[k]) - f64::from(t[0][k]))).sum();
        assert!(plane.abs() <= f64::from(s.delta), "{plane} {}", s.delta);
        let o = offset_origin(&s);
        assert!((0..3).all(|k| if s.down >> k & 1 != 0 { o[k] < s.p[k] } else { o[k] > s.p[k] }), "{s:?} {o:?}");
    }
}

#[test]
fn offsets_of_known_points() {
    let ulp = f32::EPSILON;
    assert_eq!(offset_component(1.0, 0.0, false), 1.0 + ulp);
    assert_eq!(offset_component(1.0, 0.0, true), 1.0 - ulp / 2.0);
    assert_eq!(offset_component(-1.0, 0.0, false), -1.0 + ulp / 2.0);
    assert_eq!(offset_component(-1.0, 0.0, true), -1.0 - ulp);
    assert_eq!(offset_component(0.0, 0.0, false), LEAST_COORDINATE);
    assert_eq!(offset_component(-0.0, 0.0, true), -LEAST_COORDINATE);
    assert_eq!(offset_component(1.0, 0.5, false), 1.5);
    // A normal along an axis: its zero components move to the side that the ray came from.
    let t = [[-1.0, -1.0, 4.0], [1.0, -1.0, 4.0], [0.0, 1.0, 4.0]];
    let d = [0.25, -0.25, 4.0];
    let hit = intersect_triangle(&ray_frame(d), t[0], t[1], t[2], 0.0);
    let s = surface_point(t[0], t[1], t[2], &hit, d);
    assert_eq!((s.n.map(f32::abs), s.n[2], s.down), ([0.0, 0.0, 1.0], -1.0, 0b101));
    // A line instead of a triangle: no direction is undefined.
    let flat = TriangleHit { hit: true, t: 1.0, u: 1.0, v: 1.0, w: 1.0, det: 3.0 };
    let s = surface_point([1.0; 3], [2.0; 3], [3.0; 3], &flat, d);
    assert_eq!(s.n, [0.0, 0.0, -1.0]);
    assert!(s.p.iter().all(|x| x.is_finite()));
}

//! Levels of detail: what they stand for, how far they are from it, that nothing but the scene decides on them.

use super::bounded::{Computed, bounded, bytes};
use super::decode::{DecodedBrick, decode, decode_levels};
use super::scenes::*;
use bricks::{
    Layers, Level, MATERIAL_BLEND, MATERIAL_FURTHER, MATERIAL_LAYERS, MATERIAL_MASK, MATERIAL_MORE, MATERIAL_REFRACTS,
    Material, NONE, Resident, pack_absorption,
};
use brickwalk_convert::build::{BuildError, BuildSettings, build_source};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Primitive, SourceScene, SourceTexture};
use std::path::Path;
use std::sync::atomic::{AtomicBool, Ordering};

type Vec3 = [f64; 3];

fn with_levels(brick_triangles: u32) -> BuildSettings {
    BuildSettings { lod: true, ..settings(brick_triangles) }
}

/// Boxes of all sizes on a large plane, each of 12 triangles.
fn blocks(count: u32) -> Primitive {
    let mut random = Random(5);
    let mut triangles = vec![
        [[-60.0, 0.0, -60.0], [60.0, 0.0, 60.0], [60.0, 0.0, -60.0]],
        [[-60.0, 0.0, -60.0], [-60.0, 0.0, 60.0], [60.0, 0.0, 60.0]],
    ];
    for _ in 0..count {
        let size: Vec3 = [0.3 + random.next(), 0.2 + 4.0 * random.next().powi(3), 0.3 + random.next()];
        let at = [100.0 * (random.next() - 0.5), 0.0, 100.0 * (random.next() - 0.5)];
        let corner = |i: usize| -> Vec3 { std::array::from_fn(|k| at[k] + size[k] * f64::from(i as u32 >> k & 1)) };
        for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            let [a, b, c, d] = [a, b, c, d].map(corner);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup(&triangles)
}

fn scattered(count: u32) -> Primitive {
    let mut random = Random(11);
    let triangle = |number: u32| {
        let at = random.point(40.0);
        let size = if number.is_multiple_of(499) { 20.0 } else { 0.5 };
        [random.point(size), random.point(size), random.point(size)].map(|p| std::array::from_fn(|k| at[k] + p[k]))
    };
    soup(&(0..count).map(triangle).collect::<Vec<_>>())
}

fn instanced() -> SourceScene {
    let turned = matrix(rotation(0.7, [1.0, 2.0, 1.5]), [3.0, 1.0, -2.0]);
    let mirrored = matrix(rotation(2.1, [-1.0, 1.0, 1.0]), [-13.0, 4.0, 1.0]);
    let meshes = vec![mesh("sheet", vec![sheet(60, 10.0)]), mesh("part", vec![sheet(50, 4.0)])];
    let placements = vec![placement("a", 1, turned), placement("b", 0, IDENTITY), placement("c", 1, mirrored)];
    scene(meshes, placements)
}

/// Scenes of several kinds by name.
fn kinds() -> Vec<(&'static str, SourceScene)> {
    vec![
        ("blocks", plain(vec![blocks(900)])),
        ("sheet", plain(vec![sheet(80, 30.0)])),
        ("soup", plain(vec![scattered(9000)])),
        ("instances", instanced()),
    ]
}

fn sub(a: Vec3, b: Vec3) -> Vec3 {
    std::array::from_fn(|k| a[k] - b[k])
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vec3, b: Vec3) -> Vec3 {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn to_segment2(p: Vec3, a: Vec3, b: Vec3) -> f64 {
    let (ab, ap) = (sub(b, a), sub(p, a));
    let t = if dot(ab, ab) > 0.0 { (dot(ap, ab) / dot(ab, ab)).clamp(0.0, 1.0) } else { 0.0 };
    let d = std::array::from_fn(|k| ap[k] - t * ab[k]);
    dot(d, d)
}

/// The square of the distance from a triangle: of its plane where the foot lies inside, else of an edge.
fn distance2(p: Vec3, [a, b, c]: [Vec3; 3]) -> f64 {
    let n = cross(sub(b, a), sub(c, a));
    let is_inside = |a: Vec3, b: Vec3| dot(cross(sub(b, a), sub(p, a)), n) >= 0.0;
    if dot(n, n) > 0.0 && is_inside(a, b) && is_inside(b, c) && is_inside(c, a) {
        return dot(sub(p, a), n).powi(2) / dot(n, n);
    }
    to_segment2(p, a, b).min(to_segment2(p, b, c)).min(to_segment2(p, c, a))
}

/// A tree of boxes over triangles, halved along the longest axis.
enum Tree {
    Leaf(Vec<[Vec3; 3]>),
    Both([Vec3; 2], Box<[Tree; 2]>),
}

impl Tree {
    fn over(mut triangles: Vec<[Vec3; 3]>) -> Self {
        if triangles.len() <= 4 {
            return Self::Leaf(triangles);
        }
        let points = || triangles.iter().flatten();
        let low: Vec3 = std::array::from_fn(|k| points().map(|p| p[k]).fold(f64::MAX, f64::min));
        let high: Vec3 = std::array::from_fn(|k| points().map(|p| p[k]).fold(f64::MIN, f64::max));
        let size = sub(high, low);
        let axis = (0..3).max_by(|&a, &b| size[a].total_cmp(&size[b])).unwrap();
        let middle = |t: &[Vec3; 3]| t[0][axis] + t[1][axis] + t[2][axis];
        triangles.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let right = triangles.split_off(triangles.len() / 2);
        Self::Both([low, high], Box::new([Self::over(triangles), Self::over(right)]))
    }

    fn nearest2(&self, p: Vec3, best: &mut f64) {
        match self {
            Self::Leaf(triangles) => triangles.iter().for_each(|&t| *best = best.min(distance2(p, t))),
            Self::Both([low, high], children) => {
                let beyond: Vec3 = std::array::from_fn(|k| (low[k] - p[k]).max(p[k] - high[k]).max(0.0));
                if dot(beyond, beyond) < *best {
                    children.iter().for_each(|child| child.nearest2(p, best));
                }
            }
        }
    }

    fn distance(&self, p: Vec3) -> f64 {
        let mut best = f64::INFINITY;
        self.nearest2(p, &mut best);
        best.sqrt()
    }
}

/// Points on triangles, in proportion to their areas.
fn sample(triangles: &[[Vec3; 3]], count: usize, random: &mut Random) -> Vec<Vec3> {
    let mut sums = Vec::with_capacity(triangles.len());
    let mut sum = 0.0;
    for &[a, b, c] in triangles {
        let n = cross(sub(b, a), sub(c, a));
        sum += dot(n, n).sqrt();
        sums.push(sum);
    }
    let mut point = |_| {
        let at = random.next() * sum;
        let [a, b, c] = triangles[sums.partition_point(|&s| s < at).min(triangles.len() - 1)];
        let (mut u, mut v) = (random.next(), random.next());
        if u + v > 1.0 {
            (u, v) = (1.0 - u, 1.0 - v);
        }
        std::array::from_fn(|k| a[k] + u * (b[k] - a[k]) + v * (c[k] - a[k]))
    };
    // Corners too: distances are greatest there.
    let mut points: Vec<Vec3> = (0..count).map(&mut point).collect();
    points.extend(triangles.iter().flatten().take(count));
    points
}

/// The triangles of a brick in units of its object, through the matrix of an instance if it is placed by one.
fn corners(brick: &DecodedBrick, resident: &Resident, instance: u32) -> Vec<[Vec3; 3]> {
    let step = 2f64.powi(resident.objects[brick.record.object as usize].step_log2);
    let place = |p: [i64; 3]| -> Vec3 {
        let p = p.map(|x| x as f64 * step);
        if instance == NONE {
            return p;
        }
        let m = &resident.instances[instance as usize].world_from_object;
        std::array::from_fn(|k| m[4 * k] * p[0] + m[4 * k + 1] * p[1] + m[4 * k + 2] * p[2] + m[4 * k + 3])
    };
    (0..brick.indices.len()).map(|triangle| brick.corners(triangle).map(place)).collect()
}

/// The triangles of all bricks that a level stands for.
fn exact(level: &Level, (bricks, resident): (&[DecodedBrick], &Resident), instance: u32) -> Vec<[Vec3; 3]> {
    let first = resident.exact_bricks();
    let mut all = Vec::new();
    for child in level.children() {
        let instance = if child.instance == NONE { instance } else { child.instance };
        match (child.brick as usize).checked_sub(first) {
            None => all.extend(corners(&bricks[child.brick as usize], resident, instance)),
            Some(level) => all.extend(exact(&resident.levels[level], (bricks, resident), instance)),
        }
    }
    all
}

/// The length of the longest axis as an instance places it: no more than what it is scaled by at most.
fn longest_axis(resident: &Resident, instance: u32) -> f64 {
    if instance == NONE {
        return 1.0;
    }
    let m = &resident.instances[instance as usize].world_from_object;
    let axis = |k: usize| (m[k] * m[k] + m[4 + k] * m[4 + k] + m[8 + k] * m[8 + k]).sqrt();
    axis(0).max(axis(1)).max(axis(2))
}

/// The points of a scene that are looked at: as many as the environment says, else 100,000.
fn points() -> usize {
    std::env::var("BRICKWALK_POINTS").map_or(100_000, |points| points.parse().expect("a number of points"))
}

/// For files beside those of [`kinds`], name them in `BRICKWALK_LEVELS`, with colons between them.
#[test]
fn no_point_is_farther_away_than_the_bound() {
    let own = kinds().into_iter().map(|(name, scene)| {
        let built = built(&scene, &with_levels(500));
        (name.to_owned(), decode_levels(&built.path()), 0.5)
    });
    let named = std::env::var("BRICKWALK_LEVELS").unwrap_or_default();
    let named = named.split(':').filter(|name| !name.is_empty());
    // The bound of what is smooth is not looked at closer below a cell.
    let named = named.map(|name| (name.to_owned(), decode_levels(Path::new(name)), 0.25));
    for (name, (resident, bricks), part) in own.chain(named) {
        let count = resident.levels.len();
        assert!(count > 1, "{name}: {count} levels");
        let mut random = Random(3);
        let (mut violations, mut of_part, mut tightest) = (0, 0, 0.0f64);
        for (index, level) in resident.levels.iter().enumerate() {
            let own = corners(&bricks[resident.exact_bricks() + index], &resident, NONE);
            let below = exact(level, (&bricks, &resident), NONE);
            let points = points() / count / 4 + 1;
            let (from_own, from_below) = (sample(&own, points, &mut random), sample(&below, points, &mut random));
            let (own, below) = (Tree::over(own), Tree::over(below));
            let farthest = |points: &[Vec3], tree: &Tree| points.iter().map(|&p| tree.distance(p)).fold(0.0, f64::max);
            let found = farthest(&from_own, &below).max(farthest(&from_below, &own));
            // Points are rounded: a level that lost nothing has a bound of 0.
            let extent = from_own.iter().flatten().fold(0.0f64, |most, x| most.max(x.abs()));
            violations += usize::from(found > level.bound + 1e-15 * extent);
            of_part += usize::from(found > part * level.bound);
            tightest = tightest.max(found / level.bound.max(f64::MIN_POSITIVE));
            for child in level.children() {
                if let Some(below) = (child.brick as usize).checked_sub(resident.exact_bricks()) {
                    let (below, scale) = (&resident.levels[below], longest_axis(&resident, child.instance));
                    assert!(level.bound >= scale * below.bound && level.error >= scale * below.error, "{name}");
                }
            }
            assert!(level.error.is_finite() && level.error >= 0.0 && (0.0..=1.0).contains(&level.color), "{name}");
        }
        println!("{name}: {count} levels, {of_part} of them beyond {part} of the bound, tightest {tightest:.3}");
        assert_eq!(violations, 0, "{name}");
        // A part of the bound is none.
        assert!(of_part > 0, "{name}");
    }
}

#[test]
fn levels_are_bricks_of_distinct_triangles_from_their_children() {
    for (name, scene) in kinds() {
        let (resident, bricks) = decode_levels(&built(&scene, &with_levels(500)).path());
        let first = resident.exact_bricks();
        for (index, level) in resident.levels.iter().enumerate() {
            let own = &bricks[first + index];
            let mut ids = own.ids.clone();
            ids.sort_unstable();
            ids.dedup();
            assert!(ids.len() == own.ids.len() && !ids.is_empty() && ids.len() <= 500, "{name}");
            assert!(level.children().all(|child| (child.brick as usize) < first + index));
            if level.children().all(|child| child.instance == NONE) {
                let below = || level.children().map(|child| &bricks[child.brick as usize]);
                let sources: std::collections::HashSet<u32> = below().flat_map(|brick| brick.ids.clone()).collect();
                assert!(ids.iter().all(|id| sources.contains(id)), "{name}");
                let all: usize = below().map(|brick| brick.ids.len()).sum();
                assert!(ids.len() <= all.div_ceil(4).max(64), "{name}: {} of {all}", ids.len());
            }
        }
        // Every brick and every level but the roots is below one other.
        let mut times = vec![0; bricks.len()];
        let within = resident.levels.iter().flat_map(|level| level.children().collect::<Vec<_>>());
        within.filter(|child| child.instance == NONE).for_each(|child| times[child.brick as usize] += 1);
        assert!(times.iter().all(|&count| count <= 1), "{name}");
    }
}

#[test]
fn levels_of_the_world_stand_for_instances_that_rest() {
    let placed = |settings: BuildSettings| {
        let resident = decode(&built(&instanced(), &settings).path()).resident;
        let placed = resident.levels.iter().flat_map(|level| level.children().map(|child| child.instance));
        let mut placed: Vec<u32> = placed.filter(|&instance| instance != NONE).collect();
        placed.sort_unstable();
        // The last level of an object has few triangles.
        let of_object = |level: &&Level| level.brick.object == 1;
        let last = resident.levels.iter().rfind(of_object).map(|level| level.brick.triangle_count);
        assert!(last.is_some_and(|count| count <= 128), "{last:?}");
        placed
    };
    assert_eq!(placed(with_levels(500)), [1, 2]);
    assert_eq!(placed(BuildSettings { movable: vec!["c".to_owned()], ..with_levels(500) }), [1]);
}

#[test]
fn all_else_is_as_without_levels() {
    let scene = instanced();
    let (with, without) = (built(&scene, &with_levels(500)), built(&scene, &settings(500)));
    let (a, b) = (decode(&with.path()).resident, decode(&without.path()).resident);
    assert_eq!((&a.objects, &a.instances, &a.bricks, &a.leaves), (&b.objects, &b.instances, &b.bricks, &b.leaves));
    assert_eq!((&a.top2, &a.top8), (&b.top2, &b.top8));
    assert_eq!((b.levels.len(), b.level_leaves.len()), (0, 0));
    assert!(!a.levels.is_empty() && with.summary.levels == a.levels.len() as u64);
    let end = b.bricks.iter().map(|brick| brick.proxies.offset + brick.proxies.bytes).max().unwrap() as usize;
    assert!(with.bytes()[4096..end] == without.bytes()[4096..end]);
}

#[test]
fn what_a_level_stands_for_lies_below_one_node() {
    for (name, scene) in kinds() {
        let (resident, _) = decode_levels(&built(&scene, &with_levels(500)).path());
        let parents = resident.level_parents();
        // Leaves below each node, and its height.
        let mut below: Vec<Vec<u32>> = vec![Vec::new(); resident.top2.len()];
        for (index, node) in resident.top2.iter().enumerate().rev() {
            below[index] = match node.right {
                bricks::TOP_LEAF => vec![node.left],
                right => [below[node.left as usize].clone(), below[right as usize].clone()].concat(),
            };
        }
        let of_level = |leaf: u32| {
            let mut all = vec![leaf];
            let mut next = 0;
            while next < all.len() {
                let parent = all[next];
                all.extend((0u32..).zip(&parents).filter(|(_, other)| **other == parent).map(|(child, _)| child));
                next += 1;
            }
            all.sort_unstable();
            all
        };
        below.iter_mut().for_each(|leaves| leaves.sort_unstable());
        let sets: std::collections::HashSet<&Vec<u32>> = below.iter().collect();
        for leaf in 0..resident.leaves.len() as u32 {
            assert!(sets.contains(&of_level(leaf)), "{name}: leaf {leaf}");
        }
        assert_eq!(below[0].len(), resident.leaves.len());
    }
}

#[test]
fn neither_threads_nor_memory_change_levels() {
    let scene = instanced();
    let with = |threads| built(&scene, &BuildSettings { threads: Some(threads), ..with_levels(400) }).bytes();
    let one = with(1);
    assert!(one == with(2) && one == with(3));
    let source = Computed::new(120_000, 60_000);
    let lod = |threads, memory| BuildSettings { lod: true, ..bounded(threads, memory) };
    let all = bytes(&source, &lod(2, 1000));
    for (threads, memory) in [(1, 44), (2, 52)] {
        assert!(bytes(&source, &lod(threads, memory)) == all, "{threads} threads, {memory} MiB");
    }
}

#[test]
fn levels_that_were_interrupted_are_continued() {
    let source = Computed::new(120_000, 60_000);
    let settings = BuildSettings { lod: true, ..bounded(2, 52) };
    let all = bytes(&source, &settings);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("a.bricks");
    let partial = folder.path().join(".a.bricks.partial");
    // Where the payloads of bricks end.
    let without = bytes(&source, &BuildSettings { lod: false, ..settings.clone() }).len() as u64;
    let mut paused = 0;
    for (try_number, more) in [0u64, 200_000, 600_000].into_iter().enumerate() {
        let progress = Progress::hidden();
        let is_done = AtomicBool::new(false);
        let result = std::thread::scope(|scope| {
            scope.spawn(|| {
                while !is_done.load(Ordering::Relaxed) {
                    let length = std::fs::metadata(&partial).map_or(0, |file| file.len());
                    if length > without - without / 20 + more {
                        progress.interrupt();
                    }
                    std::thread::sleep(std::time::Duration::from_micros(200));
                }
            });
            let resume = try_number > 0;
            let result = build_source(&source, &BuildSettings { resume, ..settings.clone() }, &path, &progress);
            is_done.store(true, Ordering::Relaxed);
            result
        });
        match result {
            Err(BuildError::Paused { .. }) => paused += 1,
            other => assert!(other.is_ok(), "{other:?}"),
        }
    }
    assert!(paused > 0, "nothing was interrupted");
    build_source(&source, &BuildSettings { resume: true, ..settings }, &path, &Progress::hidden()).unwrap();
    assert!(std::fs::read(&path).unwrap() == all);
}

/// A plane of squares in two colours, three of them on one material by vertex colours.
fn checkered(n: u32) -> SourceScene {
    let mut primitives = [0, 1].map(|material| Primitive { material, ..Primitive::default() });
    for (i, j) in (0..n).flat_map(|i| (0..n).map(move |j| (i, j))) {
        let primitive = &mut primitives[((i + j) % 2) as usize];
        let first = primitive.positions.len() as u32;
        let corner = |x: u32, z: u32| [f64::from(x), 0.0, f64::from(z)];
        primitive.positions.extend([corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j)]);
        primitive.indices.extend([0, 1, 2, 0, 2, 3].map(|k| first + k));
    }
    plain(primitives.to_vec())
}

#[test]
fn colours_are_means_by_area() {
    let (resident, bricks) = decode_levels(&built(&checkered(96), &with_levels(1000)).path());
    let expected: Vec3 =
        std::array::from_fn(|k| (0..2).map(|m| f64::from(resident.materials[m].base_color[k])).sum::<f64>() / 2.0);
    let root = bricks.last().unwrap();
    let (mut sum, mut area) = ([0.0; 3], 0.0);
    for index in 0..root.ids.len() {
        let triangle = root.triangle(index);
        let [a, b, c] = triangle.corners.map(|p| p.map(|x| x as f64));
        let n = cross(sub(b, a), sub(c, a));
        let weight = dot(n, n).sqrt();
        let base = resident.materials[triangle.material as usize].base_color;
        area += weight;
        for (k, sum) in sum.iter_mut().enumerate() {
            let color: f64 = triangle.attributes.iter().map(|v| f64::from(v.color >> (8 * k) & 255) / 765.0).sum();
            *sum += weight * color * f64::from(base[k]);
        }
    }
    for (k, sum) in sum.iter().enumerate() {
        let found = sum / area;
        assert!((found / expected[k] - 1.0).abs() < 0.01, "channel {k}: {found}, expected {}", expected[k]);
    }
    // Of one material nothing is lost where all normals are one; where they differ the colour is darkened, evenly: in
    // each level by a third at most, and little on the mean.
    let [squares, _] = checkered(96).meshes[0].primitives.clone().try_into().unwrap();
    for (part, is_flat) in [(squares, true), (sheet(80, 30.0), false)] {
        let (resident, bricks) = decode_levels(&built(&plain(vec![part]), &with_levels(500)).path());
        let darkest = |brick: &DecodedBrick| brick.attributes.iter().map(|v| v.color.to_le_bytes()[0]).min().unwrap();
        let (exact, levels) = bricks.split_at(resident.exact_bricks());
        for (level, brick) in resident.levels.iter().zip(levels) {
            assert!(brick.materials.iter().all(|&material| material == 0));
            for vertex in &brick.attributes {
                let [r, g, b, alpha] = vertex.color.to_le_bytes();
                assert!(r == g && g == b && alpha == 255, "{:x}", vertex.color);
            }
            let below = level.children().map(|child| darkest(&bricks[child.brick as usize])).min().unwrap();
            assert!(f64::from(darkest(brick)) >= 0.65 * f64::from(below) - 1.0, "{} of {below}", darkest(brick));
            let reds = brick.attributes.iter().map(|vertex| f64::from(vertex.color.to_le_bytes()[0]));
            let mean = reds.sum::<f64>() / brick.attributes.len() as f64;
            assert!(mean >= 200.0, "{mean}");
        }
        assert!(exact.iter().all(|brick| darkest(brick) == 255));
        let darkest = levels.iter().map(darkest).min().unwrap();
        assert_eq!(darkest == 255, is_flat, "{darkest}");
    }
}

/// Rods of 12 triangles, 4 units long and 0.02 thick, strewn in all directions.
fn rods(count: u32) -> Primitive {
    let mut random = Random(23);
    let mut triangles = Vec::new();
    for _ in 0..count {
        let (at, along) = (random.point(40.0), random.point(1.0));
        let unit = |v: Vec3| v.map(|x| x / dot(v, v).sqrt());
        let w = unit(along);
        let u = unit(cross(w, [0.3, 0.5, 0.8]));
        let v = cross(w, u);
        let corner = |i: usize| -> Vec3 {
            let [s, t, l] = [0, 1, 2].map(|k| if i >> k & 1 != 0 { 1.0 } else { -1.0 });
            std::array::from_fn(|k| at[k] + 0.01 * (s * u[k] + t * v[k]) + 2.0 * l * w[k])
        };
        for [a, b, c, d] in [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]] {
            let [a, b, c, d] = [a, b, c, d].map(corner);
            triangles.extend([[a, b, c], [a, c, d]]);
        }
    }
    soup(&triangles)
}

fn area(triangles: &[[Vec3; 3]]) -> f64 {
    let of = |&[a, b, c]: &[Vec3; 3]| {
        let n = cross(sub(b, a), sub(c, a));
        0.5 * dot(n, n).sqrt()
    };
    triangles.iter().map(of).sum()
}

#[test]
fn what_is_thinner_than_a_cell_stays_as_wide_as_it_looks() {
    let (resident, bricks) = decode_levels(&built(&plain(vec![rods(600)]), &with_levels(500)).path());
    let mut levels = 0;
    for (index, level) in resident.levels.iter().enumerate() {
        if level.children().any(|child| child.brick as usize >= resident.exact_bricks()) {
            continue;
        }
        levels += 1;
        let own = corners(&bricks[resident.exact_bricks() + index], &resident, NONE);
        let below = exact(level, (&bricks, &resident), NONE);
        // Cauchy: a convex body looks like a quarter of its surface on the mean, a sheet like half of its area.
        let ratio = 0.5 * area(&own) / (0.25 * area(&below));
        println!("{ratio}");
        assert!((0.7..1.1).contains(&ratio), "{ratio}");
        let tree = Tree::over(own);
        let far = sample(&below, 1000, &mut Random(2)).into_iter().filter(|&p| tree.distance(p) > 0.5).count();
        assert!(far < 20, "{far}");
    }
    assert!(levels > 3);
}

#[test]
fn a_level_emits_as_much_as_what_it_stands_for() {
    // The coarsest levels have few triangles, so that one scene alone says little.
    let ratios: Vec<f64> = (0..12).map(|seed| emitted_ratio(31 + seed)).collect();
    let mean = ratios.iter().sum::<f64>() / ratios.len() as f64;
    assert!((mean - 1.0).abs() < 0.1, "{mean}: {ratios:?}");
}

/// What levels emit over what they should; a tenth of the squares of a plane emits.
fn emitted_ratio(seed: u64) -> f64 {
    let mut random = Random(seed);
    let mut scene = checkered(96);
    scene.meshes[0].primitives = {
        let squares = &scene.meshes[0].primitives;
        let mut parts =
            [Primitive { material: 0, ..Primitive::default() }, Primitive { material: 1, ..Primitive::default() }];
        for square in squares.iter().flat_map(|part| part.positions.chunks_exact(4)) {
            let part = &mut parts[usize::from(random.next() < 0.1)];
            let first = part.positions.len() as u32;
            part.positions.extend_from_slice(square);
            part.indices.extend([0, 1, 2, 0, 2, 3].map(|k| first + k));
        }
        parts.to_vec()
    };
    scene.materials[1].emission = [3.0, 2.0, 1.0];
    let (resident, bricks) = decode_levels(&built(&scene, &with_levels(1000)).path());
    let mean = |bricks: &[DecodedBrick]| {
        let (mut sum, mut all) = (0.0, 0.0);
        for brick in bricks {
            for (triangle, &material) in corners(brick, &resident, NONE).iter().zip(&brick.materials) {
                let weight = area(&[*triangle]);
                all += weight;
                sum += weight * f64::from(resident.materials[material as usize].emission[0]);
            }
        }
        sum / all
    };
    let (exact, levels) = bricks.split_at(resident.exact_bricks());
    let (exact, levels) = (mean(exact), mean(levels));
    assert!((0.25..0.35).contains(&exact), "{exact}");
    levels / exact
}

/// A sheet of which one half shows one half of a texture, red, and the other one that is blue.
fn two_coloured(alpha: u8) -> SourceScene {
    let mut scene = plain(vec![sheet(90, 1.0)]);
    let texel = |x: u32| if x < 16 { [255, 0, 0, 255] } else { [0, 0, 255, alpha] };
    let rgba = (0..32).flat_map(|_| (0..32).flat_map(texel)).collect();
    scene.textures = vec![SourceTexture { name: "halves".to_owned(), width: 32, height: 32, wrap: 0, rgba }];
    (scene.materials[0].base_color, scene.materials[0].base_color_texture) = ([1.0; 4], 0);
    scene
}

#[test]
fn textures_become_colours_of_vertices() {
    let (resident, bricks) = decode_levels(&built(&two_coloured(255), &with_levels(500)).path());
    let root = bricks.last().unwrap();
    let step = 2f64.powi(resident.objects[0].step_log2);
    let mut sides = [0; 2];
    for index in 0..root.ids.len() {
        let triangle = root.triangle(index);
        let material = &resident.materials[triangle.material as usize];
        assert_eq!(material.textures(), [NONE; 5]);
        let xs = triangle.corners.map(|p| p[0] as f64 * step);
        // Not where both halves meet, nor at the edge.
        let is_red = xs.iter().all(|&x| (0.1..0.4).contains(&x));
        if !is_red && !xs.iter().all(|&x| (-0.4..-0.1).contains(&x)) {
            continue;
        }
        sides[usize::from(is_red)] += 1;
        for vertex in triangle.attributes {
            let [r, _, b] =
                [0, 1, 2].map(|k| f64::from(vertex.color >> (8 * k) & 255) / 255.0 * f64::from(material.base_color[k]));
            // Normals that differ may darken it.
            assert!(if is_red { r > 0.5 && b < 0.02 } else { b > 0.5 && r < 0.02 }, "{r} {b} {is_red}");
        }
    }
    assert!(sides[0] > 10 && sides[1] > 10, "{sides:?}");
}

/// What stands for surfaces with layers has them, and no further textures.
#[test]
fn layers_are_kept_without_their_textures() {
    let mut scene = two_coloured(255);
    let layers = Layers { sheen: [1.0; 3], sheen_roughness: 1.0, film: 1.0, film_index: 1.5, ..Layers::NONE };
    scene.materials[0].set_layers(&layers);
    scene.materials[0].flags |= MATERIAL_MORE;
    scene.materials.insert(1, Material { emissive_texture: 0, ..Material::further() });
    // Reading a file checks its materials.
    let (resident, bricks) = decode_levels(&built(&scene, &with_levels(500)).path());
    assert!(resident.manifest.has_textures && resident.textures.len() == 1);
    let seen = bricks.last().unwrap().triangle(0).material;
    let material = &resident.materials[seen as usize];
    assert!(seen > 1 && material.flags & (MATERIAL_LAYERS | MATERIAL_MORE) == MATERIAL_LAYERS);
    assert_eq!(material.layers(), resident.materials[0].layers());
    assert_eq!(resident.materials[1].flags, MATERIAL_FURTHER);
}

/// What stands for bodies that refract lets nothing pass.
#[test]
fn bodies_that_refract_are_opaque_from_afar() {
    let mut scene = two_coloured(255);
    scene.materials[0] = Material {
        flags: MATERIAL_BLEND | MATERIAL_REFRACTS,
        transmission: 0.5,
        absorption: pack_absorption([0.5, 0.25, 1.0]),
        specular: [0.04; 3],
        specular_weight: 1.0,
        ..scene.materials[0]
    };
    // Reading a file checks its materials.
    let (resident, bricks) = decode_levels(&built(&scene, &with_levels(500)).path());
    let seen = bricks.last().unwrap().triangle(0).material;
    let material = &resident.materials[seen as usize];
    assert!(seen > 0 && (material.flags, material.transmission, material.absorption) == (0, 0.0, 0));
    assert_eq!(resident.materials[0].flags, MATERIAL_BLEND | MATERIAL_REFRACTS);
}

#[test]
fn what_is_cut_out_is_not_stood_for() {
    let area = |scene: &SourceScene| {
        let (resident, bricks) = decode_levels(&built(scene, &with_levels(500)).path());
        let root = bricks.last().unwrap();
        assert!(root.materials.iter().all(|&material| resident.materials[material as usize].flags == 0));
        let step = 2f64.powi(resident.objects[0].step_log2);
        let of = |index| {
            let [a, b, c] = root.corners(index).map(|p| p.map(|x| x as f64 * step));
            let n = cross(sub(b, a), sub(c, a));
            0.5 * dot(n, n).sqrt()
        };
        (0..root.ids.len()).map(of).sum::<f64>()
    };
    let mut scene = two_coloured(0);
    let whole = area(&scene);
    scene.materials[0].flags = MATERIAL_MASK;
    let half = area(&scene);
    assert!((0.4..0.6).contains(&(half / whole)), "{half} of {whole}");
}

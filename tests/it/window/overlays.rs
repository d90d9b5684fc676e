//! What overlays say of the engine: it is what the engine does, and what brute force finds.

use super::studio::{open, rest, settings, until, wish};
use crate::common::{city, folder, levelled_city};
use bricks::{Corners, NODE_WIDTH, Node, Payload, SceneFile};
use brickwalk::scene::CameraPath;
use brickwalk::scene::brick_walk::BrickWalk;
use brickwalk::scene::placement::leaf_box;
use brickwalk::scene::top_walk::{Sight, TopWalk};
use brickwalk::session::{Session, open_scene};
use brickwalk::view::studio::{Ask, News, Overlay, Shown, Wish};
use glam::DVec3;

#[test]
fn overlays_show_what_the_engine_knows() {
    let folder = folder();
    let scene = levelled_city(folder.path());
    let asked = settings("--size 96x54 --spp 1 --adapter cpu --cache 30%");
    let (studio, opened) = open(&scene, &asked);
    let camera = opened.way.frame(0, 1);
    let (plain, _) = rest(&studio, &wish(camera, &asked));
    let mut seen = vec![plain.pixels.clone()];
    studio.ask(Ask::Freeze(true));
    let (from, bricks) = until(&studio, |news| match news {
        News::Frozen(from, bricks) => Some((from, bricks)),
        _ => None,
    });
    assert!(from == camera && bricks > 1 && bricks < opened.bricks);
    for &overlay in Overlay::ALL.iter().filter(|&&overlay| overlay != Overlay::None) {
        let (last, _) = rest(&studio, &Wish { overlay, ..wish(camera, &asked) });
        assert!(!seen.contains(&last.pixels) || overlay == Overlay::Frozen, "{overlay} shows nothing");
        seen.push(last.pixels.clone());
        if overlay == Overlay::Frozen {
            // From where it was left every brick is its own; from elsewhere others are seen, too.
            let is_red = |pixel: &&[u8; 3]| pixel[0] > 40 + pixel[1];
            let red = |shown: &Shown| shown.pixels.iter().filter(is_red).count();
            let (elsewhere, _) = rest(&studio, &Wish { overlay, ..wish(opened.way.frame(9, 10), &asked) });
            assert!(10 * red(&last) < red(&elsewhere), "{} and {}", red(&last), red(&elsewhere));
        }
    }
}

#[test]
fn overlays_tell_who_answered_and_what_rays_visit() {
    let folder = folder();
    let scene = levelled_city(folder.path());
    let common = "--size 96x54 --spp 1 --adapter cpu --effects primary,ao --ao-rays 1";
    let shares = |options: &str| {
        let asked = settings(&format!("{common} {options}"));
        let (studio, opened) = open(&scene, &asked);
        let (last, _) = rest(&studio, &Wish { overlay: Overlay::Methods, ..wish(opened.way.frame(0, 1), &asked) });
        let is = |more: usize, less: usize| move |pixel: &&[u8; 3]| pixel[more] > pixel[less] + 30;
        let count = |is: &dyn Fn(&&[u8; 3]) -> bool| last.pixels.iter().filter(|pixel| is(pixel)).count();
        (count(&is(2, 0)), count(&is(0, 2)))
    };
    let ((traced, _), (_, answered)) = (shares(""), shares("--secondary ao=roma"));
    assert!(traced > 1000 && answered > 1000, "{traced} pixels are blue, {answered} amber");
    // Rays visit no more nodes than there are, and what sees nothing far away visits the fewest.
    let asked = settings(common);
    let (studio, opened) = open(&scene, &asked);
    let (last, _) = rest(&studio, &Wish { overlay: Overlay::Steps, ..wish(opened.way.frame(0, 1), &asked) });
    let most: u32 =
        last.legend.split_whitespace().find_map(|word| word.parse().ok().filter(|&n| n > 0)).expect("a count");
    assert!(most > 3 && (most as usize) < 4 * opened.bricks, "{}", last.legend);
}

/// Whether a ray meets a box before it ends, plane by plane.
fn meets([min, max]: [DVec3; 2], origin: DVec3, ray: &Sight) -> bool {
    let (mut first, mut last) = (0.0, ray.end);
    for k in 0..3 {
        let [a, b] = [min[k], max[k]].map(|plane| (plane - origin[k]) / ray.direction[k]);
        (first, last) = (a.min(b).max(first), a.max(b).min(last));
    }
    first <= last
}

/// Words of the geometry of a brick.
fn geometry(scene: &SceneFile, brick: u32) -> Vec<u32> {
    let payload = Payload::Geometry(brick);
    let mut words = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
    scene.copy(payload, bytemuck::cast_slice_mut(&mut words)).expect("a brick");
    words
}

/// Boxes of the triangles below each node of a brick, object units.
fn boxes_of_triangles(scene: &SceneFile, brick: u32, geometry: &[u32]) -> (Vec<Node>, Vec<[DVec3; 2]>) {
    let resident = scene.resident();
    let brick = &resident.bricks[brick as usize];
    let object = &resident.objects[brick.object as usize];
    let [step, unit] = [object.step_log2, object.unit_log2].map(|log2| f64::from(log2).exp2());
    let origin = DVec3::from_array(brick.origin.map(|x| x as f64)) * step;
    let corners = Corners::new(brick, bytemuck::cast_slice(geometry));
    let words = brick.node_count as usize * size_of::<Node>() / 4;
    let nodes: Vec<Node> = bytemuck::cast_slice(&geometry[..words]).to_vec();
    let mut boxes = vec![[DVec3::INFINITY, DVec3::NEG_INFINITY]; nodes.len()];
    // Children follow their parents.
    for (index, node) in nodes.iter().enumerate().rev() {
        let mut child = node.child_base as usize;
        let [mut min, mut max] = boxes[index];
        for slot in 0..NODE_WIDTH {
            if node.inner_mask >> slot & 1 != 0 {
                (min, max) = (min.min(boxes[child][0]), max.max(boxes[child][1]));
                child += 1;
                continue;
            }
            let (count, first) = ((node.meta[slot] >> 5).count_ones(), u32::from(node.meta[slot] & 31));
            for p in (0..count).flat_map(|k| corners.of(node.triangle_base + first + k)) {
                let p = origin + DVec3::from_array(p) * unit;
                (min, max) = (min.min(p), max.max(p));
            }
        }
        boxes[index] = [min, max];
    }
    (nodes, boxes)
}

/// How many of these nodes a ray enters.
fn entered(nodes: &[Node], boxes: &[[DVec3; 2]], origin: DVec3, ray: &Sight) -> u32 {
    let (mut stack, mut count) = (vec![0u32], 0);
    while let Some(index) = stack.pop() {
        if meets(boxes[index as usize], origin, ray) {
            count += 1;
            let node = &nodes[index as usize];
            stack.extend(node.child_base..node.child_base + node.inner_mask.count_ones());
        }
    }
    count
}

#[test]
fn fronts_and_steps_are_those_of_brute_force() {
    const SIZE: (u32, u32) = (96, 54);
    let folder = folder();
    let path = city(folder.path(), "60K", "300");
    let asked = settings("--size 96x54 --spp 1 --adapter cpu --effects primary --aov");
    let mut session = Session::open(&path, &asked).expect("a session");
    let camera = CameraPath::read(&path.with_extension("near.json")).expect("a path").frame(1, 4);
    let frame = session.picture(&camera, &mut ()).expect("a picture").expect("all of it");
    let scene = open_scene(&path).expect("a scene");
    let resident = scene.resident();
    let (top, basis) = (TopWalk::new(resident), camera.ray_basis(SIZE.0, SIZE.1));
    let mut steps = [0u64; 3];
    let mut sizes = [0; 2];
    for (x0, y0) in (0..SIZE.1 / 9).flat_map(|y| (0..SIZE.0 / 8).map(move |x| (8 * x, 9 * y))) {
        let ray = |(x, y): (u32, u32)| {
            let end = f64::from(frame.pixels.depth[(y * SIZE.0 + x) as usize]);
            Sight { direction: basis.direction(f64::from(x) + 0.5, f64::from(y) + 0.5).normalize(), end }
        };
        let rays: Vec<Sight> = (y0..y0 + 9).flat_map(|y| (x0..x0 + 8).map(move |x| (x, y))).map(ray).collect();
        let front = top.front(camera.position, &rays);
        // Each leaf lies under one node of the front, or is it.
        let mut above = vec![0; resident.leaves.len()];
        for &node in front.visible.iter().chain(&front.invisible) {
            let mut stack = vec![node];
            while let Some(node) = stack.pop() {
                match top.leaf(node) {
                    Some(_) => above[resident.top2[node as usize].left as usize] += 1,
                    None => stack.extend([resident.top2[node as usize].left, resident.top2[node as usize].right]),
                }
            }
        }
        assert!(above.iter().all(|&count| count == 1));
        let mut visible: Vec<u32> = front.visible.iter().map(|&node| resident.top2[node as usize].left).collect();
        visible.sort_unstable();
        let met =
            |ray: &Sight, leaf: u32| meets(leaf_box(resident, &resident.leaves[leaf as usize]), camera.position, ray);
        let leaves = 0..resident.leaves.len() as u32;
        let expected: Vec<u32> = leaves.filter(|&leaf| rays.iter().any(|ray| met(ray, leaf))).collect();
        assert_eq!(visible, expected);
        for &node in &front.invisible {
            assert!(!rays.iter().any(|ray| meets(top.bounds(node), camera.position, ray)));
        }
        sizes = [sizes[0] + visible.len(), sizes[1] + front.invisible.len()];
        // The control: rays that end nearer meet less.
        let near: Vec<Sight> = rays.iter().map(|ray| Sight { end: 0.1 * ray.end.min(1e3), ..*ray }).collect();
        assert!(top.front(camera.position, &near).visible.len() <= visible.len());
        for leaf in visible {
            let own: Vec<u32> = (0..rays.len() as u32).filter(|&ray| met(&rays[ray as usize], leaf)).collect();
            let leaf = &resident.leaves[leaf as usize];
            assert_eq!(leaf.instance, 0, "all of the city is of the world");
            let geometry = geometry(&scene, leaf.brick);
            let brick = BrickWalk::new(resident, &resident.bricks[leaf.brick as usize], &geometry);
            let found = brick.entered(camera.position, &rays, own.clone());
            let (nodes, boxes) = boxes_of_triangles(&scene, leaf.brick, &geometry);
            for (number, ray) in rays.iter().enumerate() {
                // Boxes in the file are those of the triangles and a step of a grid more.
                let least = entered(&nodes, &boxes, camera.position, ray);
                steps = [steps[0] + u64::from(least), steps[1] + u64::from(found[number]), steps[2]];
                assert!(found[number] >= least && (found[number] > 0) == own.contains(&(number as u32)));
            }
            steps[2] += own.len() as u64;
        }
    }
    assert!(sizes[0] > 100 && sizes[1] > 100, "{sizes:?}");
    let [least, found, roots] = steps;
    assert!(least > 2 * roots && found < least + least / 4, "{steps:?}");
}

#[test]
fn the_front_of_a_camera_that_was_left_is_seen_from_elsewhere() {
    let folder = folder();
    let scene = levelled_city(folder.path());
    let asked = settings("--size 96x54 --spp 1 --adapter cpu --cache 100%");
    let (studio, opened) = open(&scene, &asked);
    let [here, there] = [0, 9].map(|at| opened.way.frame(at, 10));
    let fronts = |camera| Wish { overlay: Overlay::Fronts, ..wish(camera, &asked) };
    let legends = [here, there].map(|camera| rest(&studio, &fronts(camera)).0.legend.clone());
    assert!(legends[0] != legends[1] && legends[0].starts_with("pairs of the tile"), "{legends:?}");
    rest(&studio, &fronts(here));
    studio.ask(Ask::Freeze(true));
    until(&studio, |news| matches!(news, News::Frozen(..)).then_some(()));
    assert_eq!(rest(&studio, &fronts(there)).0.legend, legends[0]);
    studio.ask(Ask::Freeze(false));
    rest(&studio, &wish(here, &asked));
    assert_eq!(rest(&studio, &fronts(there)).0.legend, legends[1]);
}

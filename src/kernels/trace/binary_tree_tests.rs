use crate::gpu::probe;
use crate::kernels::trace::binary_tree::*;
use bricks::Payload;
use proptest::prelude::*;

/// Trees of all bricks of the probe's scene with the boxes of their triangles.
fn trees() -> Vec<(Tree, Vec<Bounds>)> {
    let scene = probe::scene().unwrap();
    let tree = |(i, brick): (usize, &Brick)| {
        let payload = Payload::Geometry(i as u32);
        let mut words = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
        scene.copy(payload, bytemuck::cast_slice_mut(&mut words)).unwrap();
        let wide: &[Node] = bytemuck::cast_slice(&words[..brick.node_count as usize * 20]);
        (binary_tree(brick, &words), bounds(brick, &words, wide).triangles)
    };
    scene.resident().bricks.iter().enumerate().map(tree).collect()
}

fn within(node: &BinaryNode, inner: &Bounds) -> bool {
    (0..3).all(|k| f64::from(node.min[k]) <= inner.min[k] && f64::from(node.max[k]) >= inner.max[k])
}

#[test]
fn every_triangle_is_in_one_leaf_and_in_all_boxes_above_it() {
    let mut tested = 0;
    for (tree, triangles) in trees() {
        assert!(tree.nodes.len().is_multiple_of(2));
        let mut seen = vec![0; triangles.len()];
        let mut deepest = 0;
        let mut stack = vec![(0usize, vec![0usize])];
        while let Some((at, path)) = stack.pop() {
            let what = tree.nodes[at].what;
            if what & BINARY_LEAF == 0 {
                deepest = deepest.max(path.len() as u32);
                for child in [what as usize, what as usize + 1] {
                    stack.push((child, [&path[..], &[child]].concat()));
                }
                assert!(what.is_multiple_of(2) && what > at as u32, "pairs are aligned and follow their parent");
                continue;
            }
            let (first, count) = (what & 0x1fff_ffff, what >> COUNT_SHIFT & 3);
            for i in first as usize..(first + count) as usize {
                seen[i] += 1;
                assert!(path.iter().all(|&node| within(&tree.nodes[node], &triangles[i])), "triangle {i}");
                tested += 1;
            }
        }
        assert!(seen.iter().all(|&n| n == 1), "{seen:?}");
        assert_eq!(deepest, tree.height, "the stack's bound");
        // Control: a box that is a little smaller fails the test for some triangle.
        let mut root = tree.nodes[0];
        root.max[0] = root.max[0].next_down();
        assert!(triangles.iter().any(|triangle| !within(&root, triangle)));
    }
    assert!(tested > 100, "{tested} triangles");
}

/// The least area of inner nodes over `set`, by trying every tree.
fn least(children: &[Child], set: usize) -> f64 {
    if set.is_power_of_two() {
        return 0.0;
    }
    let parts = (1..set).filter(|part| part & set == *part);
    let below = parts.map(|part| least(children, part) + least(children, set ^ part)).fold(f64::INFINITY, f64::min);
    below + area(children, set)
}

fn area(children: &[Child], set: usize) -> f64 {
    let inside = (0..children.len()).filter(|i| set & 1 << i != 0);
    inside.fold(Bounds::NONE, |all, i| all.union(children[i].bounds)).half_area()
}

/// The area of inner nodes of the tree that `splits` says.
fn area_by(children: &[Child], splits: &[usize], set: usize) -> f64 {
    match splits[set] {
        0 => 0.0,
        part => area(children, set) + area_by(children, splits, part) + area_by(children, splits, set ^ part),
    }
}

fn boxes() -> impl Strategy<Value = Vec<Child>> {
    let point = prop::array::uniform3(-100.0..100.0f64);
    let child = (point, prop::array::uniform3(0.0..30.0f64)).prop_map(|(min, size)| Child {
        bounds: Bounds { min, max: std::array::from_fn(|k| min[k] + size[k]) },
        what: Kind::Leaf(0, 1),
    });
    prop::collection::vec(child, 2..=5)
}

proptest! {
    #[test]
    fn splits_have_the_least_area(children in boxes()) {
        let all = (1 << children.len()) - 1;
        let (ours, best) = (area_by(&children, &splits(&children), all), least(&children, all));
        // Sums of at most four areas in another order.
        prop_assert!((ours - best).abs() <= 8.0 * f64::EPSILON * best, "{ours} against {best}");
    }

    #[test]
    fn rounding_is_outward(x in -1e30..1e30f64) {
        prop_assert!(f64::from(below(x)) <= x && f64::from(above(x)) >= x);
        prop_assert!(above(x) <= below(x).next_up());
    }
}

/// Valid files may have nodes without triangles; they are left out, however many there are.
#[test]
fn nodes_without_triangles_are_left_out() {
    let scene = probe::scene().unwrap();
    let brick = &scene.resident().bricks[0];
    let payload = Payload::Geometry(0);
    let mut words = vec![0u32; scene.loaded_bytes(payload) as usize / 4];
    scene.copy(payload, bytemuck::cast_slice_mut(&mut words)).unwrap();
    let root: Node = bytemuck::pod_read_unaligned(bytemuck::cast_slice(&words[..20]));
    let empty = Node { meta: [0; 8], inner_mask: 0, ..root };
    // The root's parent, with seven nodes of nothing beside it.
    let parent = Node { meta: std::array::from_fn(|slot| 0x38 | slot as u8), inner_mask: 255, child_base: 1, ..root };
    let mut nodes = vec![parent; 1];
    nodes.extend([empty; 7]);
    let old = brick.node_count as usize * 20;
    let mut below: Vec<Node> = bytemuck::cast_slice(&words[..old]).to_vec();
    below.iter_mut().for_each(|node| node.child_base += 8);
    nodes.extend(below);
    words.splice(..old, bytemuck::cast_slice(&nodes).iter().copied());
    let spoiled = Brick { node_count: nodes.len() as u32, height: brick.height + 1, ..*brick };
    let (tree, before) = (binary_tree(&spoiled, &words), trees().swap_remove(0).0);
    assert_eq!(tree.nodes.len(), before.nodes.len());
    assert_eq!(tree.nodes[0].max, before.nodes[0].max);
}

/// Control of the test of splits: taking the children as they come is worse.
#[test]
fn splits_matter() {
    let at = |x: f64| Child { bounds: Bounds { min: [x, 0.0, 0.0], max: [x + 1.0, 1.0, 1.0] }, what: Kind::Leaf(0, 1) };
    let children = [at(0.0), at(50.0), at(1.0), at(51.0)];
    let in_order = area(&children, 0b11) + area(&children, 0b1100) + area(&children, 0b1111);
    assert!(area_by(&children, &splits(&children), 0b1111) < 0.6 * in_order);
}

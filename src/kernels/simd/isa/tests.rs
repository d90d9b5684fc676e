use crate::kernels::simd::isa::*;
use crate::kernels::simd::wide::Wide;
use crate::kernels::trace::node::framed_ray;
use crate::math::random::Rng;

fn point(rng: &mut Rng, size: f32) -> Vec3 {
    [0; 3].map(|_| size * rng.signed())
}

/// A node as the reader accepts it: every child inner, or a leaf of 1 to 3 triangles, or absent.
fn node(rng: &mut Rng) -> Node {
    let mut node = Node {
        origin: point(rng, 20.0),
        exponent: [0; 3].map(|_| 115 + (rng.bits() % 8) as u8),
        inner_mask: 0,
        child_base: 1,
        triangle_base: 0,
        meta: [0; 8],
        lo: [[0; 8]; 3],
        hi: [[0; 8]; 3],
    };
    let mut first = 0;
    for i in 0..8 {
        for k in 0..3 {
            let [a, b] = [rng.bits() as u8, rng.bits() as u8];
            (node.lo[k][i], node.hi[k][i]) = (a.min(b), a.max(b));
        }
        let count = rng.bits() % 5;
        node.meta[i] = match count {
            0 => 0,
            4 => {
                node.inner_mask |= 1 << i;
                0x38 + i as u8
            }
            count => {
                first += count as u8;
                ((1 << count) - 1) << 5 | (first - count as u8)
            }
        };
    }
    node
}

/// Eight numbers' bits.
fn bits(x: impl Wide) -> [u32; 8] {
    let mut numbers = [0.0; 8];
    x.store(&mut numbers);
    numbers.map(f32::to_bits)
}

#[test]
fn eight_at_once_are_each_alone() {
    for_each_isa!(isa => compare_with_scalar(isa));
}

fn compare_with_scalar(isa: impl Isa) {
    let mut entered = 0;
    let mut rng = Rng(11);
    println!("seed 11");
    for case in 0..200_000 {
        let node = node(&mut rng);
        let (high, low) = (point(&mut rng, 4.0), if case % 2 == 0 { [0.0; 3] } else { point(&mut rng, 1e-3) });
        let aim = [0, 1, 2].map(|k| {
            let step = f32::from_bits(u32::from(node.exponent[k]) << 23);
            // At the node, or beside it.
            [high[k], 0.0][case / 2 % 2] + node.origin[k] + step * 255.0 * (0.5 + 0.5 * rng.signed())
        });
        let origin = point(&mut rng, [1.0, 30.0, 3e4][case % 3]);
        let mut direction = [0, 1, 2].map(|k| aim[k] - origin[k]);
        if case % 5 == 0 {
            // Of either sign.
            direction[case / 5 % 3] = [0.0, -0.0][case / 15 % 2];
        }
        let ray = framed_ray(origin, direction, [0.0, 0.9, 1.1][case / 3 % 3]);
        let t_max = [1.0, 3e38, 0.7][case / 7 % 3];
        let lanes = Lanes::new(&ray, high, low);
        let one = Scalar.open(&ray, &lanes, &node, t_max);
        assert_eq!(isa.open(&ray, &lanes, &node, t_max), one, "case {case}: {ray:?} {node:?}");
        entered += u32::from(one != 0);
        let slack = [0.0, 1e-6][case / 2 % 2];
        let (found, alone) =
            (isa.hits(&ray, &lanes, &node, slack, t_max), Scalar.hits(&ray, &lanes, &node, slack, t_max));
        let near = |hits: &NodeHits| hits.near.map(f32::to_bits);
        assert_eq!((found.mask, near(&found)), (alone.mask, near(&alone)), "case {case}: {ray:?} {node:?}");
        for k in 0..3 {
            assert_eq!(bits(isa.numbers(&node.lo[k])), bits(Scalar.numbers(&node.lo[k])), "case {case}: {node:?}");
        }
        let words = node.lo[0].map(|byte| (u16::from(byte) * 257) ^ case as u16);
        assert_eq!(bits(isa.steps(&words)), words.map(|word| f32::from(word).to_bits()), "{words:?}");
        assert_eq!(isa.grid(&node).map(bits), Scalar.grid(&node).map(bits), "case {case}: {node:?}");
    }
    assert!((10_000..190_000).contains(&entered), "{entered} of 200,000 rays enter a child");
}

#[test]
fn matrices_are_turned_and_tables_looked_up_number_by_number() {
    for_each_isa!(isa => compare_with_loops(isa));
}

fn compare_with_loops<I: Isa>(isa: I) {
    let lanes = I::Wide::LANES;
    let mut rng = Rng(12);
    for case in 0..200 {
        // Any words: what is no number, too.
        let table: [f32; 64] = std::array::from_fn(|_| f32::from_bits(rng.bits() as u32));
        let rows: [&[f32; 4]; MOST] = std::array::from_fn(|i| table[4 * i..].first_chunk().unwrap());
        let columns = isa.columns(&rows);
        for (k, column) in columns.into_iter().enumerate() {
            let mut stored = [0.0; MOST];
            column.store(&mut stored);
            for i in 0..lanes {
                assert_eq!(stored[i].to_bits(), rows[i][k].to_bits(), "case {case}, column {k}, row {i}");
            }
        }
        let mut back = [[0.0; 4]; MOST];
        isa.rows(columns, &mut back);
        for i in 0..lanes {
            assert_eq!(back[i].map(f32::to_bits), rows[i].map(f32::to_bits), "case {case}, row {i}");
        }
        let at: [u32; MOST] = std::array::from_fn(|_| rng.bits() as u32 % 64);
        let mut picked = [0.0; MOST];
        isa.pick(&table, &at).store(&mut picked);
        for i in 0..lanes {
            assert_eq!(picked[i].to_bits(), table[at[i] as usize].to_bits(), "case {case}, lane {i} of {at:?}");
        }
    }
}

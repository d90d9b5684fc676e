//! Displacement fields (case 58).

use super::case::Checks;
use super::lab::Lab;
use crate::kernels::layout::{
    DISPLACEMENT_AIMED, DISPLACEMENT_DIRECTIONS, DISPLACEMENT_MISS, DISPLACEMENT_POSITIONS, DisplacementCarrier,
    DisplacementField, DisplacementNode, DisplacementOwn, MET, NONE, Ray, T_INFINITE,
};
use crate::schedule::{Lamp, Pass, Step};
use crate::secondary::displacement::kernels::{CARRIERS, CODES, FAMILY, FIELDS, NODES, TABLE, sift};
use crate::secondary::displacement::{Chord, FieldView, Shape};
use anyhow::Result;

const PASS: Pass = Pass::Shadow(Lamp::Sun);
const SHAPE: Shape = Shape { rings: 4, directions: 8 };
/// Halfway along the chord.
const HALFWAY: u32 = 127;

/// What is expected of a ray: the field says that it is met, that it is free, or nothing, and it is traced.
#[derive(Clone, Copy, PartialEq)]
enum Says {
    Met,
    Free,
    Nothing,
}

/// Case 58: a field around the frame's origin, a sphere of radius 1, in which every ray is met halfway along its chord,
/// and one in which none is. Rays from outside are answered, so are those from inside that are met beyond their start;
/// the others, behind whose start something is, are traced. Tangents and rays that pass it are free.
pub fn displacement(lab: &mut Lab, checks: &mut Checks) -> Result<()> {
    let mut stage = lab.bare_stage()?;
    stage.begin_frame();
    let below_one = 1.0 - f32::EPSILON / 2.0;
    let cases = [
        ("from outside", [-3.0, 0.0, 0.0], [1.0, 0.0, 0.0], Says::Met),
        ("from outside, backward", [-3.0, 0.0, 0.0], [-1.0, 0.0, 0.0], Says::Free),
        ("from outside, a long direction", [0.0, 5.0, 0.1], [0.0, -64.0, 0.0], Says::Met),
        ("inside, before what is met", [-0.5, 0.1, 0.0], [1.0, 0.0, 0.0], Says::Met),
        ("inside, behind what is met", [0.5, 0.1, 0.0], [1.0, 0.0, 0.0], Says::Nothing),
        ("in the middle", [0.0, 0.0, 0.0], [0.0, 1.0, 0.0], Says::Nothing),
        ("on the sphere, inward", [-1.0, 0.0, 0.0], [1.0, 0.0, 0.0], Says::Met),
        ("on the sphere, outward", [1.0, 0.0, 0.0], [1.0, 0.0, 0.0], Says::Nothing),
        ("a tangent", [-3.0, 1.0, 0.0], [1.0, 0.0, 0.0], Says::Free),
        ("a tangent but for rounding", [-3.0, below_one, 0.0], [1.0, 0.0, 0.0], Says::Met),
        ("at a pole", [0.0, 0.0, 9.0], [0.0, 0.0, -1.0], Says::Met),
        ("beside it", [-3.0, 1.5, 0.0], [1.0, 0.0, 0.0], Says::Free),
        ("far away", [1e9, 1e9, 1e9], [-1.0, -1.0, -1.0], Says::Met),
        ("far away, beside it", [1e9, -1e9, 2e9], [1.0, 0.5, 0.25], Says::Free),
    ];
    let rays: Vec<Ray> = cases
        .iter()
        .map(|&(_, origin, direction, _)| Ray { origin, t_min: 0.0, direction, t_max: T_INFINITE })
        .collect();
    let table = SHAPE.table();
    let executor = &mut *stage.opened.executor;
    let words = SHAPE.samples().div_ceil(4) as usize;
    executor.reserve(&FAMILY, &[1, 1, 1, table.len(), words, 1])?;
    let row = |k: usize| std::array::from_fn(|j| if j == k { 1.0 } else { 0.0 });
    let carrier =
        DisplacementCarrier { unit_from_point: std::array::from_fn(row), field: 0, brick: NONE, ..Default::default() };
    let field = DisplacementField { rings: SHAPE.rings, directions: SHAPE.directions, bits: 8, ..Default::default() };
    let node = DisplacementNode { min: [-1.0; 3], max: [1.0; 3], is_leaf: 1, ..Default::default() };
    executor.write(&FAMILY, NODES, 0, bytemuck::bytes_of(&node));
    executor.write(&FAMILY, CARRIERS, 0, bytemuck::bytes_of(&carrier));
    executor.write(&FAMILY, FIELDS, 0, bytemuck::bytes_of(&field));
    executor.write(&FAMILY, TABLE, 0, bytemuck::cast_slice(&table));
    let both = DISPLACEMENT_POSITIONS | DISPLACEMENT_DIRECTIONS;
    for look in [DISPLACEMENT_AIMED, DISPLACEMENT_AIMED | both, 0] {
        for code in [HALFWAY, DISPLACEMENT_MISS] {
            let codes = vec![code * 0x0101_0101; words];
            executor.write(&FAMILY, CODES, 0, bytemuck::cast_slice(&codes));
            executor.set_rays(PASS, &rays);
            let own = DisplacementOwn { fields: 1, nodes: 1, look, near: 0.0 };
            executor.run(PASS, &[Step::StartHits, sift(&own)], &stage.opened.cache.states)?;
            let hits = executor.read_hits(PASS)?;
            for ((what, _, _, says), hit) in cases.iter().zip(&hits) {
                // Where nothing is met in the whole sphere all is known.
                let says = if code == DISPLACEMENT_MISS { Says::Free } else { *says };
                let found = match (hit.t < 0.0, hit.id) {
                    (true, MET) => Says::Met,
                    (true, NONE) => Says::Free,
                    _ => Says::Nothing,
                };
                checks.equal(&format!("{what}, code {code}, look {look}: as expected"), found == says, true);
            }
            let view = FieldView { shape: SHAPE, table: &table, codes: &codes, bits: 8, mean: 0.5 };
            let mut wrong = 0;
            for ray in &rays {
                let length = ray.direction.iter().map(|x| x * x).sum::<f32>().sqrt();
                let chord = Chord::of(ray.origin, ray.direction.map(|x| x / length));
                let share = chord.map(|chord| view.share(&chord, look));
                let expected = if code == DISPLACEMENT_MISS { -1.0 } else { 0.5 };
                wrong += u64::from(share.is_some_and(|share| share.is_nan() || (share - expected).abs() > 1e-6));
            }
            checks.none("shares of chords that are not those stored", wrong, rays.len() as u64);
        }
    }
    Ok(())
}

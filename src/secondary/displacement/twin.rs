//! Displacement fields: the twin of `shaders/displacement/displacement_sift.wgsl`.

use super::field::{Chord, FieldView};
use super::shape::Shape;
use crate::kernels::bound::{Bound, Tally, atomic};
use crate::kernels::layout::{
    COUNTER_RAYS_ANSWERED, COUNTER_RAYS_SHORTENED, DISPLACEMENT_ABSENT, DisplacementCarrier, DisplacementField,
    DisplacementNode, DisplacementOwn, DisplacementPosition, Hit, MET, NONE, PARAM_ANY_HIT, Ray, STATE_GEOMETRY,
};
use crate::kernels::rays::RaySet;
use crate::kernels::table::words;
use crate::kernels::vector::{Vec3, each, least, most};
use crate::math::exact::{divide, square_root};
use crate::schedule::ExecutorError;
use rayon::prelude::*;
use std::f32::consts::FRAC_PI_2;
use std::sync::atomic::{AtomicU32, Ordering};

/// Rays that a task answers in a row.
const RUN: usize = 256;
/// Slower than this, in device units a unit of t, a ray stays where it is on an axis.
const LEAST_SPEED: f32 = 8.673_617_4e-19;
/// Nodes that wait at most: more than the height of a tree of carriers.
pub const STACK: usize = 40;

/// What rays are asked against.
struct Scene<'a> {
    bound: &'a Bound<'a>,
    own: &'a DisplacementOwn,
    nodes: &'a [DisplacementNode],
    carriers: &'a [DisplacementCarrier],
    fields: &'a [DisplacementField],
    table: &'a [DisplacementPosition],
    codes: &'a [u32],
    asked: &'a [AtomicU32],
}

/// What is known of a ray.
struct Known {
    /// Where it meets something for sure; below 0: nothing is known of.
    met: f32,
    /// Up to where it must be traced; below 0: nowhere.
    traced: f32,
    /// Tracing would bring in a brick, or meets a copy.
    is_worth: bool,
}

/// The interval of t in which a ray is in a box.
fn box_range(node: &DisplacementNode, origin: Vec3, inverse: Vec3) -> [f32; 2] {
    let [mut low, mut high] = [f32::NEG_INFINITY, f32::INFINITY];
    for k in 0..3 {
        let a = (node.min[k] - origin[k]) * inverse[k];
        let b = (node.max[k] - origin[k]) * inverse[k];
        (low, high) = (most(low, least(a, b)), least(high, most(a, b)));
    }
    [low, high]
}

fn product(row: &[f32; 4], v: Vec3) -> f32 {
    row[0] * v[0] + row[1] * v[1] + row[2] * v[2]
}

impl Scene<'_> {
    /// A field's samples.
    fn view(&self, field: &DisplacementField) -> FieldView<'_> {
        FieldView {
            shape: Shape { rings: field.rings, directions: field.directions },
            table: &self.table[field.table as usize..],
            codes: &self.codes[field.codes as usize..],
            bits: field.bits,
            mean: field.mean,
        }
    }

    /// Asks a carrier about the interval up to `end`; `leaves` is where the ray leaves its box.
    fn ask(&self, carrier: &DisplacementCarrier, ray: &Ray, end: f32, leaves: f32, known: &mut Known) {
        if carrier.field == NONE {
            known.traced = most(known.traced, leaves);
            return;
        }
        if carrier.brick == NONE || self.bound.slots[carrier.brick as usize].state & STATE_GEOMETRY == 0 {
            known.is_worth = true;
        }
        self.asked[carrier.field as usize].fetch_add(1, Ordering::Relaxed);
        let field = &self.fields[carrier.field as usize];
        if field.codes == NONE {
            known.traced = most(known.traced, leaves);
            return;
        }
        let m = &carrier.unit_from_point;
        let way = each(|k| product(&m[k], ray.direction));
        let start = each(|k| product(&m[k], ray.origin) + m[k][3]);
        let per_unit = divide(1.0, square_root(way[0] * way[0] + way[1] * way[1] + way[2] * way[2]));
        let Some(chord) = Chord::of(start, way.map(|x| x * per_unit)) else { return };
        let enter = (chord.at - chord.half) * per_unit;
        let leave = (chord.at + chord.half) * per_unit;
        if leave < ray.t_min || enter > end {
            return;
        }
        let near = self.own.near * divide(FRAC_PI_2, field.rings as f32) * per_unit;
        let share = self.view(field).share(&chord, self.own.look);
        let t = chord.distance(share) * per_unit;
        if share < 0.0 || t > end {
            if enter < near && near > ray.t_min {
                known.traced = most(known.traced, least(near, leave));
            }
        } else if t <= near {
            known.traced = most(known.traced, leave);
        } else if known.met < 0.0 || t < known.met {
            known.met = t;
        }
    }

    /// What is known of a ray up to `end`.
    fn know(&self, ray: &Ray, end: f32, is_any: bool) -> Known {
        let inverse = ray.direction.map(|speed| {
            let least = if speed < 0.0 { -LEAST_SPEED } else { LEAST_SPEED };
            divide(1.0, if speed.abs() < LEAST_SPEED { least } else { speed })
        });
        let mut known = Known { met: -1.0, traced: -1.0, is_worth: self.own.look & DISPLACEMENT_ABSENT == 0 };
        let mut stack = [0; STACK];
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let node = &self.nodes[stack[count] as usize];
            let [enter, leave] = box_range(node, ray.origin, inverse);
            if most(enter, ray.t_min) > least(leave, end) {
                continue;
            }
            if node.is_leaf == 0 {
                stack[count] = node.first + 1;
                stack[count + 1] = node.first;
                count += 2;
                continue;
            }
            self.ask(&self.carriers[node.first as usize], ray, end, leave, &mut known);
            // What a ray meets first is not known of the closest hit; any is enough.
            let is_met = known.met >= 0.0;
            if if is_any { is_met && known.is_worth } else { is_met || known.traced >= end } {
                break;
            }
        }
        known
    }

    /// Answers a ray, or a part of it.
    fn sift(&self, ray: &Ray, hit: &mut Hit, is_any: bool, tally: &mut Tally) {
        let known = self.know(ray, hit.t, is_any);
        if !known.is_worth || !is_any && known.met >= 0.0 {
            return;
        }
        if known.met >= 0.0 {
            *hit = Hit { t: -1.0, id: MET, u: 0.0, v: 0.0 };
            tally.add(COUNTER_RAYS_ANSWERED, 1);
        } else if known.traced < ray.t_min {
            hit.t = -1.0;
            tally.add(COUNTER_RAYS_ANSWERED, 1);
        } else if known.traced < hit.t {
            hit.t = known.traced;
            tally.add(COUNTER_RAYS_SHORTENED, 1);
        }
    }
}

/// Answers the rays of the pass that fields tell, before rays are traced.
pub fn displacement_sift(bound: &Bound, buffers: &mut [Vec<u32>], own: &mut RaySet) -> Result<(), ExecutorError> {
    let told: &DisplacementOwn = bound.own();
    if told.nodes == 0 {
        return Ok(());
    }
    let [nodes, carriers, fields, table, codes, asked] = words(buffers)?;
    let scene = Scene {
        bound,
        own: told,
        nodes: bytemuck::cast_slice(nodes),
        carriers: bytemuck::cast_slice(carriers),
        fields: bytemuck::cast_slice(fields),
        table: bytemuck::cast_slice(table),
        codes,
        asked: atomic(asked),
    };
    let is_any = bound.has(PARAM_ANY_HIT);
    own.hits.par_chunks_mut(RUN).zip(own.rays.par_chunks(RUN)).for_each(|(hits, rays)| {
        let mut tally = Tally::default();
        for (hit, ray) in hits.iter_mut().zip(rays) {
            if ray.t_min <= ray.t_max && ray.t_min <= hit.t {
                scene.sift(ray, hit, is_any, &mut tally);
            }
        }
        bound.counters.add(&tally);
    });
    Ok(())
}

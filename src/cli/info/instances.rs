//! `info --instances`: what `walk --motion` can move, by number and by name.

use crate::session::provenance;
use bricks::Resident;
use serde::Serialize;
use std::fmt::Write;

/// An instance of a scene, the world not counted.
#[derive(Debug, PartialEq, Serialize)]
pub struct Row<'a> {
    instance: u32,
    /// Its node.
    node: &'a str,
    /// Nodes above it that were asked for on conversion, the outermost first.
    under: &'a [String],
    mesh: &'a str,
    triangles: u32,
    bounds_min: [f64; 3],
    bounds_max: [f64; 3],
}

/// All instances but the world.
pub fn rows(resident: &Resident) -> Vec<Row<'_>> {
    let step = f64::from(resident.objects[0].step_log2).exp2();
    let mut bounds = vec![[[i64::MAX; 3], [i64::MIN; 3]]; resident.instances.len()];
    for leaf in &resident.leaves {
        let own = resident.leaf_box(leaf);
        let all = &mut bounds[leaf.instance as usize];
        for k in 0..3 {
            (all[0][k], all[1][k]) = (all[0][k].min(own[0][k]), all[1][k].max(own[1][k]));
        }
    }
    let row = |(instance, record): (u32, &bricks::Instance)| {
        let from = provenance(&resident.manifest, record.base);
        let [min, max] = bounds[instance as usize].map(|corner| corner.map(|x| x as f64 * step));
        Row {
            instance,
            node: from.map_or("", |from| &from.node),
            under: from.map_or(&[], |from| &from.under),
            mesh: from.map_or("", |from| &from.mesh),
            triangles: resident.objects[record.object as usize].triangle_count,
            bounds_min: min,
            bounds_max: max,
        }
    };
    (0u32..).zip(&resident.instances).skip(1).map(row).collect()
}

/// The same, a line each.
pub fn human(rows: &[Row]) -> String {
    if rows.is_empty() {
        return "no instances: every mesh is part of the world object; convert with --movable NAME to keep a node's \
                meshes apart\n"
            .into();
    }
    let mut text = String::new();
    for row in rows {
        let names = row.under.iter().map(String::as_str).chain([row.node]).collect::<Vec<_>>().join(" / ");
        let [x, y, z]: [f64; 3] = std::array::from_fn(|k| 0.5 * (row.bounds_min[k] + row.bounds_max[k]));
        // Writing to a string does not fail.
        let _ = writeln!(
            text,
            "instance {}: node {names}, mesh {}, {} triangles around {x:.3} {y:.3} {z:.3}",
            row.instance, row.mesh, row.triangles
        );
    }
    text
}

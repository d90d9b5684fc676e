//! Where a triangle comes from: its file, node, mesh and primitive.

use bricks::{Manifest, Provenance};
use serde::Serialize;

/// Where a triangle comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Origin {
    /// Its global id.
    pub id: u32,
    /// The file that it was converted from.
    pub file: String,
    /// Its node.
    pub node: String,
    /// Its mesh.
    pub mesh: String,
    /// Its primitive in the mesh.
    pub primitive: u32,
    /// Its number within the primitive, strips and fans expanded.
    pub triangle: u32,
}

impl Origin {
    /// Of a global id; `None`: no triangle has it.
    pub fn of(manifest: &Manifest, id: u32) -> Option<Self> {
        let p = provenance(manifest, id)?;
        let triangle = id - p.first_id;
        let source = manifest.sources.get(p.source as usize);
        (triangle < p.count).then(|| Self {
            id,
            file: source.map_or_else(|| format!("source {}", p.source), |s| s.name.clone()),
            node: p.node.clone(),
            mesh: p.mesh.clone(),
            primitive: p.primitive,
            triangle,
        })
    }

    /// In a line.
    pub fn human(&self) -> String {
        format!(
            "triangle {}: file {}, node {}, mesh {}, primitive {}, triangle {} of it\n",
            self.id, self.file, self.node, self.mesh, self.primitive, self.triangle
        )
    }
}

/// The last range of triangles that begins at `id` or before it.
pub fn provenance(manifest: &Manifest, id: u32) -> Option<&Provenance> {
    let after = manifest.provenance.partition_point(|one| one.first_id <= id);
    manifest.provenance[..after].last()
}

#[cfg(test)]
mod tests {
    use super::*;
    use bricks::Source;

    fn manifest() -> Manifest {
        let range = |first_id, count, node: &str| Provenance {
            first_id,
            count,
            source: 0,
            node: node.into(),
            mesh: "mesh".into(),
            primitive: first_id,
            under: Vec::new(),
        };
        Manifest {
            sources: vec![Source { name: "a.gltf".into(), bytes: 5, hash: "00".into() }],
            triangle_ids: 30,
            provenance: vec![range(0, 10, "left"), range(10, 0, "empty"), range(10, 20, "right")],
            ..Manifest::default()
        }
    }

    #[test]
    fn ids_are_traced_to_their_primitive() {
        let m = manifest();
        for (id, node, triangle) in [(0, "left", 0), (9, "left", 9), (10, "right", 0), (29, "right", 19)] {
            let o = Origin::of(&m, id).unwrap();
            assert_eq!((o.node.as_str(), o.triangle, o.file.as_str()), (node, triangle, "a.gltf"), "{id}");
        }
        assert_eq!(Origin::of(&m, 30), None);
        assert_eq!(Origin::of(&m, u32::MAX), None);
        assert_eq!(Origin::of(&Manifest::default(), 0), None);
        let text = Origin::of(&m, 12).unwrap().human();
        for part in ["triangle 12:", "a.gltf", "node right", "mesh mesh", "primitive 10", "triangle 2 of it"] {
            assert!(text.contains(part), "{text}");
        }
    }
}

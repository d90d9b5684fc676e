//! Reads the parts of a source and checks that they hold together.

use super::objects::{Part, Piece, Plan, rule};
use crate::build::error::BuildError;
use crate::progress::Progress;
use crate::source::{Outline, PART_TRIANGLES, Primitive, Source};
use rayon::prelude::*;
use std::borrow::Cow;

/// Triangles of one task where all geometry is in memory.
const TASK_TRIANGLES: u32 = 1 << 14;

/// The parts of a source, by mesh.
type Loaded<'a> = Vec<Vec<Option<Cow<'a, Primitive>>>>;

/// Gives the geometry of parts.
pub(crate) struct Reader<'a> {
    source: &'a dyn Source,
    /// All parts in use, if they fit in memory.
    loaded: Option<Loaded<'a>>,
}

impl<'a> Reader<'a> {
    /// Reads a part each time it is asked for.
    pub fn lazy(source: &'a dyn Source) -> Self {
        Self { source, loaded: None }
    }

    /// Triangles of one task: small where geometry is in memory, else so that parts are read once.
    pub fn task_triangles(&self) -> u32 {
        if self.loaded.is_some() || self.source.is_in_memory() { TASK_TRIANGLES } else { PART_TRIANGLES }
    }

    /// Reads all parts that the plan uses. The first error in order of meshes is the one returned.
    pub fn eager(source: &'a dyn Source, plan: &Plan, progress: &Progress) -> Result<Self, BuildError> {
        let outline = source.outline();
        let mut is_used: Vec<Vec<bool>> = outline.meshes.iter().map(|mesh| vec![false; mesh.parts.len()]).collect();
        plan.objects.iter().flat_map(|object| &object.parts).for_each(|part| {
            is_used[part.mesh as usize][part.part as usize] = true;
        });
        let used: Vec<(usize, usize)> = (0..)
            .zip(&is_used)
            .flat_map(|(mesh, parts)| (0..).zip(parts).filter(|(_, is)| **is).map(move |(part, _)| (mesh, part)))
            .collect();
        let triangles = |&(mesh, part): &(usize, usize)| outline.meshes[mesh].parts[part].triangles;
        progress.phase("read", used.iter().map(|key| u64::from(triangles(key))).sum());
        let read = |key: &(usize, usize)| {
            progress.check()?;
            let primitive = source.part(key.0, key.1)?;
            check(outline, *key, &primitive, 0..triangles(key))?;
            progress.advance(u64::from(triangles(key)));
            Ok(primitive)
        };
        let parts: Vec<Result<Cow<Primitive>, BuildError>> = used.par_iter().with_max_len(1).map(read).collect();
        let mut loaded: Loaded = is_used.iter().map(|parts| vec![None; parts.len()]).collect();
        for (&(mesh, part), primitive) in used.iter().zip(parts) {
            loaded[mesh][part] = Some(primitive?);
        }
        Ok(Self { source, loaded: Some(loaded) })
    }

    /// The geometry that a piece is of; that of the piece has been checked.
    pub fn get(&self, piece: &Piece) -> Result<Cow<'_, Primitive>, BuildError> {
        let key = (piece.part.mesh as usize, piece.part.part as usize);
        if let Some(Some(primitive)) = self.loaded.as_ref().map(|loaded| &loaded[key.0][key.1]) {
            return Ok(Cow::Borrowed(primitive));
        }
        let primitive = self.source.part(key.0, key.1)?;
        check(self.source.outline(), key, &primitive, piece.first..piece.end)?;
        Ok(primitive)
    }

    /// The geometry of a part if all parts were read at once.
    pub fn loaded(&self, part: &Part) -> Option<&Primitive> {
        self.loaded.as_ref()?[part.mesh as usize][part.part as usize].as_deref()
    }

    /// The file of a part, if any, and the number of its vertex `vertex` there.
    pub fn origin(&self, part: &Part, vertex: u32) -> (Option<String>, u64) {
        self.source.origin(part.mesh as usize, part.part as usize, vertex)
    }

    /// What was repaired in the parts that were read.
    pub fn repairs(&self) -> Vec<String> {
        self.source.repairs()
    }

    /// Everything but the geometry.
    pub fn outline(&self) -> &'a Outline {
        self.source.outline()
    }
}

/// Checks the lengths of the arrays of a part, and the indices of some of its triangles.
fn check(
    outline: &Outline,
    (mesh, part): (usize, usize),
    primitive: &Primitive,
    triangles: std::ops::Range<u32>,
) -> Result<(), BuildError> {
    let (mesh, part) = (&outline.meshes[mesh], &outline.meshes[mesh].parts[part]);
    let what = |of: &str| format!("mesh \"{}\", primitive {}: {of}", mesh.name, part.primitive);
    let (vertices, corners) = (primitive.positions.len(), primitive.indices.len());
    let lengths = [
        ("normals", primitive.normals.as_ref().map(Vec::len)),
        ("texture coordinates", primitive.uvs.as_ref().map(Vec::len)),
        ("second texture coordinates", primitive.uvs1.as_ref().map(Vec::len)),
        ("colours", primitive.colors.as_ref().map(Vec::len)),
    ];
    for (of, length) in lengths {
        let length = length.unwrap_or(vertices);
        rule(length == vertices, what(of), length, format!("{vertices}, one a vertex"))?;
    }
    let tangents = primitive.tangents.as_ref().map_or(corners, Vec::len);
    rule(tangents == corners, what("tangents"), tangents, format!("{corners}, one a corner"))?;
    let (indices, expected) = (corners, part.triangles as usize * 3);
    rule(indices == expected, what("indices"), indices, format!("{expected}, three a triangle"))?;
    let some = &primitive.indices[triangles.start as usize * 3..triangles.end as usize * 3];
    let largest = some.iter().max().map_or(0, |&index| index as usize);
    rule(some.is_empty() || largest < vertices, what("index"), largest, format!("less than {vertices}"))?;
    let (material, materials) = (primitive.material as usize, outline.materials.len());
    rule(material < materials, what("material"), material, format!("less than {materials}"))
}

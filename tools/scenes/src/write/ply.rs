//! Scenes as binary PLY for other programs: the triangles alone, placed in the world.

use super::output;
use crate::error::Error;
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{Placement, Primitive, Source};
use std::fs::File;
use std::io::{self, Seek, SeekFrom, Write};
use std::path::Path;

/// Whether the extension of `path` stands for PLY, upper and lower case alike.
pub fn is_ply(path: &Path) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("ply"))
}

/// Writes the triangles of a scene as PLY 1.0, little-endian: positions as f32 in world units, and three indices a
/// face, in the order of placements. There are no materials, normals or instances. What is held is a part; the file
/// appears complete or not at all.
///
/// # Errors
///
/// [`Error::Write`] when the file cannot be written or has 2³² vertices or more, [`Error::Interrupted`].
pub fn write_ply(scene: &dyn Source, path: &Path, progress: &Progress) -> Result<(), Error> {
    let failed = |source| Error::Write { path: path.to_path_buf(), source };
    let outline = scene.outline();
    let triangles = |p: &Placement| outline.meshes[p.mesh as usize].triangle_count();
    progress.phase("writing", outline.placements.iter().map(triangles).sum());
    let temporary_file = || tempfile::tempfile_in(output::folder(path)).map_err(failed);
    // Counts come first, but are known last.
    let [mut vertices, mut faces] = [temporary_file()?, temporary_file()?];
    let mut written = Written::default();
    for placement in &outline.placements {
        for part in 0..outline.meshes[placement.mesh as usize].parts.len() {
            progress.check()?;
            let primitive = scene.part(placement.mesh as usize, part)?;
            written.add(&primitive, placement, &mut vertices, &mut faces).map_err(failed)?;
            progress.advance(primitive.indices.len() as u64 / 3);
        }
    }
    let mut temporary = output::temporary(path).map_err(failed)?;
    let mut write = |file: &mut File| {
        file.write_all(written.header().as_bytes())?;
        for part in [&mut vertices, &mut faces] {
            part.seek(SeekFrom::Start(0))?;
            io::copy(part, file)?;
        }
        Ok(())
    };
    write(temporary.as_file_mut()).and_then(|()| output::publish(temporary, path)).map_err(failed)
}

/// How much has been written.
#[derive(Default)]
struct Written {
    vertices: u64,
    faces: u64,
}

impl Written {
    fn add(&mut self, part: &Primitive, at: &Placement, vertices: &mut File, faces: &mut File) -> io::Result<()> {
        let [x, y, z] = [0, 4, 8].map(|row| &at.world_from_mesh[row..row + 4]);
        let along = |row: &[f64], p: &[f64; 3]| (row[0] * p[0] + row[1] * p[1] + row[2] * p[2] + row[3]) as f32;
        let position = |p: &[f64; 3]| [x, y, z].map(|row| along(row, p).to_le_bytes());
        vertices.write_all(part.positions.iter().map(position).collect::<Vec<_>>().as_flattened().as_flattened())?;
        let first = u32::try_from(self.vertices + part.positions.len() as u64)
            .map(|end| end - part.positions.len() as u32)
            .map_err(|_| io::Error::other("PLY numbers its vertices by 32 bits, and there are more; write S.gltf"))?;
        // A mirrored triangle is seen from its other side.
        let minor = |a: usize, b: usize| y[a] * z[b] - y[b] * z[a];
        let is_mirrored = x[0] * minor(1, 2) - x[1] * minor(0, 2) + x[2] * minor(0, 1) < 0.0;
        let mut bytes = Vec::with_capacity(13 * part.indices.len() / 3);
        for corners in part.indices.chunks_exact(3) {
            bytes.push(3);
            let order = if is_mirrored { [0, 2, 1] } else { [0, 1, 2] };
            order.into_iter().for_each(|k| bytes.extend((first + corners[k]).to_le_bytes()));
        }
        faces.write_all(&bytes)?;
        self.vertices += part.positions.len() as u64;
        self.faces += part.indices.len() as u64 / 3;
        Ok(())
    }

    fn header(&self) -> String {
        let Self { vertices, faces } = self;
        format!(
            "ply\nformat binary_little_endian 1.0\nelement vertex {vertices}\nproperty float x\nproperty float y\n\
             property float z\nelement face {faces}\nproperty list uchar uint vertex_indices\nend_header\n"
        )
    }
}

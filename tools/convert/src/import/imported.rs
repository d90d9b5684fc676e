//! Several opened files as one source.

use super::affine::{Affine, direction, multiply, point};
use super::bytes::FileState;
use super::opened::{Opened, Parts};
use crate::source::{IDENTITY, Outline, Primitive, Source, SourceError, SourceTexture};
use bricks::PunctualLight;
use std::borrow::Cow;

/// Opened inputs, one after the other; geometry and images are read when they are asked for.
#[derive(Default)]
pub struct Imported {
    outline: Outline,
    inputs: Vec<Input>,
    files: Vec<FileState>,
}

/// An opened input, and how many meshes, materials and textures precede its own.
struct Input {
    parts: Box<dyn Parts>,
    meshes: usize,
    materials: u32,
    textures: usize,
}

impl Imported {
    /// Appends an input, placed by each of `transforms`; the error says what is wrong with a placement. Each list of an
    /// input is smaller than the bytes it was read from, so sums stay within u32 for everything that fits memory.
    pub(super) fn append(&mut self, opened: Opened, transforms: &[Affine]) -> Result<(), String> {
        let Opened { outline: mut part, parts } = opened;
        let whole = &mut self.outline;
        let meshes = whole.meshes.len();
        let (materials, textures) = (whole.materials.len() as u32, whole.textures.len());
        for material in &mut part.materials {
            for texture in material.textures_mut().into_iter().filter(|texture| **texture != bricks::NONE) {
                *texture += textures as u32;
            }
        }
        for placement in &mut part.placements {
            placement.mesh += meshes as u32;
            placement.source += whole.sources.len() as u32;
        }
        for transform in transforms {
            for placement in &part.placements {
                let mut placement = placement.clone();
                if *transform != IDENTITY {
                    placement.world_from_mesh = multiply(transform, &placement.world_from_mesh);
                    if !placement.world_from_mesh.iter().all(|c| c.is_finite()) {
                        return Err(format!("takes node {} beyond the range of numbers", placement.name));
                    }
                }
                whole.placements.push(placement);
            }
        }
        for transform in transforms {
            let placed = part.lights.iter().map(|light| turned(light, transform));
            whole.lights.extend(placed.collect::<Option<Vec<_>>>().ok_or("takes a light beyond the range of numbers")?);
        }
        whole.meshes.append(&mut part.meshes);
        whole.materials.append(&mut part.materials);
        whole.textures.append(&mut part.textures);
        whole.sources.append(&mut part.sources);
        whole.warnings.append(&mut part.warnings);
        whole.has_animation |= part.has_animation;
        self.inputs.push(Input { parts, meshes, materials, textures });
        Ok(())
    }

    /// The files that were looked for, as they were then: if they are the same, so is the scene.
    pub fn files(&self) -> &[FileState] {
        &self.files
    }

    /// Notes the files that were looked for.
    pub(super) fn set_files(&mut self, files: Vec<FileState>) {
        self.files = files;
    }

    /// Notes a file that was read besides those of the inputs.
    pub(super) fn add_source(&mut self, source: bricks::Source) {
        self.outline.sources.push(source);
    }

    /// Notes what was ignored in the inputs as a whole.
    pub(super) fn warn(&mut self, line: String) {
        self.outline.warnings.push(line);
    }

    /// The input for which `first` is at most `index`, the last such.
    fn input(&self, index: usize, first: impl Fn(&Input) -> usize) -> &Input {
        // The first input begins at 0, so at least one begins at or before any index.
        &self.inputs[self.inputs.partition_point(|input| first(input) <= index) - 1]
    }
}

/// A light placed anew; its range and strength are those of the world. `None`: its place is not finite.
fn turned(light: &PunctualLight, transform: &Affine) -> Option<PunctualLight> {
    let position = point(transform, light.position);
    let direction = direction(transform, light.direction).unwrap_or(light.direction);
    position.iter().all(|c| c.is_finite()).then_some(PunctualLight { position, direction, ..*light })
}

impl Source for Imported {
    fn outline(&self) -> &Outline {
        &self.outline
    }

    fn part(&self, mesh: usize, part: usize) -> Result<Cow<'_, Primitive>, SourceError> {
        let input = self.input(mesh, |input| input.meshes);
        let mut primitive = input.parts.part(mesh - input.meshes, part)?;
        primitive.material += input.materials;
        Ok(Cow::Owned(primitive))
    }

    fn origin(&self, mesh: usize, part: usize, vertex: u32) -> (Option<String>, u64) {
        let input = self.input(mesh, |input| input.meshes);
        let number = input.parts.vertex(mesh - input.meshes, part, vertex);
        (Some(input.parts.label().to_owned()), number.unwrap_or(vertex.into()))
    }

    fn texture(&self, index: usize) -> Result<Cow<'_, SourceTexture>, SourceError> {
        let input = self.input(index, |input| input.textures);
        input.parts.texture(index - input.textures).map(Cow::Owned)
    }

    fn repairs(&self) -> Vec<String> {
        self.inputs.iter().flat_map(|input| input.parts.repairs()).collect()
    }
}

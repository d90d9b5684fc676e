//! What frames saw, as arrays.

use crate::frame::{Guides, Moved, SampleNoise, Second, Seen};
use crate::kernels::layout::NONE;
use crate::output::arrays::{Read, Writing};
use crate::scene::{Camera, Projection};
use anyhow::{Result, ensure};
use bytemuck::NoUninit;
use glam::{DVec3, Vec3};

/// Where in its pixel the first sample lies, and how many pixels have a second surface.
pub type Sampled = ([f64; 2], usize);

/// Puts what `surfaces` are into arrays whose names begin with `name`.
fn push_seen(arrays: &mut Writing, name: &str, surfaces: &[Seen]) {
    fn put<T: NoUninit>(arrays: &mut Writing, name: String, surfaces: &[Seen], of: impl Fn(&Seen) -> T) {
        arrays.push(&name, &surfaces.iter().map(of).collect::<Vec<T>>());
    }
    put(arrays, format!("{name}.point"), surfaces, |seen| seen.point.to_array());
    put(arrays, format!("{name}.plane"), surfaces, |seen| seen.plane.to_array());
    put(arrays, format!("{name}.normal"), surfaces, |seen| seen.normal.to_array());
    put(arrays, format!("{name}.id"), surfaces, |seen| seen.id);
    put(arrays, format!("{name}.footprint"), surfaces, |seen| seen.footprint);
    put(arrays, format!("{name}.albedo"), surfaces, |seen| seen.albedo);
    put(arrays, format!("{name}.polish"), surfaces, |seen| seen.polish);
}

fn read_seen(read: &Read, name: &str, count: usize) -> Result<Vec<Seen>> {
    let points: Vec<[f64; 3]> = read.array(&format!("{name}.point"), count)?;
    let planes: Vec<[f32; 3]> = read.array(&format!("{name}.plane"), count)?;
    let normals: Vec<[f32; 3]> = read.array(&format!("{name}.normal"), count)?;
    let ids: Vec<u32> = read.array(&format!("{name}.id"), count)?;
    let footprints: Vec<f32> = read.array(&format!("{name}.footprint"), count)?;
    let albedos: Vec<[f32; 3]> = read.array(&format!("{name}.albedo"), count)?;
    let polishes: Vec<f32> = read.array(&format!("{name}.polish"), count)?;
    let seen = points.into_iter().zip(planes).zip(normals).zip(ids).zip(footprints).zip(albedos).zip(polishes);
    let seen = seen.map(|((((((point, plane), normal), id), footprint), albedo), polish)| Seen {
        point: DVec3::from_array(point),
        plane: Vec3::from_array(plane),
        normal: Vec3::from_array(normal),
        id,
        footprint,
        albedo,
        polish,
    });
    let seen: Vec<Seen> = seen.collect();
    ensure!(seen.len() == count, "{name} of a part is not of {count} pixels");
    Ok(seen)
}

/// Puts guides into arrays, but for what follows from the camera and from what moves.
pub fn push(arrays: &mut Writing, guides: &Guides) {
    push_seen(arrays, "seen", &guides.seen);
    arrays.push("direct", &guides.direct);
    arrays.push("around", &guides.around);
    arrays.push("noise.samples", &guides.noise.iter().map(|noise| noise.samples).collect::<Vec<_>>());
    arrays.push("noise.spreads", &guides.noise.iter().map(|noise| noise.spreads).collect::<Vec<_>>());
    let number = |second: &Option<Second>, next: &mut u32| match second {
        Some(_) => std::mem::replace(next, *next + 1),
        None => NONE,
    };
    let mut next = 0;
    arrays.push("second.number", &guides.second.iter().map(|one| number(one, &mut next)).collect::<Vec<u32>>());
    let seconds: Vec<Second> = guides.second.iter().flatten().copied().collect();
    push_seen(arrays, "second", &seconds.iter().map(|second| second.seen).collect::<Vec<_>>());
    arrays.push("second.light", &seconds.iter().map(|second| second.light).collect::<Vec<_>>());
}

/// Guides of so many pixels of a picture of this size by `camera`, in which nothing has moved.
///
/// # Errors
/// An array is not of this size.
pub fn read(
    read: &Read,
    (size, pixels): ((u32, u32), usize),
    camera: &Camera,
    (jitter, seconds): Sampled,
) -> Result<Guides> {
    let light: Vec<[f32; 3]> = read.array("second.light", seconds)?;
    let surfaces = read_seen(read, "second", seconds)?;
    let second: Vec<Second> = surfaces.into_iter().zip(light).map(|(seen, light)| Second { seen, light }).collect();
    let numbers: Vec<u32> = read.array("second.number", pixels)?;
    let samples: Vec<u32> = read.array("noise.samples", pixels)?;
    let spreads: Vec<[f32; 2]> = read.array("noise.spreads", pixels)?;
    let guides = Guides {
        size,
        projection: Projection::new(camera, size),
        jitter,
        seen: read_seen(read, "seen", pixels)?,
        direct: read.array("direct", pixels)?,
        around: read.array("around", pixels)?,
        noise: samples.into_iter().zip(spreads).map(|(samples, spreads)| SampleNoise { samples, spreads }).collect(),
        second: numbers.into_iter().map(|number| second.get(number as usize).copied()).collect(),
        moved: Moved::default(),
    };
    let lengths = [guides.direct.len(), guides.around.len(), guides.noise.len(), guides.second.len()];
    ensure!(lengths == [pixels; 4] && second.len() == seconds, "a part's guides have {lengths:?} pixels, not {pixels}");
    Ok(guides)
}

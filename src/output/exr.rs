//! OpenEXR files of a frame's arbitrary output variables.

use super::atomic;
use anyhow::{Context, Result, ensure};
use exr::prelude::{
    AnyChannel, AnyChannels, Blocks, Compression, Encoding, FlatSamples, Image, Layer, LayerAttributes, LineOrder,
    Vec2, WritableImage,
};
use std::io::{Cursor, Write};
use std::path::Path;

/// What a frame knows of every pixel, row by row from the top; each array has `width` x `height` entries.
#[derive(Clone, Copy, Debug)]
pub struct Aovs<'a> {
    /// Pixels in a row.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Linear radiance, Rec. 709: channels `R G B`.
    pub radiance: &'a [[f32; 3]],
    /// Distance along the ray in world units, +inf on a miss: `depth.Z`.
    pub depth: &'a [f32],
    /// Geometric normal in world space, unit, towards the camera: `normal.X normal.Y normal.Z`.
    pub normal: &'a [[f32; 3]],
    /// Global triangle id, [`u32::MAX`] on a miss: `triangle.id` (u32).
    pub triangle: &'a [u32],
    /// Linear base colour: `albedo.R albedo.G albedo.B`.
    pub albedo: &'a [[f32; 3]],
    /// Of frames with a budget 0 where the pixel is exact, 1 where a level of detail stands in for what is missing, 2
    /// where nothing does: `state.id` (u32). Others have none.
    pub state: Option<&'a [u32]>,
}

/// Writes one EXR with one part, scan lines, ZIP compression; the same values give the same bytes.
///
/// # Errors
/// An array has the wrong length, or the file cannot be written.
pub fn write(path: &Path, aovs: &Aovs) -> Result<()> {
    let pixels = aovs.width as usize * aovs.height as usize;
    let state = aovs.state.map_or(pixels, <[u32]>::len);
    let [radiance, normal, albedo] = [aovs.radiance, aovs.normal, aovs.albedo].map(<[_]>::len);
    let lengths = [radiance, aovs.depth.len(), normal, aovs.triangle.len(), albedo, state];
    ensure!(
        pixels > 0 && lengths.iter().all(|&n| n == pixels),
        "{}: arrays of {lengths:?} entries are no image of {}x{}",
        path.display(),
        aovs.width,
        aovs.height
    );
    let plane = |values: &[[f32; 3]], axis: usize| FlatSamples::F32(values.iter().map(|v| v[axis]).collect());
    let channels = AnyChannels::sort(
        [
            ("R", plane(aovs.radiance, 0)),
            ("G", plane(aovs.radiance, 1)),
            ("B", plane(aovs.radiance, 2)),
            ("depth.Z", FlatSamples::F32(aovs.depth.to_vec())),
            ("normal.X", plane(aovs.normal, 0)),
            ("normal.Y", plane(aovs.normal, 1)),
            ("normal.Z", plane(aovs.normal, 2)),
            ("triangle.id", FlatSamples::U32(aovs.triangle.to_vec())),
            ("albedo.R", plane(aovs.albedo, 0)),
            ("albedo.G", plane(aovs.albedo, 1)),
            ("albedo.B", plane(aovs.albedo, 2)),
        ]
        .into_iter()
        .chain(aovs.state.map(|state| ("state.id", FlatSamples::U32(state.to_vec()))))
        .map(|(name, samples)| AnyChannel::new(name, samples))
        .collect(),
    );
    // Increasing line order makes the writer sort blocks that finish compressing in any order.
    let encoding =
        Encoding { compression: Compression::ZIP16, blocks: Blocks::ScanLines, line_order: LineOrder::Increasing };
    let size = Vec2(aovs.width as usize, aovs.height as usize);
    let image = Image::from_layer(Layer::new(size, LayerAttributes::default(), encoding, channels));
    let mut bytes = Vec::new();
    let context = || format!("{}: cannot write this image", path.display());
    image.write().to_buffered(Cursor::new(&mut bytes)).with_context(context)?;
    atomic::write_with(path, |out| out.write_all(&bytes).with_context(context))
}

#[cfg(test)]
mod tests {
    use super::*;
    use exr::prelude::{ReadChannels, ReadLayers, read};

    #[test]
    fn layers_round_trip_with_equal_bytes() {
        let (width, height) = (67u32, 41u32);
        let n = (width * height) as usize;
        let vectors = |seed: f32| -> Vec<[f32; 3]> {
            (0..n).map(|i| [i as f32 * seed, -(i as f32) - seed, 1.0 / (i as f32 + seed)]).collect()
        };
        let (radiance, normal, albedo) = (vectors(0.25), vectors(0.5), vectors(0.75));
        let mut depth: Vec<f32> = (0..n).map(|i| i as f32 * 0.1).collect();
        depth[3] = f32::INFINITY;
        let mut triangle: Vec<u32> = (0..n as u32).map(|i| i.wrapping_mul(2654435761)).collect();
        triangle[3] = u32::MAX;
        let aovs = Aovs {
            width,
            height,
            radiance: &radiance,
            depth: &depth,
            normal: &normal,
            triangle: &triangle,
            albedo: &albedo,
            state: Some(&triangle),
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.exr");
        write(&path, &aovs).unwrap();
        let first = std::fs::read(&path).unwrap();
        for _ in 0..3 {
            write(&path, &aovs).unwrap();
            assert!(std::fs::read(&path).unwrap() == first, "equal values, equal bytes");
        }

        let image = read()
            .no_deep_data()
            .largest_resolution_level()
            .all_channels()
            .all_layers()
            .all_attributes()
            .from_file(&path);
        let image = image.unwrap();
        assert_eq!(image.layer_data.len(), 1);
        let layer = &image.layer_data[0];
        assert_eq!(layer.size, Vec2(width as usize, height as usize));
        let channels = &layer.channel_data.list;
        let names: Vec<String> = channels.iter().map(|c| c.name.to_string()).collect();
        let expected = [
            "B",
            "G",
            "R",
            "albedo.B",
            "albedo.G",
            "albedo.R",
            "depth.Z",
            "normal.X",
            "normal.Y",
            "normal.Z",
            "state.id",
            "triangle.id",
        ];
        assert_eq!(names, expected);
        let f32s = |name: &str| match &channels.iter().find(|c| c.name.to_string() == name).unwrap().sample_data {
            FlatSamples::F32(values) => values.clone(),
            other => panic!("{name} is {other:?}"),
        };
        for (name, source, axis) in
            [("R", &radiance, 0), ("B", &radiance, 2), ("normal.Y", &normal, 1), ("albedo.G", &albedo, 1)]
        {
            assert!(f32s(name).iter().zip(source).all(|(a, b)| a.to_bits() == b[axis].to_bits()), "{name}");
        }
        assert_eq!(f32s("depth.Z"), depth);
        match &channels.last().unwrap().sample_data {
            FlatSamples::U32(ids) => assert_eq!(*ids, triangle),
            other => panic!("ids are {other:?}"),
        }
        assert!(write(&path, &Aovs { depth: &depth[1..], ..aovs }).is_err());
    }
}

//! Small scenes, and building them.

use bricks::{Material, Source};
use brickwalk_convert::build::{BuildError, BuildSettings, BuildSummary, build};
use brickwalk_convert::progress::Progress;
use brickwalk_convert::source::{IDENTITY, Mesh, Placement, Primitive, SourceScene};

/// A scene file in a folder that is removed with it.
pub struct Built {
    folder: tempfile::TempDir,
    pub summary: BuildSummary,
}

impl Built {
    pub fn path(&self) -> std::path::PathBuf {
        self.folder.path().join("scene.bricks")
    }

    pub fn bytes(&self) -> Vec<u8> {
        std::fs::read(self.path()).unwrap()
    }
}

/// Settings for tests: bricks of `brick_triangles`, two threads.
pub fn settings(brick_triangles: u32) -> BuildSettings {
    BuildSettings { brick_triangles, threads: Some(2), ..BuildSettings::default() }
}

pub fn try_build(scene: &SourceScene, settings: &BuildSettings) -> Result<Built, BuildError> {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.bricks");
    let built = build(scene.clone(), settings, &path, &Progress::hidden());
    assert_eq!(path.exists(), built.is_ok(), "a file appears if and only if it is whole");
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), usize::from(built.is_ok()), "no file is left behind");
    built.map(|summary| Built { folder, summary })
}

pub fn built(scene: &SourceScene, settings: &BuildSettings) -> Built {
    try_build(scene, settings).unwrap()
}

/// A pseudo-random sequence of numbers in 0..1.
pub struct Random(pub u64);

impl Random {
    pub fn next(&mut self) -> f64 {
        self.0 = self.0.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }

    pub fn point(&mut self, size: f64) -> [f64; 3] {
        std::array::from_fn(|_| (self.next() - 0.5) * size)
    }
}

pub fn material(color: [f32; 4]) -> Material {
    Material { base_color: color, ..Material::DIFFUSE }
}

pub fn mesh(name: &str, primitives: Vec<Primitive>) -> Mesh {
    Mesh { name: name.to_owned(), primitives }
}

pub fn placement(name: &str, mesh: u32, world_from_mesh: [f64; 12]) -> Placement {
    Placement { name: name.to_owned(), mesh, source: 0, world_from_mesh, ..Placement::default() }
}

pub fn scene(meshes: Vec<Mesh>, placements: Vec<Placement>) -> SourceScene {
    SourceScene {
        meshes,
        placements,
        materials: vec![material([0.5, 0.25, 1.0, 1.0]), material([1.0; 4])],
        sources: vec![Source { name: "test".to_owned(), bytes: 0, hash: "0".repeat(16) }],
        ..SourceScene::default()
    }
}

/// Every mesh once, where it is.
pub fn plain(primitives: Vec<Primitive>) -> SourceScene {
    scene(vec![mesh("mesh", primitives)], vec![placement("node", 0, IDENTITY)])
}

/// Triangles that share no vertices.
pub fn soup(triangles: &[[[f64; 3]; 3]]) -> Primitive {
    Primitive {
        positions: triangles.iter().flatten().copied().collect(),
        indices: (0..triangles.len() as u32 * 3).collect(),
        ..Primitive::default()
    }
}

/// A bumpy sheet of `2 n n` triangles over `size` by `size`, with UVs equal to x and z.
pub fn sheet(n: u32, size: f64) -> Primitive {
    let mut random = Random(u64::from(n));
    let mut primitive = Primitive { uvs: Some(Vec::new()), ..Primitive::default() };
    for i in 0..=n {
        for j in 0..=n {
            let [x, z] = [i, j].map(|k| size * (f64::from(k) / f64::from(n) - 0.5));
            let p = [x, size * 0.05 * random.next(), z];
            primitive.positions.push(p);
            primitive.uvs.as_mut().unwrap().push([p[0] as f32, p[2] as f32]);
            if i < n && j < n {
                let a = i * (n + 1) + j;
                let [b, c, d] = [a + 1, a + n + 1, a + n + 2];
                primitive.indices.extend([a, b, d, a, d, c]);
            }
        }
    }
    primitive
}

/// A row-major 3x4 matrix.
pub fn matrix(linear: [[f64; 3]; 3], t: [f64; 3]) -> [f64; 12] {
    std::array::from_fn(|i| if i % 4 == 3 { t[i / 4] } else { linear[i / 4][i % 4] })
}

/// A rotation about a skew axis, times a scale for each axis.
pub fn rotation(angle: f64, scale: [f64; 3]) -> [[f64; 3]; 3] {
    let (s, c) = angle.sin_cos();
    let a = [[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]];
    let b = [[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]];
    std::array::from_fn(|i| std::array::from_fn(|j| (0..3).map(|k| a[i][k] * b[k][j]).sum::<f64>() * scale[j]))
}

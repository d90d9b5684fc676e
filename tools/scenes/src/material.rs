//! The materials of generated scenes. Vertex colours multiply the base colour and bring the variety.

use bricks::{MATERIAL_DOUBLE_SIDED, Material};

/// A linear colour that multiplies a base colour.
pub type Tint = [f32; 3];

/// The tint that changes nothing.
pub const WHITE: Tint = [1.0; 3];

/// A tint scaled by `k`, clamped to what a vertex colour may hold.
pub fn shade(tint: Tint, k: f64) -> Tint {
    tint.map(|c| (f64::from(c) * k).clamp(0.0, 1.0) as f32)
}

macro_rules! materials {
    ($($name:ident: $color:expr, $roughness:expr, $flags:expr;)*) => {
        /// Index of a material.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Mat { $($name),* }

        impl Mat {
            /// How many materials there are.
            pub const COUNT: usize = [$(Mat::$name),*].len();
        }

        /// The materials, indexed by [`Mat`].
        pub fn materials() -> Vec<Material> {
            vec![$(material($color, $roughness, $flags)),*]
        }
    };
}

// Base colours are linear albedos. `Paint`, `CarPaint`, `Fabric`, `Soil` and `Ceramic` are near white: their tint is
// the colour.
materials! {
    Asphalt: [0.105, 0.105, 0.11], 0.95, 0;
    Marking: [0.72, 0.72, 0.70], 0.8, 0;
    Paving: [0.34, 0.33, 0.31], 0.9, 0;
    Kerb: [0.42, 0.42, 0.41], 0.85, 0;
    Plaster: [0.86, 0.83, 0.77], 0.9, 0;
    Brick: [0.44, 0.20, 0.14], 0.9, 0;
    TanBrick: [0.55, 0.42, 0.29], 0.9, 0;
    Concrete: [0.48, 0.47, 0.45], 0.85, 0;
    Stone: [0.64, 0.59, 0.50], 0.8, 0;
    Glass: [0.035, 0.055, 0.08], 0.05, 0;
    TowerGlass: [0.06, 0.115, 0.165], 0.05, 0;
    Paint: [0.88, 0.88, 0.88], 0.6, 0;
    Metal: [0.50, 0.51, 0.53], 0.4, 0;
    Gravel: [0.26, 0.25, 0.235], 0.95, 0;
    Tile: [0.46, 0.19, 0.115], 0.8, 0;
    Slate: [0.22, 0.245, 0.28], 0.7, 0;
    Bark: [0.17, 0.125, 0.09], 0.95, 0;
    Leaf: [0.15, 0.245, 0.065], 0.8, MATERIAL_DOUBLE_SIDED;
    Grass: [0.105, 0.16, 0.05], 0.95, 0;
    Sand: [0.47, 0.41, 0.32], 0.95, 0;
    Wood: [0.38, 0.25, 0.15], 0.8, 0;
    CarPaint: [0.85, 0.85, 0.85], 0.25, 0;
    Rubber: [0.03, 0.03, 0.03], 0.9, 0;
    Fabric: [0.85, 0.85, 0.85], 0.9, MATERIAL_DOUBLE_SIDED;
    Water: [0.05, 0.12, 0.14], 0.05, 0;
    Steel: [0.78, 0.79, 0.80], 0.45, 0;
    Soil: [1.0, 1.0, 1.0], 1.0, 0;
    Ceramic: [0.95, 0.95, 0.95], 0.2, 0;
}

/// The materials of the city, the first of all.
pub fn city_materials() -> Vec<Material> {
    let mut all = materials();
    all.truncate(Mat::Water as usize + 1);
    all
}

/// A plain material.
pub fn material(color: [f32; 3], roughness: f32, flags: u32) -> Material {
    Material { base_color: [color[0], color[1], color[2], 1.0], roughness, flags, ..Material::DIFFUSE }
}

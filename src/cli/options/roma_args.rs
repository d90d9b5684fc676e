//! Options of `--secondary roma` and `auto`.

use super::args::ranged;
use super::named::named_values;
use crate::secondary::occupancy::Source;
use crate::secondary::roma::{CLOSED, Grid, MOST_ONE_IN, MOST_STEPS, Role, RomaPass, RomaSettings, THIN};
use crate::secondary::rsm::RsmSettings;
use clap::Args;

/// Options of ray-aligned occupancy maps.
#[derive(Clone, Debug, Args)]
pub struct RomaArgs {
    /// With --secondary roma: maps of ao are made for N x N directions, 4 or 8, drawn anew for every frame and sample.
    /// Where rays are as long as 64 cells, 8 with --roma-size 64 mostly errs less, and takes half the memory
    #[arg(long, value_name = "N", default_value = "4", value_parser = |s: &str| of(s, &[4, 8]))]
    pub roma_k: u32,
    /// With --secondary roma: the same of shadow, 4 or 8
    #[arg(long, value_name = "N", default_value = "8", value_parser = |s: &str| of(s, &[4, 8]))]
    pub roma_shadow_k: u32,
    /// With --secondary roma: the same of diffuse, 4 or 8
    #[arg(long, value_name = "N", default_value = "4", value_parser = |s: &str| of(s, &[4, 8]))]
    pub roma_diffuse_k: u32,
    /// With --secondary roma: cells of a map on each axis: 32, 64, 128 or 256; of 128, 16 maps take 4 MiB for each of
    /// up to six sizes of cells
    #[arg(long, value_name = "CELLS", default_value = "128", value_parser = |s: &str| of(s, &[32, 64, 128, 256]))]
    pub roma_size: u32,
    /// With --secondary roma: how often a cell of a map looks into the scene's cells, of which there are twice as many
    /// on each axis, along the ray: 1, 2 or 4 [default: 4, which passes over none; 2 for ao, which is less dark, while
    /// thin sheets leak a little]
    #[arg(long, value_name = "N", value_parser = |s: &str| of(s, &[1, 2, 4]))]
    pub roma_samples: Option<u32>,
    /// With --secondary roma or df: what maps are made of: bricks (what every brick carries of its cells: no geometry
    /// is read, and no cell that something is in is missed), raster (the paper's: all triangles, 4M at most, rasterised
    /// along three axes and moved by up to half a cell at random in every sample: thinner, with holes, and slow)
    #[arg(long, value_name = "SOURCE", default_value = "bricks")]
    pub bom: BomSource,
    /// With --secondary roma: which rays keep their direction rather than to take that of a map (of diffuse, and of ao
    /// as long as 32 cells of bricks, one drawn by the cosine to the surface; of others the nearest), separated by
    /// commas: none, shadow, ao, diffuse, all
    #[arg(long, value_name = "LIST", value_delimiter = ',', default_value = "shadow")]
    pub roma_unsnapped: Vec<Unsnapped>,
    /// With --secondary roma: columns of cells, 1 to 64, that a ray with a direction of its own passes before it goes
    /// on in that of its map; rays_capped counts such rays
    #[arg(long, value_name = "N", default_value = "8", value_parser = |s: &str| ranged(s, 1, MOST_STEPS.into()))]
    pub roma_steps: u32,
    /// With --secondary auto: maps answer rays of ao, and one in N, 2 to 16, is traced, too, and counts for what maps
    /// get wrong of all N: the mean is that of exact rays, and where few are summed radiance may lie below 0; more take
    /// less time and are noisier. Blocks of 64 pixels go together, which shows in few rays but with --rotation full,
    /// --denoise or --taa. off: --auto-error says which are traced
    #[arg(long, value_name = "N|off", default_value = "off", value_parser = |s: &str| one_in(s))]
    pub auto_one_in: OneIn,
    /// With --secondary auto: of a hundred rays of ao or shadow, how many maps may answer otherwise than exact rays
    /// would, 0.1 to 50: rays that maps do not find free are traced up to 0, 2, 4, 8, 16 or 32 cells of a map from
    /// their start, or to their end, the least that keeps to it, and maps say what is beyond. It is measured by one ray
    /// in 16, traced to its end; while too little is measured, and where even rays found free err more, all are. off:
    /// rays in doubt are traced to their ends, and nothing is measured
    #[arg(long, value_name = "PERCENT|off", default_value = "2", value_parser = |s: &str| most_wrong(s))]
    pub auto_error: MostWrong,
    /// With --secondary roma and diffuse: texels of the longer side of the maps of what lamps light, 32 to 2048; a map
    /// of the sun covers what a map of cells does, so that 256 make them as wide as cells; a point has six of half as
    /// many on both sides
    #[arg(long, value_name = "TEXELS", default_value = "256", value_parser = |s: &str| ranged(s, 32, 2048))]
    pub rsm_size: u32,
    /// With --secondary roma and diffuse: points, spots and distant lights that have such maps, the strongest, 0 to 64;
    /// what others light does not light diffuse rays. The sun has maps besides
    #[arg(long, value_name = "N", default_value = "8", value_parser = |s: &str| ranged(s, 0, 64))]
    pub rsm_lamps: u32,
}

named_values! {
    /// Rays that keep their direction.
    Unsnapped {
        /// No others.
        None = "none",
        /// Those of shadow.
        Shadow = "shadow",
        /// Those of ao.
        Ao = "ao",
        /// Those of diffuse.
        Diffuse = "diffuse",
        /// All of them.
        All = "all",
    } later &[]
}

named_values! {
    /// What base maps are made of.
    BomSource {
        /// The maps of bricks.
        Bricks = "bricks",
        /// Triangles.
        Raster = "raster",
    } later &[]
}

impl RomaArgs {
    /// What base maps are made of.
    pub fn source(&self) -> Source {
        match self.bom {
            BomSource::Bricks => Source::Bricks,
            BomSource::Raster => Source::Triangles,
        }
    }

    /// How rays are answered; with `is_auto` exact ones are traced as far as `auto_error` or `auto_one_in` have it.
    pub fn settings(&self, is_auto: bool) -> RomaSettings {
        let pass = |k, is_unsnapped, one_in: OneIn, stride| {
            let role = match (is_auto, one_in) {
                (true, Some(one_in)) => Role::Correct(one_in),
                (true, None) => Role::Sift { most_wrong: self.auto_error },
                (false, _) => Role::Answer,
            };
            let is_sifted = matches!(role, Role::Sift { .. });
            let steps = if is_sifted { MOST_STEPS } else { self.roma_steps };
            let stride = if is_sifted { CLOSED } else { stride };
            let grid = Grid { k, size: self.roma_size, samples: 1 }.with_stride(stride);
            RomaPass {
                grid: Grid { samples: self.roma_samples.unwrap_or(grid.samples), ..grid },
                steps: if is_unsnapped || is_sifted { steps } else { 0 },
                role,
            }
        };
        let keeps = |rays| self.roma_unsnapped.iter().any(|named| [rays, Unsnapped::All].contains(named));
        RomaSettings {
            occlusion: pass(self.roma_k, keeps(Unsnapped::Ao), self.auto_one_in, THIN),
            shadow: pass(self.roma_shadow_k, keeps(Unsnapped::Shadow), None, CLOSED),
            diffuse: (!is_auto).then(|| pass(self.roma_diffuse_k, keeps(Unsnapped::Diffuse), None, CLOSED)),
            rsm: RsmSettings { size: self.rsm_size, lamps: self.rsm_lamps },
        }
    }
}

/// As of [`Role::Correct`]; `None`: as of [`Role::Sift`].
type OneIn = Option<u32>;

fn one_in(text: &str) -> Result<OneIn, String> {
    let found = text.parse().ok().filter(|n| (2..=MOST_ONE_IN).contains(n));
    match (text, found) {
        ("off", _) => Ok(None),
        (_, Some(n)) => Ok(Some(n)),
        _ => Err(format!("it must be from 2 to {MOST_ONE_IN}, or off")),
    }
}

/// As of [`Role::Sift`].
type MostWrong = Option<u32>;

fn most_wrong(text: &str) -> Result<MostWrong, String> {
    let found: Option<f64> = text.parse().ok().filter(|x| (0.1..=50.0).contains(x));
    match (text, found) {
        ("off", _) => Ok(None),
        (_, Some(percent)) => Ok(Some((1e4 * percent).round() as u32)),
        _ => Err("it must be a number from 0.1 to 50, or off".into()),
    }
}

/// Parses one of a few numbers.
pub(crate) fn of(text: &str, known: &[u32]) -> Result<u32, String> {
    let names: Vec<String> = known.iter().map(u32::to_string).collect();
    let found = text.parse().ok().filter(|n| known.contains(n));
    found.ok_or_else(|| format!("it must be one of {}", names.join(", ")))
}

//! Options of `--secondary roma` and `sift`.

use super::{CLOSED, Grid, MOST_ONE_IN, MOST_STEPS, Role, RomaPass, RomaSettings, THIN};
use crate::secondary::occupancy::Source;
use crate::secondary::rsm::RsmSettings;
use crate::secondary::{EffectMethods, Method};
use crate::settings::{Rule, names, settings};

/// Square roots of numbers of maps.
const K: Rule = Rule::OneOf(&[4, 8]);

names! {
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
    }
}

settings! {
    /// How occupancy maps answer rays.
    pub struct Options {
        /// With --secondary roma: maps of `ao` are made for N x N directions, drawn anew for every frame and sample.
        /// Where rays are as long as 64 cells, 8 with --roma-size 64 mostly errs less and takes half the memory.
        k: u32 = 4, "--roma-k N", K, "", Methods, Expert;
        /// With --secondary roma: the same of `shadow`.
        shadow_k: u32 = 8, "--roma-shadow-k N", K, "", Methods, Expert;
        /// With --secondary roma: the same of `diffuse`.
        diffuse_k: u32 = 4, "--roma-diffuse-k N", K, "", Methods, Expert;
        /// With --secondary roma: cells of a map on each axis. Of 128, 16 maps take 4 MiB for each of up to six sizes
        /// of cells.
        size: u32 = 128, "--roma-size CELLS", Rule::OneOf(&[32, 64, 128, 256]), "cells", Methods, Expert;
        /// With --secondary roma: how often a cell of a map looks into the scene's cells along the ray. [default: 4,
        /// which passes over none; 2 for `ao`, where thin sheets leak a little]
        samples: Option<u32> = None, "--roma-samples N", Rule::OneOf(&[1, 2, 4]), "", Methods, Expert;
        /// With --secondary roma or df: what maps are made of: bricks, raster. `bricks`: what every brick carries of
        /// its cells, so that no geometry is read. `raster`: the paper's way: all triangles, 4M at most, rasterised in
        /// every sample; thinner, with holes, and slow.
        bom: Source = Source::Bricks, "--bom SOURCE", Rule::Any, "", Methods, Expert;
        /// With --secondary roma: which rays keep their direction rather than take that of a map. Several have commas
        /// between them.
        unsnapped: Vec<Unsnapped> = vec![Unsnapped::Shadow], "--roma-unsnapped LIST", Rule::Any, "", Methods, Expert;
        /// With --secondary roma: columns that an unsnapped ray passes before it takes its map's direction.
        /// `rays_capped` counts rays that did.
        steps: u32 = 8, "--roma-steps N", Rule::Whole(1, MOST_STEPS as u64), "columns", Methods, Expert;
        /// With --secondary sift: maps answer rays of `ao`, and one in N is traced, too, and corrects the mean; or off.
        /// The mean is that of exact rays; more take less time and are noisier. Blocks of 64 pixels go together, which
        /// shows in few rays without --rotation full, --denoise or --taa. `off`: --auto-error says which are traced.
        one_in: Option<u32> = None, "--auto-one-in N|off", Rule::Whole(2, MOST_ONE_IN as u64), "", Methods, Expert;
        /// With --secondary sift: how many of a hundred rays of `ao` or `shadow` maps may answer wrongly; or off. Rays
        /// that maps do not find free are traced as far as that takes, which one ray in 16 measures. `off`: they are
        /// traced to their ends, and nothing is measured.
        error: Option<f64> = Some(2.0), "--auto-error PERCENT|off", Rule::Real(0.1, 50.0), "percent", Methods, Expert;
    }
}

impl Options {
    /// How rays are answered; where `chosen` has `sift`, exact ones are traced as far as `error` or `one_in` have it.
    pub fn settings(&self, rsm: RsmSettings, chosen: EffectMethods) -> RomaSettings {
        let most_wrong = self.error.map(|percent| (1e4 * percent).round() as u32);
        let pass = |method, k, is_unsnapped, one_in: Option<u32>, stride| {
            let role = match (method, one_in) {
                (Method::Roma, _) => Role::Answer,
                (Method::Sift, Some(one_in)) => Role::Correct(one_in),
                (Method::Sift, None) => Role::Sift { most_wrong },
                _ => return None,
            };
            let is_sifted = matches!(role, Role::Sift { .. });
            let steps = if is_sifted { MOST_STEPS } else { self.steps };
            let stride = if is_sifted { CLOSED } else { stride };
            let grid = Grid { k, size: self.size, samples: 1 }.with_stride(stride);
            Some(RomaPass {
                grid: Grid { samples: self.samples.unwrap_or(grid.samples), ..grid },
                steps: if is_unsnapped || is_sifted { steps } else { 0 },
                role,
            })
        };
        let keeps = |rays| self.unsnapped.iter().any(|named| [rays, Unsnapped::All].contains(named));
        RomaSettings {
            occlusion: pass(chosen.ao, self.k, keeps(Unsnapped::Ao), self.one_in, THIN),
            shadow: pass(chosen.shadow, self.shadow_k, keeps(Unsnapped::Shadow), None, CLOSED),
            diffuse: pass(chosen.diffuse, self.diffuse_k, keeps(Unsnapped::Diffuse), None, CLOSED),
            rsm,
        }
    }
}

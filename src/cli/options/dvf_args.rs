//! Options of `--secondary dvf`.

use super::args::ranged;
use super::named::named_values;
use super::roma_args::of;
use crate::secondary::dvf::answer::DvfTracing;
use crate::secondary::dvf::{CELLS, Cells, DvfSettings, DvfUse, POINTS, RAYS};
use clap::Args;
use std::path::PathBuf;

/// Options of fields of visibility.
#[derive(Clone, Debug, Args)]
pub struct DvfArgs {
    /// With --secondary dvf: points strewn by area over the triangles of the field's region, 100 to 16M; more make
    /// fewer answers wrong
    #[arg(long, value_name = "N", default_value = "400K", value_parser = |s: &str| ranged(s, POINTS[0].into(), POINTS[1].into()))]
    pub dvf_points: u32,
    /// With --secondary dvf: rays of each point, over the hemisphere by the cosine, 1 to 1024
    #[arg(long, value_name = "N", default_value = "128", value_parser = |s: &str| ranged(s, RAYS[0].into(), RAYS[1].into()))]
    pub dvf_rays: u32,
    /// With --secondary dvf: lanes over which the rays of a point are shared out while the field is made, 1 to 1024;
    /// shows in time only
    #[arg(long, value_name = "N", default_value = "128", value_parser = |s: &str| ranged(s, 1, RAYS[1].into()))]
    pub dvf_lanes: u32,
    /// With --secondary dvf: rays that may wait for bricks at once while the field is made, 1 to 1G, a bit each on the
    /// device: only when there are as many, in whole blocks of the picture's size and one at least, bricks are loaded
    /// until none waits. Fewer load bricks again; shows in time and loads only
    #[arg(long, value_name = "N", default_value = "512M", value_parser = |s: &str| ranged(s, 1, 1_000_000_000))]
    pub dvf_pool: u32,
    /// With --secondary dvf: cells along the longest side of the field's region, 1 to 512; auto: of 4 to 128 cells by
    /// powers of two those that trace the fewest of some trial rays and answer at most 0.1 % of them wrongly
    #[arg(long, value_name = "CELLS", default_value = "auto", value_parser = cells)]
    pub dvf_cells: Cells,
    /// With --secondary dvf: texels of a cell's masks of directions on both axes: 8, 16 or 32; of 32, a cell takes 256
    /// bytes
    #[arg(long, value_name = "TEXELS", default_value = "32", value_parser = |s: &str| of(s, &[8, 16, 32]))]
    pub dvf_octahedral: u32,
    /// With --secondary dvf: whether masks are widened by a texel to all sides: on traces more rays and answers fewer
    /// wrongly
    #[arg(long, value_name = "on|off", default_value = "on")]
    pub dvf_dilate: Switch,
    /// With --secondary dvf: how points lie on a triangle: hammersley (evenly) or hash (at random)
    #[arg(long, value_name = "SET", default_value = "hammersley")]
    pub dvf_sequence: Sequence,
    /// With --secondary dvf: what becomes of a triangle's share of the points: ceiling (every triangle has one) or
    /// rounding (small ones may have none)
    #[arg(long, value_name = "HOW", default_value = "ceiling")]
    pub dvf_count: Count,
    /// With --secondary dvf: the sides of triangles that rays start from: front, or both, which takes twice the rays;
    /// what is seen from a side without is traced
    #[arg(long, value_name = "SIDES", default_value = "front")]
    pub dvf_sides: Sides,
    /// With --secondary dvf: where there is a field: scene (kept beside the scene in S.dvf), or view (what the camera
    /// sees of it in up to five frames, in the box of that; kept in S.view.dvf). Rays from elsewhere are traced
    #[arg(long, value_name = "REGION", default_value = "scene")]
    pub dvf_region: RegionKind,
    /// With --secondary dvf: which answers count: label (in cells with more ways out than in the way, those that are
    /// free; in others, those that meet something: as in the paper) or masks (all where no ray found the opposite:
    /// fewer are traced, more answered wrongly)
    #[arg(long, value_name = "ANSWERS", default_value = "label")]
    pub dvf_trust: Trust,
    /// With --secondary dvf: same-sample (the rays of --secondary exact, less those that the field answers: the same
    /// picture wherever its masks cover) or paper (rays to the environment from primary hits by the cosine, none where
    /// masks know nothing, and spherical harmonics of order 2 for the light that reaches cells that are mostly visible:
    /// their bias and edges between cells are to be seen; not with diffuse)
    #[arg(long, value_name = "MODE", default_value = "same-sample")]
    pub dvf_mode: Mode,
    /// With --secondary dvf and --motion: rays by which cells of the field are made anew in a frame, 0 to 1G (0: none):
    /// those that the camera sees and that what moves concerns, the most seen first, as far as that is expected to save
    /// four times as many; 4 triangles that are read for it count as one of the rays. In all other cells directions
    /// toward what moves are traced
    #[arg(long, value_name = "RAYS", default_value = "1M", value_parser = |s: &str| ranged(s, 0, 1_000_000_000))]
    pub dvf_renew: u32,
    /// With --secondary dvf: the field's file; it is made anew where it is missing, damaged, or of another scene or
    /// other options [default: S.dvf, for --dvf-region view S.view.dvf]
    #[arg(long, value_name = "FILE")]
    pub dvf_file: Option<PathBuf>,
}

named_values! {
    /// On or off.
    Switch {
        /// On.
        On = "on",
        /// Off.
        Off = "off",
    } later &[]
}

named_values! {
    /// How points lie on a triangle.
    Sequence {
        /// The set of Hammersley.
        Hammersley = "hammersley",
        /// Hashes.
        Hash = "hash",
    } later &[]
}

named_values! {
    /// What becomes of a triangle's share of the points.
    Count {
        /// The next whole number.
        Ceiling = "ceiling",
        /// The nearest whole number.
        Rounding = "rounding",
    } later &[]
}

named_values! {
    /// The sides of triangles that rays start from.
    Sides {
        /// The front.
        Front = "front",
        /// Both.
        Both = "both",
    } later &[]
}

named_values! {
    /// Where there is a field.
    RegionKind {
        /// In the whole scene.
        Scene = "scene",
        /// In what the camera sees.
        View = "view",
    } later &[]
}

named_values! {
    /// What a field does.
    Mode {
        /// It answers rays.
        SameSample = "same-sample",
        /// What it does in the paper.
        Paper = "paper",
    } later &[]
}

named_values! {
    /// Which answers of a field count.
    Trust {
        /// Those of the cell's label.
        Label = "label",
        /// Those that no ray contradicts.
        Masks = "masks",
    } later &[]
}

impl DvfArgs {
    /// How the field is made.
    pub fn settings(&self) -> DvfSettings {
        DvfSettings {
            points: self.dvf_points,
            rays: self.dvf_rays,
            cells: self.dvf_cells,
            octahedral: self.dvf_octahedral,
            dilate: self.dvf_dilate == Switch::On,
            hammersley: self.dvf_sequence == Sequence::Hammersley,
            round: self.dvf_count == Count::Rounding,
            both: self.dvf_sides == Sides::Both,
            seed: 0,
        }
    }

    /// How its rays are traced.
    pub fn tracing(&self) -> DvfTracing {
        DvfTracing { lanes: self.dvf_lanes, pool: self.dvf_pool.into() }
    }

    /// How rays are answered by it.
    pub fn how(&self) -> DvfUse {
        DvfUse { doubt: self.dvf_trust == Trust::Masks, paper: self.dvf_mode == Mode::Paper }
    }
}

fn cells(text: &str) -> Result<Cells, String> {
    if text == "auto" {
        return Ok(Cells::Auto);
    }
    ranged(text, CELLS[0].into(), CELLS[1].into()).map(Cells::Longest).map_err(|error| format!("{error}, or auto"))
}

//! Options of `--secondary dvf`.

use super::{CELLS, Cells, DvfSettings, DvfTracing, DvfUse, POINTS, RAYS};
use crate::settings::{Plain, Rule, Value, names, settings};
use std::path::PathBuf;

names! {
    /// How points lie on a triangle.
    Sequence {
        /// The set of Hammersley.
        Hammersley = "hammersley",
        /// Hashes.
        Hash = "hash",
    }
}

names! {
    /// What becomes of a triangle's share of the points.
    Count {
        /// The next whole number.
        Ceiling = "ceiling",
        /// The nearest whole number.
        Rounding = "rounding",
    }
}

names! {
    /// The sides of triangles that rays start from.
    Sides {
        /// The front.
        Front = "front",
        /// Both.
        Both = "both",
    }
}

names! {
    /// Where there is a field.
    RegionKind {
        /// In the whole scene.
        Scene = "scene",
        /// In what the camera sees.
        View = "view",
    }
}

names! {
    /// What a field does.
    Mode {
        /// It answers rays.
        SameSample = "same-sample",
        /// What it does in the paper: a baseline.
        #[cfg(feature = "lab")]
        Paper = "paper",
    }
}

names! {
    /// Which answers of a field count.
    Trust {
        /// Those of the cell's label.
        Label = "label",
        /// Those that no ray contradicts.
        Masks = "masks",
    }
}

impl Value for Cells {
    fn read(text: &str, _: Rule, _: &str) -> Result<Self, String> {
        if text == "auto" {
            return Ok(Self::Auto);
        }
        let rule = Rule::Whole(CELLS[0].into(), CELLS[1].into());
        u32::read(text, rule, "").map(Self::Longest).map_err(|error| format!("{error}, or auto"))
    }

    fn plain(&self) -> Plain {
        match self {
            Self::Auto => Plain::Text("auto".into()),
            Self::Longest(cells) => cells.plain(),
        }
    }
}

settings! {
    /// How fields of visibility are made, and answer rays.
    pub struct Options {
        /// With --secondary dvf: points strewn by area over the triangles of the field's region. More make fewer
        /// answers wrong.
        points: u32 = 400_000, "--dvf-points N", Rule::Whole(POINTS[0] as u64, POINTS[1] as u64), "", Methods, Expert;
        /// With --secondary dvf: rays of each point, over the hemisphere by the cosine.
        rays: u32 = 128, "--dvf-rays N", Rule::Whole(RAYS[0] as u64, RAYS[1] as u64), "", Methods, Expert;
        /// With --secondary dvf: lanes that share the rays of a point while the field is made. It shows in time only.
        lanes: u32 = 128, "--dvf-lanes N", Rule::Whole(1, RAYS[1] as u64), "", Methods, Expert;
        /// With --secondary dvf: rays that may wait for bricks at once while the field is made, a bit each on the
        /// device. Fewer load bricks again. It shows in time and loads only.
        pool: u32 = 512_000_000, "--dvf-pool N", Rule::Whole(1, 1_000_000_000), "", Methods, Expert;
        /// With --secondary dvf: cells along the longest side of the field's region, 1 to 512, or auto. `auto`: of 4 to
        /// 128 those that trace the fewest of some trial rays and answer at most 0.1 % of them wrongly.
        cells: Cells = Cells::Auto, "--dvf-cells CELLS|auto", Rule::Any, "cells", Methods, Expert;
        /// With --secondary dvf: texels of a cell's masks of directions on both axes. Of 32, a cell takes 256 bytes.
        octahedral: u32 = 32, "--dvf-octahedral TEXELS", Rule::OneOf(&[8, 16, 32]), "texels", Methods, Expert;
        /// With --secondary dvf: whether masks are widened by a texel to all sides. It traces more rays and answers
        /// fewer wrongly.
        dilate: bool = true, "--dvf-dilate on|off", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: how points lie on a triangle: hammersley (evenly), hash (at random).
        sequence: Sequence = Sequence::Hammersley, "--dvf-sequence SET", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: what becomes of a triangle's share of the points: ceiling, rounding. By `ceiling`
        /// every triangle has one; by `rounding` small ones may have none.
        count: Count = Count::Ceiling, "--dvf-count HOW", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: the sides of triangles that rays start from: front, both. What is seen from a side
        /// without is traced; `both` takes twice the rays.
        sides: Sides = Sides::Front, "--dvf-sides SIDES", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: where there is a field: scene, view. `view` is the box of what the camera sees in up
        /// to five frames. Rays from elsewhere are traced.
        region: RegionKind = RegionKind::Scene, "--dvf-region REGION", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: which answers count: label, masks. `label`, as in the paper: in cells with more ways
        /// out than in the way those that are free, in others those that meet something. `masks`: all where no ray
        /// found the opposite; fewer rays are traced, more answered wrongly.
        trust: Trust = Trust::Label, "--dvf-trust ANSWERS", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf: same-sample or paper. `same-sample`: the rays of --secondary exact, less those that
        /// the field answers. `paper`: rays by the cosine, none where masks know nothing, and spherical harmonics for
        /// cells that are mostly visible; not with `diffuse`.
        mode: Mode = Mode::SameSample, "--dvf-mode MODE", Rule::Any, "", Methods, Expert;
        /// With --secondary dvf and --motion: rays a frame by which cells of the field are made anew; 0 is none. Cells
        /// that the camera sees come first. In all other cells directions toward what moves are traced.
        renew: u32 = 1_000_000, "--dvf-renew RAYS", Rule::Whole(0, 1_000_000_000), "", Methods, Expert;
        /// With --secondary dvf: the field's file. It is made anew where it is missing, damaged, or of another scene or
        /// other options. [default: S.dvf; for --dvf-region view S.view.dvf]
        file: Option<PathBuf> = None, "--dvf-file FILE", Rule::Any, "", Methods, Expert;
    }
}

impl Options {
    /// How the field is made.
    pub fn settings(&self) -> DvfSettings {
        DvfSettings {
            points: self.points,
            rays: self.rays,
            cells: self.cells,
            octahedral: self.octahedral,
            dilate: self.dilate,
            hammersley: self.sequence == Sequence::Hammersley,
            round: self.count == Count::Rounding,
            both: self.sides == Sides::Both,
            seed: 0,
        }
    }

    /// How its rays are traced.
    pub fn tracing(&self) -> DvfTracing {
        DvfTracing { lanes: self.lanes, pool: self.pool.into() }
    }

    /// How rays are answered by it.
    pub fn how(&self) -> DvfUse {
        DvfUse { doubt: self.trust == Trust::Masks, paper: self.mode != Mode::SameSample }
    }
}

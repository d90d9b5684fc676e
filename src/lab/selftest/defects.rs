//! Defects planted on purpose, one at a time, to show that the cases notice them.
//!
//! Those of arithmetic change the text of the kernels before they are compiled; those of streaming come between the
//! schedule and the executor. So nothing of them is in a kernel that renders.

use crate::gpu::device::Gpu;
use crate::gpu::kernels;
use crate::gpu::kernels::Kernels;
use crate::gpu::wgsl::Pages;
use crate::kernels::frame::Frame;
use crate::kernels::layout::{GBuffer, Hit, Ray, Surface};
use crate::kernels::table::Family;
use crate::kernels::{DeviceInfo, Extent, FrameExecutor, Keep, Lamps, Tuning, View};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, PairQuery, Pass, Report, Step};
use crate::stream::Workers;
use anyhow::{Result, bail};
use bricks::SceneFile;
use delegate::delegate;
use glam::DVec3;
use std::any::Any;
use std::sync::Arc;

crate::settings::names! {
    /// What is planted.
    Defect {
        /// Vertices and origins in f32 relative to the world's origin.
        WorldF32 = "world-f32",
        /// A triangle is rejected when its determinant is below 10⁻⁶.
        AbsoluteEpsilon = "absolute-epsilon",
        /// The test of Möller and Trumbore.
        MollerTrumbore = "moller-trumbore",
        /// Boxes are padded by a share of the distance alone.
        RelativePadding = "relative-padding",
        /// t as it is computed, not held to the triangle's slab.
        RawT = "raw-t",
        /// What begins at the distance of the best hit is pruned.
        NonStrictPrune = "non-strict-prune",
        /// No barriers, and a compiler that contracts.
        NoBarriers = "no-barriers",
        /// Of equally near triangles the one with the highest id.
        SwappedTie = "swapped-tie",
        /// 1 / 0 is infinite.
        NanSlab = "nan-slab",
        /// A brick of a batch is overwritten before it is intersected.
        EarlyEviction = "early-eviction",
        /// Of every query the answer for one brick is lost.
        LostQuery = "lost-query",
        /// Tiles that reach beyond the picture are left out.
        TileRemainder = "tile-remainder",
        /// Points that rays leave from are not moved in from the triangle's edges.
        NoInset = "no-inset",
    }
}

/// Möller and Trumbore 1997, in the axes of the frame; the sound function goes by another name.
const MOLLER_TRUMBORE: &str =
    "fn intersect_triangle(f: RayFrame, a: vec3<f32>, b: vec3<f32>, c: vec3<f32>, t_min: f32) -> TriangleHit {
    let miss = TriangleHit(false, 0.0, 0.0, 0.0, 0.0, 0.0);
    let d = vec3<f32>(f.sx, f.sy, 1.0);
    let o = -permuted(a, f.kz);
    let ab = permuted(b - a, f.kz);
    let ac = permuted(c - a, f.kz);
    let p = cross(d, ac);
    let det = dot(ab, p);
    if det == 0.0 {
        return miss;
    }
    let v = dot(o, p) / det;
    let q = cross(o, ab);
    let w = dot(d, q) / det;
    let t = dot(ac, q) / det * f.iz;
    if v < 0.0 || w < 0.0 || v + w > 1.0 || !(t >= t_min) {
        return miss;
    }
    return TriangleHit(true, t, 1.0 - v - w, v, w, 1.0);
}

fn sound_intersect_triangle(";

/// Each product fused with the difference that it feeds, in one of the three shears and in all edge functions:
/// `diffprod` is exact before it rounds, as a fused operation is.
const FUSED_SHEAR: &str = "let fused = permuted(a, f.kz);
    let sa = vec3<f32>(diffprod(fused.x, 1.0, f.sx, fused.z), diffprod(fused.y, 1.0, f.sy, fused.z), fused.z);";

impl Defect {
    /// What is replaced in the text of kernels, and what by.
    fn changes(self) -> &'static [(&'static str, &'static str)] {
        match self {
            Self::AbsoluteEpsilon => &[("if det == 0.0 {", "if abs(det) < 1.0e-6 {")],
            Self::MollerTrumbore => &[("fn intersect_triangle(", MOLLER_TRUMBORE)],
            Self::RelativePadding => &[
                (
                    "let delta = vec3<f32>(64.0 * UNIT * m + slack * (m + max(o.x, max(o.y, o.z))))\n        \
                     + 4.0 * UNIT * abs(pc) + 2.0 * UNIT * abs(offset_low);",
                    "let delta = vec3<f32>(0.0);",
                ),
                ("tn <= tf);", "tn <= tf * 1.0000004);"),
            ],
            Self::RawT => &[("bitcast<u32>(max(min(t, x), max(n, t_min))) & ~SIGN", "bitcast<u32>(t) & ~SIGN")],
            Self::NonStrictPrune => &[("tn <= tf);", "tn < tf);")],
            Self::NoBarriers => &[
                ("let sa = shear(f, a);", FUSED_SHEAR),
                (
                    "var u = barrier(barrier(sc.x * sb.y) - barrier(sc.y * sb.x));",
                    "var u = diffprod(sc.x, sb.y, sc.y * sb.x, 1.0);",
                ),
                (
                    "var v = barrier(barrier(sa.x * sc.y) - barrier(sa.y * sc.x));",
                    "var v = diffprod(sa.x, sc.y, sa.y * sc.x, 1.0);",
                ),
                (
                    "var w = barrier(barrier(sb.x * sa.y) - barrier(sb.y * sa.x));",
                    "var w = diffprod(sb.x, sa.y, sb.y * sa.x, 1.0);",
                ),
            ],
            Self::SwappedTie => &[("id >= (*best).id", "id <= (*best).id")],
            Self::NanSlab => &[(
                "min(inverse, bitcast<u32>(GREATEST_INVERSE)));",
                "select(inverse, 0x7f800000u, (bits & ~SIGN) == 0u));",
            )],
            Self::TileRemainder => &[(
                "ray.x >= params.width || ray.y >= params.height;",
                "ray.x >= params.width / params.tile * params.tile \
                 || ray.y >= params.height / params.tile * params.tile;",
            )],
            Self::NoInset => &[("weights = max(weights, min(least, vec3<f32>(0x1.555554p-2)));", "")],
            Self::WorldF32 | Self::EarlyEviction | Self::LostQuery => &[],
        }
    }

    /// Whether it is planted in kernels of graphics devices.
    pub fn is_of_kernels(self) -> bool {
        !self.changes().is_empty()
    }

    /// `text` with the defect.
    pub fn plant(self, text: String) -> String {
        self.changes().iter().fold(text, |text, (sound, broken)| text.replace(sound, broken))
    }

    /// The kernels with the defect.
    ///
    /// # Errors
    /// No kernel has the text that would be replaced.
    pub fn kernels(self, gpu: &Gpu, pages: Pages) -> Result<Kernels> {
        let names = ["trace/intersect_all", "trace/intersect_list"];
        let texts = names.map(|name| kernels::source(name, pages));
        for (sound, _) in self.changes() {
            if !texts.iter().any(|text| text.contains(sound)) {
                bail!("the defect {} has no place: no kernel has {sound:?}", self.name());
            }
        }
        Ok(Kernels::from_sources(gpu, pages, false, move |kernel| self.plant(kernels::source(kernel, pages))))
    }
}

/// An executor with a defect of streaming or of positions, or whose device fails.
pub struct Faulty {
    /// The sound one.
    pub inner: Box<dyn FrameExecutor>,
    /// The defect.
    pub defect: Option<Defect>,
    /// The submission, from 1 on, whose results never come back.
    pub fails_at: Option<u32>,
    /// Submissions so far.
    pub submissions: u32,
    /// The scene.
    pub scene: Arc<SceneFile>,
    /// The frame's reference point in device units.
    pub reference: DVec3,
}

impl Faulty {
    /// A point of the frame, relative to the world's origin, if that is the defect.
    fn point(&self, p: [f32; 3]) -> [f32; 3] {
        if self.defect == Some(Defect::WorldF32) {
            (DVec3::from(p.map(f64::from)) + self.reference).as_vec3().to_array()
        } else {
            p
        }
    }
}

impl Executor for Faulty {
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        self.inner.load(loads)?;
        let bytes = |load: &Load| self.scene.loaded_bytes(load.item.into());
        if self.defect == Some(Defect::EarlyEviction)
            && let Some(last) = loads.last()
            && let Some(first) = loads[..loads.len() - 1].iter().find(|first| bytes(first) >= bytes(last))
        {
            self.inner.load(&[Load { item: last.item, slot: first.slot }])?;
        }
        Ok(())
    }

    delegate! {
        to self.inner {
            fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError>;
            fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError>;
            fn mark_leaves(&mut self, marks: &Arc<[bool]>);
        }
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let mut report = self.inner.run(pass, steps, bricks)?;
        self.submissions += 1;
        if self.fails_at == Some(self.submissions) {
            return Err(ExecutorError::Device("was lost on purpose".into()));
        }
        if self.defect == Some(Defect::LostQuery) && !report.demand.is_empty() {
            report.demand.remove(0);
        }
        Ok(report)
    }
}

impl FrameExecutor for Faulty {
    delegate! {
        to self.inner {
            fn device(&self) -> DeviceInfo;
            fn page_bytes(&self) -> u64;
            fn texture_bytes(&self) -> u64;
            fn workers(&self) -> &Workers;
            fn leaves_out(&self) -> Keep;
            fn set_extent(&mut self, extent: Extent) -> Result<(), ExecutorError>;
            fn allow_bounces(&mut self);
            fn set_hidden(&mut self, bounds: &[u32]) -> Result<(), ExecutorError>;
            fn lose_device(&mut self);
            fn make_binary(&mut self) -> Result<(), ExecutorError>;
            fn tuning(&mut self) -> &mut Tuning;
            fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError>;
            fn reserve(&mut self, family: &'static Family, elements: &[usize]) -> Result<(), ExecutorError>;
            fn write(&mut self, family: &'static Family, buffer: usize, at: usize, bytes: &[u8]);
            fn read(&mut self, family: &'static Family, buffer: usize, words: usize) -> Result<Vec<u32>, ExecutorError>;
            fn held(&mut self, family: &'static Family) -> &mut Option<Box<dyn Any>>;
            fn set_scene(&mut self, scene: &Arc<SceneFile>);
            fn read_rays(&mut self, pass: Pass) -> Result<Vec<Ray>, ExecutorError>;
            fn read_hits(&mut self, pass: Pass) -> Result<Vec<Hit>, ExecutorError>;
            fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<Surface>, ExecutorError>;
            fn read_gbuffer(&mut self) -> Result<Vec<GBuffer>, ExecutorError>;
            fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError>;
        }
    }

    fn begin_frame(&mut self, view: &View) {
        let mut view = *view;
        if self.defect == Some(Defect::WorldF32) {
            self.reference = view.frame.origin / view.frame.unit;
            let [x, y, z, w] = view.params.origin;
            let [x, y, z] = self.point([x, y, z]);
            view.params.origin = [x, y, z, w];
            view.frame = Frame { reference: [0; 3], origin: DVec3::ZERO, ..view.frame };
        }
        self.inner.begin_frame(&view);
    }

    fn set_rays(&mut self, pass: Pass, rays: &[Ray]) {
        let rays: Vec<Ray> = rays.iter().map(|ray| Ray { origin: self.point(ray.origin), ..*ray }).collect();
        self.inner.set_rays(pass, &rays);
    }
}

//! An executor that runs every step on a graphics device and on the processor and compares all that they write, for
//! tests.
//!
//! Rays that start at hits are within [`Lockstep::bound`] of each other, because WGSL leaves sine, cosine, division and
//! inverse square root some ulps; the device's are then given to both, so that everything that follows can be compared
//! exactly: hits, surfaces, lists, what is asked and counted, bit for bit. Widths of their cones are compared and
//! given likewise. Where rays of a tile can first enter a box orders what is done and decides no hit: devices divide
//! and fuse there as they like, and it is compared within a bound. What is read and added for shading is compared
//! within the bound; before textures are looked up both are given the device's, so that which tiles are asked for and
//! read can be compared exactly.

mod tests;

use crate::cpu::CpuExecutor;
use crate::gpu::executor::GpuExecutor;
use crate::kernels::denoise;
use crate::kernels::dispatch::dispatches;
use crate::kernels::layout::{
    DenoiseSeen, DvfGrid, Entry, GBuffer, Hit, More, NONE, Params, Ray, RomaMap, RsmMap, RsmTexel, Surface, TileList,
};
use crate::kernels::table::Family;
use crate::kernels::trace::levels::spread_of;
use crate::kernels::{DeviceInfo, Directions, Extent, FrameExecutor, Keep, Lamps, Tuning, View};
use crate::schedule::{BrickStates, Executor, ExecutorError, Load, PairQuery, Pass, Report, Step};
use crate::secondary::FAMILIES;
use crate::secondary::df::kernels as df;
use crate::secondary::dvf::kernels as dvf;
use crate::secondary::roma::kernels as roma;
use crate::secondary::rsm::kernels as rsm;
use crate::stream::Workers;
use bricks::SceneFile;
use delegate::delegate;
use std::any::Any;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

/// What was compared.
#[derive(Default)]
pub struct Findings {
    /// The first differences, in words.
    pub differences: Vec<String>,
    /// Kernels that ran.
    pub kernels: BTreeSet<&'static str>,
    /// Values compared, by what they are.
    pub compared: BTreeMap<&'static str, usize>,
    /// The greatest difference of values that are compared within the bound, relative to numbers above 1.
    pub greatest: f32,
}

/// A defect of the processor's side, which comparing must notice.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Defect {
    /// Rays start 2^-10 beside where they should.
    Rays,
    /// Other random numbers.
    Seed,
    /// The light is brighter by 2^-8.
    Light,
    /// Textures are looked up a quarter of their width aside.
    Lookups,
    /// Ray-aligned maps lie a hundredth of a cell aside.
    Maps,
    /// Base maps of distance fields have a cell more.
    Fields,
    /// What lamps see is looked up a texel aside.
    LampMaps,
    /// Points of fields of visibility lie elsewhere.
    Points,
    /// Pixels are taken for a hundredth wider by the denoiser.
    Guides,
    /// Cones of rays that have a width of their own are wider by 1/64.
    Cones,
}

/// Both executors.
pub struct Lockstep {
    gpu: GpuExecutor,
    cpu: CpuExecutor,
    bound: f32,
    defect: Option<Defect>,
    directions: Directions,
    tuning: Tuning,
    findings: Arc<Mutex<Findings>>,
}

/// Greatest difference of widths of cones, relative, squared: a density of directions that a sharp lobe draws is much
/// more sensitive to roundings than they are.
const SPREADS: f32 = 1.0 / 1024.0;

/// Greatest difference of distances at which boxes can be entered: of coordinates in the thousands a unit in the last
/// place, where the distance is below 1.
const NEAREST: f32 = 1.0 / 4096.0;

impl Findings {
    fn note(&mut self, text: impl FnOnce() -> String) {
        if self.differences.len() < 8 {
            self.differences.push(text());
        }
    }

    /// Compares words; both zeros are one value.
    fn words<T: bytemuck::Pod>(&mut self, what: &'static str, context: &str, gpu: &[T], cpu: &[T]) {
        *self.compared.entry(what).or_default() += gpu.len();
        if gpu.len() != cpu.len() {
            self.note(|| format!("{context}: {} {what} instead of {}", cpu.len(), gpu.len()));
        }
        if bytemuck::cast_slice::<T, u8>(gpu) == bytemuck::cast_slice::<T, u8>(cpu) {
            return;
        }
        let value = |x: &u32| if *x == 1 << 31 { 0 } else { *x };
        for (i, (g, c)) in gpu.iter().zip(cpu).enumerate() {
            let of = |x: &T| -> Vec<u32> { bytemuck::pod_collect_to_vec(bytemuck::bytes_of(x)) };
            let (g, c) = (of(g), of(c));
            if !g.iter().map(value).eq(c.iter().map(value)) {
                self.note(|| format!("{context}: {what} {i}: {c:08x?} instead of {g:08x?}"));
                return;
            }
        }
    }

    /// Compares numbers within `bound`, relative to numbers above 1.
    fn numbers(&mut self, what: &'static str, context: &str, bound: f32, gpu: &[f32], cpu: &[f32]) {
        *self.compared.entry(what).or_default() += gpu.len();
        for (i, (g, c)) in gpu.iter().zip(cpu).enumerate() {
            let apart = (g - c).abs() / g.abs().max(1.0);
            self.greatest = self.greatest.max(apart);
            if apart.is_nan() || apart > bound {
                self.note(|| format!("{context}: {what} {i}: {c} instead of {g}"));
                return;
            }
        }
    }

    /// Compares distances at which boxes can be entered.
    fn nearest(&mut self, context: &str, gpu: &[f32], cpu: &[f32]) {
        // Two that are infinite have no difference.
        let apart = |(g, c): (&f32, &f32)| if g.to_bits() == c.to_bits() { (0.0, 0.0) } else { (*g, *c) };
        let (gpu, cpu): (Vec<f32>, Vec<f32>) = gpu.iter().zip(cpu).map(apart).unzip();
        self.numbers("nearest", context, NEAREST, &gpu, &cpu);
    }

    fn gbuffers(&mut self, context: &str, bound: f32, gpu: &[GBuffer], cpu: &[GBuffer]) {
        let numbers = |g: &GBuffer| {
            let others = [g.handedness, g.occlusion, g.metallic, g.roughness, g.curvature];
            [&g.albedo[..], &g.normal, &g.emission, &g.weights, &g.tangent, &others].concat()
        };
        let whole = |g: &GBuffer| [g.state, g.material];
        // Which tiles are read depends on these.
        let exact = |g: &GBuffer| [g.footprint, g.uv[0], g.uv[1], g.footprint1, g.uv1[0], g.uv1[1]].map(f32::to_bits);
        for (g, c) in gpu.iter().zip(cpu) {
            self.numbers("attributes", context, bound, &numbers(g), &numbers(c));
            self.words("materials", context, &[whole(g)], &[whole(c)]);
            self.words("footprints", context, &[exact(g)], &[exact(c)]);
        }
    }

    /// Of those hits of which they are kept.
    fn mores(&mut self, context: &str, bound: f32, kept: &[bool], [gpu, cpu]: [&[More]; 2]) {
        let numbers = |x: &More| {
            let shares = [x.specular_weight, x.sheen_roughness, x.coat, x.anisotropy];
            let others = [x.coat_roughness, x.film, x.film_thickness];
            [&x.specular[..], &x.sheen, &x.normal, &x.along, &shares, &others].concat()
        };
        let read = kept.iter().zip(gpu.iter().zip(cpu)).filter(|(kept, _)| **kept);
        for (_, (g, c)) in read {
            self.numbers("further textures", context, bound, &numbers(g), &numbers(c));
            self.words("further textures that wait", context, &[g.state], &[c.state]);
        }
    }

    fn texels(&mut self, context: &str, bound: f32, gpu: &[RsmTexel], cpu: &[RsmTexel]) {
        let light = [gpu, cpu].map(|all| all.iter().flat_map(|texel| texel.flux).collect::<Vec<f32>>());
        self.numbers("light of shadow maps", context, bound, &light[0], &light[1]);
        let place =
            |t: &RsmTexel| [[t.depth, t.facing].map(f32::to_bits), [t.normal[0], t.normal[1]].map(f32::to_bits)];
        let places = [gpu, cpu].map(|all| all.iter().map(place).collect::<Vec<_>>());
        self.words("texels of shadow maps", context, &places[0], &places[1]);
    }

    fn report(&mut self, context: &str, gpu: &Report, cpu: &Report) {
        // The kernel of binary trees, a baseline, does not count.
        let counts = !context.contains("IntersectBinary");
        let numbers = |r: &Report| {
            let by_kernels = r.counters.counted_by_device().into_iter();
            let compared =
                by_kernels.filter(|(name, _)| counts || !["nodes_visited", "triangles_tested"].contains(name));
            let own = [r.list_entries.into(), r.most_selected.into()];
            compared.map(|(_, count)| count).chain(own).chain([r.paths.into()]).chain(r.own).collect::<Vec<u64>>()
        };
        self.words("counters", context, &numbers(gpu), &numbers(cpu));
        let demand = |r: &Report| -> (Vec<[u32; 3]>, Vec<f32>) {
            r.demand.iter().map(|d| ([d.brick, d.rays, d.next], d.nearest)).unzip()
        };
        let (of_gpu, of_cpu) = (demand(gpu), demand(cpu));
        self.words("demands", context, &of_gpu.0, &of_cpu.0);
        self.nearest(context, &of_gpu.1, &of_cpu.1);
        let tiles = |r: &Report| -> Vec<[u32; 4]> {
            r.tiles.iter().map(|t| [t.tile, t.rays, t.first, t.is_used.into()]).collect()
        };
        self.words("tiles", context, &tiles(gpu), &tiles(cpu));
        self.words("used bricks", context, &gpu.used, &cpu.used);
        self.words("hit bricks", context, &gpu.hit, &cpu.hit);
        self.words("rays of pairs", context, &gpu.pair_rays, &cpu.pair_rays);
        self.words("states", context, &gpu.states, &cpu.states);
    }
}

/// The name of the kernel of a method that a step runs.
fn own_kernel(step: &Step) -> Option<&'static str> {
    if let Step::Own(own) = step { Some(own.kernel) } else { None }
}

impl Lockstep {
    /// Of both, over the same scene and with the same extent. `bound`: of differences where they are allowed.
    pub fn new(gpu: GpuExecutor, mut cpu: CpuExecutor, bound: f32, findings: Arc<Mutex<Findings>>) -> Self {
        let tuning = *cpu.tuning();
        Self { gpu, cpu, bound, defect: None, directions: Directions::default(), tuning, findings }
    }

    /// Breaks the processor's side.
    pub fn with_defect(mut self, defect: Defect) -> Self {
        self.defect = Some(defect);
        self
    }

    /// The words of a buffer that the processor has made.
    pub fn words(&mut self, family: &'static Family, buffer: usize) -> &[u32] {
        self.cpu.words(family, buffer)
    }

    /// Rays that have been made alike on both sides.
    fn generate(&mut self, context: &str, pass: Pass, step: Step, bricks: &BrickStates) -> Result<(), ExecutorError> {
        let surfaces = match pass.set() {
            0 => Vec::new(),
            1 => self.gpu.read_surfaces(Pass::Primary)?,
            _ => self.gpu.read_surfaces(Pass::Path(1))?,
        };
        self.gpu.run(pass, &[step], bricks)?;
        self.cpu.run(pass, &[step], bricks)?;
        let (rays, mut own) = (self.gpu.read_rays(pass)?, self.cpu.read_rays(pass)?);
        let mut findings = self.findings.lock().expect("findings");
        if pass == Pass::Primary {
            findings.words("camera rays", context, &rays, &own);
        }
        // A ray that all but touches its surface may be traced on one side alone.
        let is_grazing = |i: usize, ray: &Ray| {
            surfaces.get(i).is_some_and(|s| {
                let along: f32 = (0..3).map(|k| s.normal[k] * ray.direction[k]).sum();
                let length = ray.direction.iter().map(|x| x * x).sum::<f32>().sqrt();
                along.abs() <= 4.0 * self.bound * length
            })
        };
        for (i, (g, c)) in rays.iter().zip(&own).enumerate() {
            findings.numbers("origins", context, 0.0, &g.origin, &c.origin);
            findings.numbers("directions", context, self.bound, &g.direction, &c.direction);
            if !is_grazing(i, g) {
                findings.numbers("ends of rays", context, 0.0, &[g.t_min, g.t_max], &[c.t_min, c.t_max]);
            }
        }
        let mut spreads = self.cpu.read_surfaces(pass)?;
        let is_path = matches!(step, Step::Continue(_));
        for (i, (g, c)) in self.gpu.read_surfaces(pass)?.iter().zip(&mut spreads).enumerate() {
            let is_traced = rays[i].t_min <= rays[i].t_max && own[i].t_min <= own[i].t_max;
            let wider = if self.defect == Some(Defect::Cones) { 1.0 + 1.0 / 64.0 } else { 1.0 };
            let [of_gpu, of_cpu] = [spread_of(g), wider * spread_of(c)];
            if is_traced && (of_gpu > 0.0 || of_cpu > 0.0) {
                findings.numbers("spreads", context, SPREADS, &[1.0], &[of_cpu / of_gpu]);
            }
            if is_traced && is_path && !is_grazing(i, &rays[i]) {
                findings.numbers("throughputs", context, self.bound, &g.point, &c.point);
                findings.words("origins", context, &[[g.emitter, g.triangle]], &[[c.emitter, c.triangle]]);
                findings.numbers("curvatures", context, self.bound, &g.normal, &c.normal);
            }
            if is_path {
                c.normal = g.normal;
            } else if pass == Pass::Glossy {
                findings.numbers(
                    "curvatures",
                    context,
                    self.bound,
                    &[g.emitter].map(f32::from_bits),
                    &[c.emitter].map(f32::from_bits),
                );
                c.emitter = g.emitter;
            }
            c.pending = g.pending;
        }
        self.cpu.set_surfaces(pass, spreads);
        own = rays;
        if self.defect == Some(Defect::Rays) {
            own.iter_mut().for_each(|ray| ray.origin[0] += 1.0 / 1024.0);
        }
        drop(findings);
        self.cpu.set_rays(pass, &own);
        // Their hits have been started by the side that made them: started anew, with the device's ends.
        Ok(())
    }

    /// Compares what has been read of the hits of the set before that of `pass`, and gives the processor the device's.
    fn align(&mut self, context: &str, pass: Pass) -> Result<(), ExecutorError> {
        let set = pass.set().saturating_sub(1);
        let gbuffer = self.gpu.read_gbuffer_of(set)?;
        self.findings.lock().expect("findings").gbuffers(context, self.bound, &gbuffer, self.cpu.gbuffer_of(set));
        let more = self.gpu.read_more_of(set)?;
        let kept: Vec<bool> = gbuffer.iter().map(|hit| self.gpu.keeps_more(hit)).collect();
        let mores = [&more, &*self.cpu.more_of(set)];
        self.findings.lock().expect("findings").mores(context, self.bound, &kept, mores.map(Vec::as_slice));
        *self.cpu.gbuffer_of(set) = gbuffer;
        *self.cpu.more_of(set) = more;
        if self.defect == Some(Defect::Lookups) {
            self.cpu.gbuffer_of(set).iter_mut().for_each(|g| g.uv[0] += 0.25);
        }
        Ok(())
    }

    /// Compares what the rays of a pass have met.
    fn compare_hits(&mut self, context: &str, pass: Pass) -> Result<(), ExecutorError> {
        let hits = (self.gpu.read_hits(pass)?, self.cpu.read_hits(pass)?);
        let surfaces = (self.gpu.read_surfaces(pass)?, self.cpu.read_surfaces(pass)?);
        let rays = self.gpu.read_rays(pass)?;
        let mut findings = self.findings.lock().expect("findings");
        let traced = |i: &usize| rays[*i].t_min <= rays[*i].t_max;
        let of_traced = |all: &[Hit]| -> Vec<Hit> { (0..all.len()).filter(traced).map(|i| all[i]).collect() };
        findings.words("hits", context, &of_traced(&hits.0), &of_traced(&hits.1));
        // By what probability a direction was drawn follows from directions, which are near to equal. It stands where
        // a surface that is met would put its area; what methods answer meets none.
        let of_traced = |all: &[Surface]| -> (Vec<Surface>, Vec<f32>) {
            let parts = |i: usize| match all[i].leaf {
                NONE => (Surface { area: 0.0, ..all[i] }, all[i].area),
                _ => (all[i], 0.0),
            };
            (0..all.len()).filter(traced).map(parts).unzip()
        };
        let (of_gpu, of_cpu) = (of_traced(&surfaces.0), of_traced(&surfaces.1));
        findings.words("surfaces", context, &of_gpu.0, &of_cpu.0);
        findings.numbers("probabilities", context, self.bound, &of_gpu.1, &of_cpu.1);
        Ok(())
    }

    fn compare(&mut self, context: &str, pass: Pass, steps: &[Step]) -> Result<(), ExecutorError> {
        // These come before the rays of their pass are made.
        let reads_hits = |step: &Step| {
            matches!(step, Step::ClearAttributes | Step::Resolve | Step::Sample | Step::SampleCoarser | Step::Shade(_))
        };
        if !steps.iter().all(reads_hits) {
            self.compare_hits(context, pass)?;
        }
        let rays = self.gpu.read_rays(pass)?;
        let mut findings = self.findings.lock().expect("findings");
        let has_lists =
            |step: &Step| matches!(step, Step::Lists | Step::ShortLists | Step::SortByNumber | Step::SortNodesNear);
        if steps.iter().any(has_lists) {
            let (mut bounds, mut lists, list, selection) = self.gpu.read_tiles()?;
            let own = self.cpu.tiles();
            // There may be more tiles than the rows of the pass have.
            bounds.truncate(own.bounds.len());
            lists.truncate(own.lists.len());
            findings.words("bounds of tiles", context, &bounds, &own.bounds);
            // Which tiles have work is noted place by place there, and in any order.
            let placed = |l: &TileList| TileList { chosen: 0, rooted: 0, ..*l };
            findings.words("lists of tiles", context, &lists.iter().map(placed).collect::<Vec<_>>(), &own.lists);
            let numbers = |has_work: &dyn Fn(&TileList) -> bool| -> Vec<u32> {
                (0..).zip(&own.lists).filter(|(_, l)| has_work(l)).map(|(tile, _)| tile).collect()
            };
            let (with_selection, rooted) = (numbers(&|l| l.selected > 0), numbers(&|l| l.from_root != 0));
            let mut chosen: Vec<u32> = lists[..with_selection.len()].iter().map(|l| l.chosen).collect();
            chosen.sort_unstable();
            findings.words("chosen tiles", context, &chosen, &with_selection);
            assert!(with_selection.iter().all(|&tile| own.chosen[tile as usize]), "{context}: chosen tiles");
            let places: Vec<u32> = lists[..rooted.len()].iter().map(|l| l.rooted).collect();
            findings.words("rooted tiles", context, &places, &rooted);
            let held: u32 = lists.iter().map(|l| l.count).sum();
            let held = (held as usize).min(own.list.len());
            let entries = |list: &[Entry]| -> (Vec<u32>, Vec<f32>) { list.iter().map(|e| (e.node, e.near)).unzip() };
            let (of_gpu, of_cpu) = (entries(&list[..held]), entries(&own.list[..held]));
            findings.words("entries", context, &of_gpu.0, &of_cpu.0);
            findings.nearest(context, &of_gpu.1, &of_cpu.1);
            for l in &lists {
                let range = l.first as usize..(l.first + l.selected) as usize;
                if own.selection.len() >= range.end {
                    findings.words("selections", context, &selection[range.clone()], &own.selection[range]);
                }
            }
        }
        if steps.iter().any(|step| own_kernel(step) == Some("dvf_rays")) {
            findings.words("rays of points", context, &rays, &self.cpu.read_rays(pass)?);
        }
        let ran = |family: &&Family| steps.iter().filter_map(own_kernel).any(|name| family.kernel(name).is_some());
        for family in FAMILIES.iter().copied().filter(ran) {
            for (number, buffer) in family.buffers.iter().enumerate().filter(|(_, buffer)| buffer.is_written) {
                let own = self.cpu.words(family, number);
                let words = self.gpu.read(family, number, own.len())?;
                if std::ptr::eq(family, &rsm::FAMILY) {
                    findings.texels(context, self.bound, bytemuck::cast_slice(&words), bytemuck::cast_slice(own));
                    *own = words;
                } else {
                    findings.words(buffer.name, context, &words, own);
                }
            }
        }
        let shades = |step: &Step| {
            matches!(
                step,
                Step::Resolve
                    | Step::Sample
                    | Step::SampleCoarser
                    | Step::Shade(_)
                    | Step::AddLight
                    | Step::AddOcclusion
            ) || own_kernel(step).is_some_and(|name| ["rsm_light", "dvf_light"].contains(&name))
        };
        if steps.iter().any(shades) {
            let radiance = (self.gpu.read_radiance()?, self.cpu.read_radiance()?);
            let brighter = if self.defect == Some(Defect::Light) { 1.0 + 1.0 / 256.0 } else { 1.0 };
            let own: Vec<f32> = radiance.1.iter().flatten().map(|x| x * brighter).collect();
            findings.numbers("radiance", context, self.bound, radiance.0.as_flattened(), &own);
            let gbuffer = (self.gpu.read_gbuffer()?, self.cpu.read_gbuffer()?);
            findings.gbuffers(context, self.bound, &gbuffer.0, &gbuffer.1);
            let set = pass.set().saturating_sub(1);
            let gbuffer = self.gpu.read_gbuffer_of(set)?;
            findings.gbuffers(context, self.bound, &gbuffer, self.cpu.gbuffer_of(set));
            let more = (self.gpu.read_more_of(set)?, self.cpu.more_of(set));
            let kept: Vec<bool> = gbuffer.iter().map(|hit| self.gpu.keeps_more(hit)).collect();
            findings.mores(context, self.bound, &kept, [&more.0, more.1]);
        }
        Ok(())
    }
}

impl Lockstep {
    /// Runs `steps` on both and compares.
    fn both(
        &mut self,
        context: &str,
        pass: Pass,
        steps: &[Step],
        bricks: &BrickStates,
    ) -> Result<Report, ExecutorError> {
        let gpu = self.gpu.run(pass, steps, bricks)?;
        let cpu = self.cpu.run(pass, steps, bricks)?;
        self.findings.lock().expect("findings").report(context, &gpu, &cpu);
        self.compare(context, pass, steps)?;
        Ok(gpu)
    }
}

impl Executor for Lockstep {
    fn load(&mut self, loads: &[Load]) -> Result<(), ExecutorError> {
        self.gpu.load(loads)?;
        self.cpu.load(loads)
    }

    fn set_lists(&mut self, lists: &[Vec<u32>]) -> Result<(), ExecutorError> {
        self.gpu.set_lists(lists)?;
        self.cpu.set_lists(lists)
    }

    fn set_pairs(&mut self, queries: &[PairQuery], nodes: &[u32]) -> Result<(), ExecutorError> {
        self.gpu.set_pairs(queries, nodes)?;
        self.cpu.set_pairs(queries, nodes)
    }

    fn mark_leaves(&mut self, marks: &Arc<[bool]>) {
        self.gpu.mark_leaves(marks);
        self.cpu.mark_leaves(marks);
    }

    fn run(&mut self, pass: Pass, steps: &[Step], bricks: &BrickStates) -> Result<Report, ExecutorError> {
        let context = format!("{pass:?}, {steps:?}");
        let Tuning { threshold, .. } = self.tuning;
        (*self.gpu.tuning(), *self.cpu.tuning()) = (self.tuning, self.tuning);
        let params = Params { tiles_x: 1, tile: 1, width: 1, height: 1, tiles: 1, threshold, ..Params::default() };
        for &step in steps {
            let everything = bricks.all_geometry_resident();
            let list = dispatches(pass, step, &params, &self.directions, everything);
            let names = list.iter().map(|dispatch| dispatch.kernel);
            self.findings.lock().expect("findings").kernels.extend(names);
        }
        let rest = match steps {
            [step, rest @ ..]
                if matches!(step, Step::Generate | Step::Continue(_)) || own_kernel(step) == Some("dvf_cosine") =>
            {
                self.generate(&context, pass, *step, bricks)?;
                rest
            }
            all => all,
        };
        if let [Step::Continue(number), ..] = *steps {
            let gpu = self.gpu.run(pass, rest, bricks)?;
            let cpu = self.cpu.run(pass, rest, bricks)?;
            self.findings.lock().expect("findings").report(&context, &gpu, &cpu);
            // What was moved lies in the set before.
            self.compare_hits(&context, Pass::Path(number))?;
            return Ok(gpu);
        }
        let Some((before, &[last @ (Step::Sample | Step::SampleCoarser)])) = rest.split_last_chunk::<1>() else {
            return self.both(&context, pass, rest, bricks);
        };
        let mut report = match before {
            [] => Report::default(),
            before => self.both(&context, pass, before, bricks)?,
        };
        self.align(&context, pass)?;
        let Report { tiles, counters, .. } = self.both(&context, pass, &[last], bricks)?;
        report.tiles = tiles;
        report.counters.unresolved_pixels = counters.unresolved_pixels;
        report.counters.round_trips = report.counters.round_trips.max(counters.round_trips);
        Ok(report)
    }
}

impl FrameExecutor for Lockstep {
    delegate! {
        to self.gpu {
            fn device(&self) -> DeviceInfo;
            fn page_bytes(&self) -> u64;
            fn workers(&self) -> &Workers;
            fn leaves_out(&self) -> Keep;
            fn read(&mut self, family: &'static Family, buffer: usize, words: usize) -> Result<Vec<u32>, ExecutorError>;
            fn held(&mut self, family: &'static Family) -> &mut Option<Box<dyn Any>>;
            fn read_rays(&mut self, pass: Pass) -> Result<Vec<Ray>, ExecutorError>;
            fn read_hits(&mut self, pass: Pass) -> Result<Vec<Hit>, ExecutorError>;
            fn read_surfaces(&mut self, pass: Pass) -> Result<Vec<Surface>, ExecutorError>;
            fn read_gbuffer(&mut self) -> Result<Vec<GBuffer>, ExecutorError>;
            fn read_radiance(&mut self) -> Result<Vec<[f32; 4]>, ExecutorError>;
        }
    }

    fn texture_bytes(&self) -> u64 {
        assert_eq!(self.gpu.texture_bytes(), self.cpu.texture_bytes());
        self.gpu.texture_bytes()
    }

    fn set_extent(&mut self, extent: Extent) -> Result<(), ExecutorError> {
        self.gpu.set_extent(extent)?;
        self.cpu.set_extent(extent)
    }

    fn allow_bounces(&mut self) {
        self.gpu.allow_bounces();
        self.cpu.allow_bounces();
    }

    fn set_hidden(&mut self, bounds: &[u32]) -> Result<(), ExecutorError> {
        self.gpu.set_hidden(bounds)?;
        self.cpu.set_hidden(bounds)
    }

    fn lose_device(&mut self) {
        self.gpu.lose_device();
    }

    fn make_binary(&mut self) -> Result<(), ExecutorError> {
        self.gpu.make_binary()?;
        self.cpu.make_binary()
    }

    fn tuning(&mut self) -> &mut Tuning {
        &mut self.tuning
    }

    fn set_lamps(&mut self, lamps: &Arc<Lamps>) -> Result<(), ExecutorError> {
        self.gpu.set_lamps(lamps)?;
        self.cpu.set_lamps(lamps)
    }

    fn reserve(&mut self, family: &'static Family, elements: &[usize]) -> Result<(), ExecutorError> {
        self.gpu.reserve(family, elements)?;
        self.cpu.reserve(family, elements)
    }

    fn write(&mut self, family: &'static Family, buffer: usize, at: usize, bytes: &[u8]) {
        self.gpu.write(family, buffer, at, bytes);
        let mut own = bytes.to_vec();
        let is =
            |defect, of: &Family, number| self.defect == Some(defect) && std::ptr::eq(family, of) && buffer == number;
        if is(Defect::Maps, &roma::FAMILY, roma::MAPS) {
            let maps: &mut [RomaMap] = bytemuck::cast_slice_mut(&mut own);
            maps.iter_mut().for_each(|map| map.base_from_cell[0][3] += 0.01);
        }
        if is(Defect::Fields, &df::FAMILY, df::BOMS) {
            let words: &mut [u32] = bytemuck::cast_slice_mut(&mut own);
            let cells = (32.0 * words.len() as f64).cbrt().round() as usize;
            words[(3 + 5 * cells) * (cells / 32)] |= 1 << 7;
        }
        if is(Defect::LampMaps, &rsm::FAMILY, rsm::MAPS) {
            let maps: &mut [RsmMap] = bytemuck::cast_slice_mut(&mut own);
            maps.iter_mut().for_each(|map| map.texel_from_point[0][3] += 1.0);
        }
        if is(Defect::Guides, &denoise::FAMILY, denoise::SEEN) {
            let seen: &mut [DenoiseSeen] = bytemuck::cast_slice_mut(&mut own);
            seen.iter_mut().for_each(|seen| seen.footprint *= 1.01);
        }
        if is(Defect::Points, &dvf::FAMILY, dvf::GRID) {
            let grids: &mut [DvfGrid] = bytemuck::cast_slice_mut(&mut own);
            grids.iter_mut().for_each(|grid| grid.seed ^= 1);
        }
        self.cpu.write(family, buffer, at, &own);
    }

    fn set_scene(&mut self, scene: &Arc<SceneFile>) {
        self.gpu.set_scene(scene);
        self.cpu.set_scene(scene);
    }

    fn begin_frame(&mut self, view: &View) {
        self.directions = view.directions;
        self.gpu.begin_frame(view);
        let mut view = *view;
        if self.defect == Some(Defect::Seed) {
            view.params.seed ^= 1;
        }
        self.cpu.begin_frame(&view);
    }

    fn set_rays(&mut self, pass: Pass, rays: &[Ray]) {
        self.gpu.set_rays(pass, rays);
        self.cpu.set_rays(pass, rays);
    }
}

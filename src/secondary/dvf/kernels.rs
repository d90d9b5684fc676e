//! The kernels of discrete visibility fields, and the steps that they are run by.

use super::maps::{DvfMaps, sweep_elements, sweep_levels};
use super::mask::UNKNOWN;
use super::twin::{self, Tables};
use super::{DvfField, Fresh};
use crate::kernels;
use crate::kernels::FrameExecutor;
use crate::kernels::dispatch::direction_around;
use crate::kernels::layout::{DVF_WALK, DvfGrid, DvfOwn, DvfTriangle, NONE};
use crate::kernels::table::{Family, FamilyBuffer};
use crate::schedule::{ExecutorError, Over, Own, Step};
use std::any::Any;
use std::sync::Arc;

kernels! {
    /// The kernels.
    static KERNELS, names;

    dvf_areas: "dvf/dvf_areas" Own [] |_, t| Tables::of(t.buffers).map(twin::areas);
    dvf_counts: "dvf/dvf_counts" Own [] |_, t| Tables::of(t.buffers).map(twin::counts);
    dvf_up: "dvf/dvf_up" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::up(b.own(), tables.sums));
    dvf_down: "dvf/dvf_down" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::down(b.own(), tables.sums));
    dvf_rays: "dvf/dvf_rays" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::rays(b, &tables, t.own));
    dvf_write: "dvf/dvf_write" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::write(b, &tables, t.own));
    dvf_dilate: "dvf/dvf_dilate" Own [] |_, t| Tables::of(t.buffers).map(twin::dilate);
    dvf_labels: "dvf/dvf_labels" Own [] |_, t| Tables::of(t.buffers).map(twin::labels);
    dvf_cosine: "dvf/dvf_cosine" Own [] |b, t| {
        let gbuffer = &t.pixels.gbuffers[t.shaded];
        Tables::of(t.buffers).map(|tables| twin::cosine(b, &tables, t.own, t.seen, gbuffer))
    };
    dvf_sift: "dvf/dvf_sift" Own [] |b, t| {
        let gbuffer = &mut t.pixels.gbuffers[t.shaded];
        Tables::of(t.buffers).map(|tables| twin::sift(b, &tables, t.own, gbuffer))
    };
    dvf_seen: "dvf/dvf_seen" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::seen(b, &tables, t.seen));
    dvf_points: "dvf/dvf_points" Own [] |b, t| Tables::of(t.buffers).map(|tables| twin::points(b, &tables));
    dvf_light: "dvf/dvf_light" Shading []
        |b, t| twin::dvf_light(b, t.pixels, t.shaded, (t.seen, t.own), t.materials);
}

/// Number of the buffer of how the field lies.
pub const GRID: usize = 0;
/// Of masks.
const MASKS: usize = 1;
/// Of labels.
const LABELS: usize = 2;
/// Of the triangles of a group.
const TRIANGLES: usize = 3;
/// Of sums over them.
const SUMS: usize = 4;
/// Of directions.
const DIRECTIONS: usize = 5;
/// Of cells that are made anew.
const FRESH: usize = 7;
/// Of what is counted or listed.
const TALLY: usize = 8;

/// The kernels and their buffers.
pub static FAMILY: Family = Family {
    name: "dvf",
    what: "fields of visibility",
    remedy: "give fewer --dvf-cells or a smaller --dvf-octahedral",
    has_lamps: false,
    buffers: &[
        FamilyBuffer { name: "grid", stride: size_of::<DvfGrid>(), is_written: false },
        FamilyBuffer { name: "masks", stride: 4, is_written: true },
        FamilyBuffer { name: "labels", stride: 4, is_written: true },
        FamilyBuffer { name: "triangles", stride: size_of::<DvfTriangle>(), is_written: false },
        FamilyBuffer { name: "sums", stride: 8, is_written: true },
        FamilyBuffer { name: "directions", stride: 16, is_written: false },
        FamilyBuffer { name: "waiting", stride: 4, is_written: true },
        FamilyBuffer { name: "fresh", stride: 4, is_written: false },
        FamilyBuffer { name: "tally", stride: 4, is_written: true },
    ],
    kernels: KERNELS,
};

/// What an executor holds of a field.
#[derive(Clone, Debug, Default)]
struct Held {
    grid: DvfGrid,
    field: Option<Arc<DvfField>>,
    fresh: Option<Arc<Fresh>>,
    mask_words: usize,
    directions: usize,
    waiting_words: usize,
}

impl Held {
    fn of(executor: &mut dyn FrameExecutor) -> Self {
        let held: &mut Option<Box<dyn Any>> = executor.held(&FAMILY);
        held.as_ref().and_then(|held| held.downcast_ref::<Self>()).cloned().unwrap_or_default()
    }

    fn cells(&self) -> usize {
        self.grid.size.iter().map(|&n| n as usize).product()
    }

    /// Makes room for as much as is held.
    fn reserve(&self, executor: &mut dyn FrameExecutor) -> Result<(), ExecutorError> {
        let triangles = self.grid.triangles;
        let lengths = [
            1,
            self.mask_words,
            self.cells(),
            triangles as usize,
            sweep_elements(triangles) as usize,
            self.directions,
            self.waiting_words,
            self.fresh.as_ref().map_or(0, |fresh| fresh.words().len()),
            self.grid.listed as usize,
        ];
        executor.reserve(&FAMILY, &lengths)
    }

    fn keep(self, executor: &mut dyn FrameExecutor) {
        executor.write(&FAMILY, GRID, 0, bytemuck::bytes_of(&self.grid));
        *executor.held(&FAMILY) = Some(Box::new(self));
    }
}

impl DvfMaps {
    /// Places a field in the frame that has begun. Masks and labels are those that it gives; where it gives none, those
    /// that are there, unless it says otherwise or they are not as many: then empty ones.
    ///
    /// # Errors
    /// More than the device holds in one buffer, with how much it does; a device that binds too few buffers.
    pub fn give(&self, executor: &mut dyn FrameExecutor) -> Result<(), ExecutorError> {
        let before = Held::of(executor);
        let (mask_words, cells) = (self.mask_words(), self.cells());
        let is_same = match (&self.field, &before.field) {
            (Some(one), Some(other)) => Arc::ptr_eq(one, other),
            (None, _) => !self.is_new && (before.mask_words, before.cells()) == (mask_words, cells),
            _ => false,
        };
        let DvfGrid { triangles, .. } = before.grid;
        let held = Held {
            grid: DvfGrid { triangles, ..self.grid },
            field: self.field.clone(),
            fresh: self.fresh.clone(),
            mask_words,
            directions: self.directions.len().max(before.directions),
            waiting_words: self.waiting_words.max(before.waiting_words),
        };
        held.reserve(executor)?;
        match &self.field {
            _ if is_same => {}
            Some(field) => {
                executor.write(&FAMILY, MASKS, 0, bytemuck::cast_slice(&field.masks));
                executor.write(&FAMILY, LABELS, 0, bytemuck::cast_slice(&field.labels));
            }
            None => {
                executor.write(&FAMILY, MASKS, 0, &vec![0; 4 * mask_words]);
                executor.write(&FAMILY, LABELS, 0, bytemuck::cast_slice(&vec![UNKNOWN; cells]));
            }
        }
        if !self.directions.is_empty() {
            executor.write(&FAMILY, DIRECTIONS, 0, bytemuck::cast_slice(&self.directions));
        }
        if let Some(fresh) = &self.fresh
            && before.fresh.as_ref().is_none_or(|before| !Arc::ptr_eq(before, fresh))
        {
            executor.write(&FAMILY, FRESH, 0, bytemuck::cast_slice(fresh.words()));
        }
        held.keep(executor);
        Ok(())
    }
}

/// Gives an executor the triangles of which areas, numbers and rays are made next, and the number of points on all of
/// them once it is known.
///
/// # Errors
/// As of [`DvfMaps::give`], which has been called.
pub fn give_triangles(
    executor: &mut dyn FrameExecutor,
    triangles: &[DvfTriangle],
    point_count: u32,
) -> Result<(), ExecutorError> {
    let mut held = Held::of(executor);
    (held.grid.triangles, held.grid.point_count) = (triangles.len() as u32, point_count);
    held.reserve(executor)?;
    executor.write(&FAMILY, TRIANGLES, 0, bytemuck::cast_slice(triangles));
    held.keep(executor);
    Ok(())
}

/// Gives an executor what [`seen`] and [`points`] count on, or the numbers of the points that rays of cells that are
/// made anew start from ([`Fresh`]).
///
/// # Errors
/// As of [`DvfMaps::give`], which has been called.
pub fn give_tally(executor: &mut dyn FrameExecutor, words: &[u32]) -> Result<(), ExecutorError> {
    let mut held = Held::of(executor);
    held.grid.listed = words.len() as u32;
    held.reserve(executor)?;
    executor.write(&FAMILY, TALLY, 0, bytemuck::cast_slice(words));
    held.keep(executor);
    Ok(())
}

/// What these steps have made of them.
///
/// # Errors
/// The device's.
pub fn read_tally(executor: &mut dyn FrameExecutor) -> Result<Vec<u32>, ExecutorError> {
    let words = Held::of(executor).grid.listed as usize;
    executor.read(&FAMILY, TALLY, words)
}

/// The masks and labels of all cells; where some cells are made anew, the masks of these.
///
/// # Errors
/// The device's.
pub fn read_field(executor: &mut dyn FrameExecutor) -> Result<(Vec<u32>, Vec<u32>), ExecutorError> {
    let held = Held::of(executor);
    let cells = held.cells();
    Ok((executor.read(&FAMILY, MASKS, held.mask_words)?, executor.read(&FAMILY, LABELS, cells)?))
}

/// The sums of areas or points, level by level ([`sweep_levels`]).
///
/// # Errors
/// The device's.
pub fn read_sums(executor: &mut dyn FrameExecutor) -> Result<Vec<[u32; 2]>, ExecutorError> {
    let elements = sweep_elements(Held::of(executor).grid.triangles) as usize;
    let words = executor.read(&FAMILY, SUMS, 2 * elements)?;
    Ok(words.as_chunks::<2>().0.to_vec())
}

/// A kernel that is told nothing.
fn untold(kernel: &'static str) -> Own {
    Own::new(kernel, &DvfOwn::default())
}

/// Sums the areas of so many triangles that were given last.
pub fn areas(triangles: u32) -> Vec<Step> {
    let own = untold(names::dvf_areas).over(Over::Elements(triangles));
    std::iter::once(own.into()).chain(sweep(triangles, false)).collect()
}

/// Says how many points lie on all triangles before each of them.
pub fn counts(triangles: u32) -> Vec<Step> {
    let own = untold(names::dvf_counts).over(Over::Elements(triangles));
    std::iter::once(own.into()).chain(sweep(triangles, true)).collect()
}

/// Makes the rays of so many lanes of the points, from `first` on, in place of [`Step::Generate`]. `turn`: which of its
/// directions each takes. `waiting`: only those that [`write()`] noted from this word on to wait for bricks; else all.
pub fn rays(first: u32, turn: u32, waiting: Option<u32>) -> Step {
    Own::new(names::dvf_rays, &DvfOwn { first, turn, next: waiting.unwrap_or(NONE), ..DvfOwn::default() }).into()
}

/// Enters what they met into the masks of the cells that they start in. `waiting`: rays that asked for bricks wait;
/// they are noted from this word on, a bit each, and ended; else all are answered. `enters`: whether what the others
/// met is entered.
pub fn write(waiting: Option<u32>, enters: bool) -> Step {
    let own = DvfOwn { next: waiting.unwrap_or(NONE), count: enters.into(), ..DvfOwn::default() };
    Own::new(names::dvf_write, &own).into()
}

/// Labels so many cells, after masks have been widened, if they are to be.
pub fn finish(cells: u32, dilate: bool) -> Vec<Step> {
    let widened = dilate.then(|| untold(names::dvf_dilate).over(Over::Elements(2 * cells)).into());
    widened.into_iter().chain([untold(names::dvf_labels).over(Over::Elements(cells)).into()]).collect()
}

/// Makes rays around primary hits by the cosine for sample `sample`, in place of [`Step::Generate`].
pub fn cosine(sample: u32) -> Step {
    let [x, y, z] = direction_around(sample);
    Own::new(names::dvf_cosine, &DvfOwn { around: [x, y, z, 0.0], ..DvfOwn::default() }).into()
}

/// Adds what they bring of the environment, and what needs no ray, as the paper has it.
pub fn light() -> Step {
    untold(names::dvf_light).into()
}

/// Answers the pass's rays, not traced yet, that the field tells, and counts them: they are not traced.
pub fn sift() -> Step {
    untold(names::dvf_sift).into()
}

/// Counts the primary hits in each cell.
pub fn seen() -> Step {
    untold(names::dvf_seen).into()
}

/// Finds which of the points that were given last lie in cells that are made anew, and how many of their rays are made:
/// of so many sides of points, from `first` on.
pub fn points(first: u32, count: u32) -> Step {
    let own = DvfOwn { first, count, ..DvfOwn::default() };
    Own::new(names::dvf_points, &own).over(Over::Elements(count)).into()
}

/// Sums `count` elements, and with `is_down` makes each the sum of those before it; the sum of all is left in the last
/// level.
fn sweep(count: u32, is_down: bool) -> Vec<Step> {
    let levels = sweep_levels(count);
    let of = |kernel, level: usize, next: u32| {
        let (first, count) = levels[level];
        let own = DvfOwn { first, count, next, ..DvfOwn::default() };
        Step::from(Own::new(kernel, &own).over(Over::Groups(count.div_ceil(DVF_WALK))))
    };
    let last = levels.len() - 1;
    let up = (0..last).map(|level| of(names::dvf_up, level, levels[level + 1].0));
    // Of the one block below the sum of all nothing comes before.
    let next = |level: usize| if level + 1 == last { NONE } else { levels[level + 1].0 };
    let down = (0..last).rev().filter(|_| is_down).map(|level| of(names::dvf_down, level, next(level)));
    up.chain(down).collect()
}

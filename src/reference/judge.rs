//! Compares what a kernel found with truth.
//!
//! From [`super::bounds`] follows for every triangle near the ray whether a kernel *must* find it, *may* find it, or
//! must not, and between which t. A kernel's answer that differs from truth is excused only if all of this could have
//! been:
//!
//! * the triangle it names may be met, at the t it gives;
//! * no triangle that it must find lies nearer, beyond doubt;
//! * no patch of triangles joined by shared edges covers the surroundings of the ray nearer: one of them is met
//!   whichever way the vertices were rounded, because they are rounded alike. A gap in a closed mesh is never excused;
//! * no copy of the named triangle, vertex for vertex, has a lower id: equal bits give equal t.
//!
//! Then one of the two triangles has an edge within ε_edge of the ray, or the two distances cannot be told apart, or
//! a hit lies at an end of the ray's interval.
//!
//! A triangle that f32 cannot tell from one that lets the ray pass may be met, and need not be.
//!
//! The triangle that a ray excludes is as if it were not there: it may not be named, need not be found, and is no part
//! of a patch, which then has a hole where its neighbours' edges lack a side.

use super::assessment::{Assessment, distance_to_segment, orientation};
use super::bounds::{assess_index, padding};
use super::bvh::Padding;
use super::instance::stretch;
use super::opacity::Passing;
use super::ray::TruthRay;
use super::truth::Truth;
use std::collections::{BTreeSet, HashMap};
use std::fmt;

/// Why f32 could not have told.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Excuse {
    /// The ray is within ε_edge of an edge of the triangle found or of the true one.
    Edge,
    /// The two triangles' distances are within their ε_t of each other.
    Tie,
    /// A hit is within ε_t of an end of the ray's interval.
    IntervalEnd,
    /// The ray meets a triangle where its alpha, as far as f32 can tell, or chance, lets it pass or not.
    Opacity,
}

/// What is wrong with an answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Fault {
    /// There is no triangle of this id.
    NoSuchTriangle {
        /// The id.
        id: u32,
    },
    /// The triangle named is the one that the ray excludes.
    Excluded {
        /// The triangle named.
        id: u32,
    },
    /// The triangle named is not met, by more than ε_edge.
    NotMet {
        /// The triangle named.
        id: u32,
    },
    /// Nothing is met, by more than ε_edge, where an any-hit query found something.
    NothingMet,
    /// t is not one that arithmetic could give for this triangle.
    Distance {
        /// The triangle named.
        id: u32,
        /// t as found.
        t: f64,
        /// Least t that arithmetic could give.
        low: f64,
        /// Greatest t that arithmetic could give.
        high: f64,
    },
    /// t is outside of the ray's interval.
    Interval {
        /// t as found.
        t: f64,
    },
    /// A nearer triangle had to be found.
    Missed {
        /// That triangle.
        id: u32,
    },
    /// The ray went through between triangles that share edges.
    Gap {
        /// One of the triangles.
        id: u32,
    },
    /// A copy of the triangle named has a lower id.
    HigherId {
        /// The copy with the lower id.
        id: u32,
    },
}

/// The judgement of one ray.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Verdict {
    /// As truth has it: the same triangle, t within its bounds; or both a miss.
    Equal,
    /// Different, and f32 could not have told.
    Excused(Excuse),
    /// Wrong.
    Mismatch(Fault),
}

/// Verdicts, counted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Tally {
    /// [`Verdict::Equal`].
    pub equal: u64,
    /// By each [`Excuse`].
    pub by_excuse: [u64; 4],
    /// [`Verdict::Mismatch`].
    pub mismatches: u64,
    /// The first mismatch: which in the order of adding, counted from 0, and what.
    pub first: Option<(u64, Fault)>,
}

impl Tally {
    /// Counts one verdict.
    pub fn add(&mut self, verdict: Verdict) {
        let index = self.total();
        match verdict {
            Verdict::Equal => self.equal += 1,
            Verdict::Excused(excuse) => self.by_excuse[excuse as usize] += 1,
            Verdict::Mismatch(fault) => {
                self.mismatches += 1;
                self.first.get_or_insert((index, fault));
            }
        }
    }

    /// Counts those of another.
    pub fn join(&mut self, other: Self) {
        self.equal += other.equal;
        self.by_excuse.iter_mut().zip(other.by_excuse).for_each(|(sum, own)| *sum += own);
        self.mismatches += other.mismatches;
        self.first = self.first.or(other.first);
    }

    /// Verdicts excused.
    pub fn excused(&self) -> u64 {
        self.by_excuse.iter().sum()
    }

    /// All verdicts.
    pub fn total(&self) -> u64 {
        self.equal + self.excused() + self.mismatches
    }
}

impl FromIterator<Verdict> for Tally {
    fn from_iter<T: IntoIterator<Item = Verdict>>(verdicts: T) -> Self {
        let mut tally = Self::default();
        verdicts.into_iter().for_each(|verdict| tally.add(verdict));
        tally
    }
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rays: {} equal, {} excused ", self.total(), self.equal, self.excused())?;
        let [edge, tie, end, opacity] = self.by_excuse;
        write!(f, "({edge} at edges, {tie} ties, {end} at interval ends, {opacity} by alpha), ")?;
        write!(f, "{} mismatches", self.mismatches)?;
        if let Some((ray, fault)) = &self.first {
            write!(f, ", first of ray {ray}: {fault:?}")?;
        }
        Ok(())
    }
}

/// Judges a closest hit: `found` is the id and t of a kernel, in units of `ray.direction`, or `None` for a miss.
pub fn judge(truth: &Truth, ray: &TruthRay, found: Option<(u32, f64)>) -> Verdict {
    let expected = truth.closest(ray);
    match (&expected, found) {
        (None, None) => Verdict::Equal,
        (Some(hit), Some((id, t))) if hit.id == id => {
            // The id came from truth itself.
            let Some(index) = truth.find(id) else { return Verdict::Mismatch(Fault::NoSuchTriangle { id }) };
            check_distance(ray, id, t, &assess_index(truth, ray, index)).map_or(Verdict::Equal, Verdict::Mismatch)
        }
        _ => {
            let expected = expected.and_then(|hit| truth.find(hit.id));
            difference(truth, ray, expected, found).map_or_else(Verdict::Mismatch, Verdict::Excused)
        }
    }
}

/// Judges an any-hit query.
pub fn judge_any(truth: &Truth, ray: &TruthRay, occluded: bool) -> Verdict {
    if truth.any(ray) == occluded {
        return Verdict::Equal;
    }
    let nearby = Nearby::new(truth, ray, ray.t_max);
    let verdict = if occluded {
        let possible = |c: &&Candidate| c.at.possibly_met() && c.at.t_low <= ray.t_max && c.at.t_high >= ray.t_min;
        match nearby.candidates.iter().find(possible) {
            Some(candidate) if candidate.may_pass => Ok(Excuse::Opacity),
            Some(candidate) if candidate.at.near_edge() => Ok(Excuse::Edge),
            Some(_) => Ok(Excuse::IntervalEnd),
            None => Err(Fault::NothingMet),
        }
    } else {
        nearby.nothing_certain_before(f64::INFINITY, None).map(|()| {
            let edge = nearby.candidates.iter().any(|c| c.at.near_edge());
            let passes = nearby.candidates.iter().any(|c| c.may_pass && c.at.possibly_met());
            match (passes, edge) {
                (true, _) => Excuse::Opacity,
                (_, true) => Excuse::Edge,
                _ => Excuse::IntervalEnd,
            }
        })
    };
    verdict.map_or_else(Verdict::Mismatch, Verdict::Excused)
}

fn check_distance(ray: &TruthRay, id: u32, t: f64, at: &Assessment) -> Option<Fault> {
    if !(ray.t_min <= t && t <= ray.t_max) {
        return Some(Fault::Interval { t });
    }
    let (low, high) = (at.t_low, at.t_high);
    (!(low <= t && t <= high)).then_some(Fault::Distance { id, t, low, high })
}

/// The excuse of an answer that differs from truth, or what is wrong with it.
fn difference(
    truth: &Truth,
    ray: &TruthRay,
    expected: Option<usize>,
    found: Option<(u32, f64)>,
) -> Result<Excuse, Fault> {
    let mut named = None;
    if let Some((id, t)) = found {
        let index = truth.find(id).ok_or(Fault::NoSuchTriangle { id })?;
        if truth.is_excluded(ray, index) {
            return Err(Fault::Excluded { id });
        }
        let at = assess_index(truth, ray, index);
        if !at.possibly_met() || !truth.passing(index, &at).may_stop {
            return Err(Fault::NotMet { id });
        }
        if let Some(fault) = check_distance(ray, id, t, &at) {
            return Err(fault);
        }
        named = Some((index, at));
    }
    let limit = found.map_or(ray.t_max, |(_, t)| t);
    let nearby = Nearby::new(truth, ray, limit);
    if let Some((index, _)) = named {
        nearby.no_lower_copy(index)?;
    }
    let before = found.map_or(f64::INFINITY, |(_, t)| t);
    nearby.nothing_certain_before(before, named.map(|(index, _)| index))?;

    if nearby.candidates.iter().any(|c| c.may_pass && c.at.possibly_met() && nearby.may_be_before(&c.at, before)) {
        return Ok(Excuse::Opacity);
    }
    let expected = expected.map(|index| assess_index(truth, ray, index));
    let pair = [expected, named.map(|(_, at)| at)];
    if pair.iter().flatten().any(Assessment::near_edge) {
        Ok(Excuse::Edge)
    } else if pair.iter().all(Option::is_some) && pair.iter().flatten().all(|at| nearby.within_interval(at)) {
        Ok(Excuse::Tie)
    } else {
        Ok(Excuse::IntervalEnd)
    }
}

struct Candidate {
    index: usize,
    at: Assessment,
    may_pass: bool,
}

/// The triangles that the ray comes near.
struct Nearby<'a> {
    truth: &'a Truth,
    ray: &'a TruthRay,
    limit: f64,
    candidates: Vec<Candidate>,
}

/// The triangles whose boxes, grown by `padding`, the ray meets up to t = `limit`, but for the excluded one.
fn gather(truth: &Truth, ray: &TruthRay, padding: Padding, limit: f64) -> Vec<Candidate> {
    let mut candidates = Vec::new();
    truth.bvh.visit(ray, padding, limit, |index| {
        let index = index as usize;
        if !truth.is_excluded(ray, index) {
            let at = assess_index(truth, ray, index);
            let Passing { may_stop, may_pass } = truth.passing(index, &at);
            if may_stop {
                candidates.push(Candidate { index, at, may_pass });
            }
        }
        limit
    });
    candidates
}

impl<'a> Nearby<'a> {
    /// All triangles whose boundary is within 4 of their ε_edge of the ray, or that it meets, up to t = `limit`.
    fn new(truth: &'a Truth, ray: &'a TruthRay, limit: f64) -> Self {
        let limit = limit + 1e-3 * limit.abs();
        let candidates = gather(truth, ray, padding(truth, ray), limit);
        Self { truth, ray, limit, candidates }
    }

    fn id(&self, index: usize) -> u32 {
        self.truth.placed[index].id
    }

    /// Whether the kernel is certain to have t within the ray's interval.
    fn within_interval(&self, at: &Assessment) -> bool {
        self.ray.t_min < at.t_low && at.t_high < self.ray.t_max
    }

    /// Whether a hit of this triangle is certain to come before `t`.
    fn is_before(&self, at: &Assessment, t: f64) -> bool {
        self.within_interval(at) && at.t_high < t
    }

    /// Whether a hit of this triangle may come at or before `t`.
    fn may_be_before(&self, at: &Assessment, t: f64) -> bool {
        at.t_high >= self.ray.t_min && at.t_low <= t.min(self.ray.t_max)
    }

    /// Fails if a kernel had to find something before `t`, other than triangle `named`.
    fn nothing_certain_before(&self, t: f64, named: Option<usize>) -> Result<(), Fault> {
        let counts = |c: &&Candidate| Some(c.index) != named && !c.may_pass && self.is_before(&c.at, t);
        let before: Vec<&Candidate> = self.candidates.iter().filter(counts).collect();
        let met = before.iter().filter(|c| c.at.certainly_met());
        if let Some(nearest) = met.min_by(|a, b| a.at.t_low.total_cmp(&b.at.t_low)) {
            return Err(Fault::Missed { id: self.id(nearest.index) });
        }
        let instance = |c: &Candidate| self.truth.placed[c.index].instance;
        // A patch has a triangle that may be met.
        let instances: BTreeSet<u32> = before.iter().filter(|c| c.at.possibly_met()).map(|c| instance(c)).collect();
        for of in instances {
            let close =
                |c: &&&Candidate| instance(c) == of && (c.at.inside || c.at.edge_distance <= 4.0 * c.at.edge_epsilon);
            let e = before.iter().filter(close).map(|c| c.at.edge_epsilon).fold(0.0, f64::max);
            // The patch reaches 4E around the ray, whatever the ε_edge of its triangles.
            let constant = 4.001 * e * stretch(&self.truth.instances[of as usize]);
            let around = gather(self.truth, self.ray, Padding { constant, ..Padding::NONE }, self.limit);
            let patch: Vec<&Candidate> = around.iter().filter(|c| counts(c) && instance(c) == of).collect();
            if let Some(index) = covering(self.truth, &patch, e) {
                return Err(Fault::Gap { id: self.id(index) });
            }
        }
        Ok(())
    }

    /// Fails if a triangle of the same vertices in the same order, of the same instance, has a lower id.
    fn no_lower_copy(&self, named: usize) -> Result<(), Fault> {
        let vertices = self.truth.stored(named).2.vertices;
        let instance = self.truth.placed[named].instance;
        let copy = self.candidates.iter().map(|c| c.index).find(|&index| {
            // Indices are in the order of ids.
            index < named
                && self.truth.placed[index].instance == instance
                && self.truth.stored(index).2.vertices == vertices
        });
        copy.map_or(Ok(()), |index| Err(Fault::HigherId { id: self.id(index) }))
    }
}

/// A triangle out of a patch that covers the ray however its vertices are rounded, if there is one among triangles of
/// one instance, all that are within 4E of the ray among them.
///
/// E, here `e`, is the greatest ε_edge among the triangles near the ray. The patch is the largest set of triangles in
/// which every edge within 4E of the ray has a triangle of certain winding on either side. Suppose that the ray is not
/// on the patch as the kernel has it, but a triangle of the patch is within E. Then the nearest point of the patch is
/// within 2E and lies on an edge that in truth is within 3E. Not within an edge: there is a triangle on the other side.
/// Not at a vertex: all edges of the patch that meet there are within 3E, each with triangles on both sides, so that
/// they go all the way round. So the kernel must have met a triangle of the patch.
fn covering(truth: &Truth, candidates: &[&Candidate], e: f64) -> Option<usize> {
    let near = |c: &&&Candidate| c.at.edge_distance <= 4.0 * e && c.at.winding_is_certain(e);
    let mut patch: Vec<&Candidate> = candidates.iter().filter(near).copied().collect();
    loop {
        // Of every edge near the ray, by its vertices on the lattice: the sides on which it has a triangle.
        let mut sides: HashMap<[[i64; 3]; 2], [bool; 2]> = HashMap::new();
        for candidate in &patch {
            for (key, side) in near_edges(truth, candidate, 4.0 * e) {
                sides.entry(key).or_default()[side] = true;
            }
        }
        let before = patch.len();
        patch.retain(|c| near_edges(truth, c, 4.0 * e).all(|(key, _)| sides[&key] == [true; 2]));
        if patch.len() == before {
            break;
        }
    }
    patch.iter().find(|c| c.at.possibly_met()).map(|c| c.index)
}

/// The edges of a triangle within `reach` of the ray: their ends on the lattice, in order, and the side of the third
/// vertex.
fn near_edges<'a>(
    truth: &'a Truth,
    candidate: &'a Candidate,
    reach: f64,
) -> impl Iterator<Item = ([[i64; 3]; 2], usize)> + 'a {
    let keys = truth.stored(candidate.index).2.vertices;
    let points = candidate.at.sheared;
    (0..3).filter(move |&i| distance_to_segment(points[i], points[(i + 1) % 3]) <= reach).map(move |i| {
        let (p, q, apex) = (i, (i + 1) % 3, (i + 2) % 3);
        let (p, q) = if keys[p] <= keys[q] { (p, q) } else { (q, p) };
        let side = usize::from(orientation(points[p], points[q], points[apex]) > 0.0);
        ([keys[p], keys[q]], side)
    })
}

//! Motions: where instances of a scene are at a time, from keyframes in a JSON file.
//!
//! A motion is rigid, with one scale for all axes, and is applied to where the scene has the instance: a point p of it
//! goes to pivot + translation + scale · rotation (p − pivot). Translations lie on the spline of camera paths
//! ([`super::path`]), rotations turn the shorter way at constant speed (Shoemake, "Animating Rotation with Quaternion
//! Curves", SIGGRAPH 1985), scales grow by equal factors in equal times. Before the first keyframe and after the last
//! it rests there.

use super::keyframes::{self, KeyframesError};
use super::path::spline;
use super::placement::{affine, leaf_box};
use bricks::{Instance, Resident};
use glam::{DMat3, DQuat, DVec3};
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What messages call a file.
const KIND: &str = "motion";

/// Scales that a keyframe may have.
const SCALES: std::ops::RangeInclusive<f64> = 1e-6..=1e6;

/// Most names that a message lists.
const MOST_NAMES: usize = 16;

/// What is moved.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Target {
    /// All instances of a node, and of the nodes below it where the conversion was asked to keep it movable.
    Node(String),
    /// One instance.
    Instance(u32),
}

impl std::fmt::Display for Target {
    fn fmt(&self, f: &mut std::fmt::Formatter) -> std::fmt::Result {
        match self {
            Self::Node(name) => write!(f, "node {name:?}"),
            Self::Instance(number) => write!(f, "instance {number}"),
        }
    }
}

/// Where something is at a time, against its place in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pose {
    /// Time, that of the camera path.
    pub time: f64,
    /// By which it is moved, world units.
    pub translation: DVec3,
    /// By which it is turned about the pivot; a unit quaternion.
    pub rotation: DQuat,
    /// By which it is scaled about the pivot.
    pub scale: f64,
}

/// Something that moves. Valid by construction: at least one keyframe, times strictly ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct Mover {
    /// What.
    pub target: Target,
    /// The point that it turns about, world units, where the scene has it; `None`: the middle of its bounds.
    pub pivot: Option<DVec3>,
    keyframes: Vec<Pose>,
}

/// The motion of a file.
#[derive(Clone, Debug, PartialEq)]
pub struct Motion {
    file: PathBuf,
    movers: Vec<Mover>,
}

/// A motion of instances of a scene.
#[derive(Clone, Debug, PartialEq)]
pub struct Movers(Vec<Bound>);

#[derive(Clone, Debug, PartialEq)]
struct Bound {
    mover: Mover,
    pivot: DVec3,
    /// Instances with world_from_object of where the scene has them.
    instances: Vec<(u32, [f64; 12])>,
}

/// The file as serde sees it; movers and keyframes stay values so that an error can name the one it is in.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    instances: Vec<serde_json::Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMover {
    node: Option<String>,
    instance: Option<u32>,
    pivot: Option<[f64; 3]>,
    keyframes: Vec<serde_json::Value>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPose {
    time: f64,
    #[serde(default)]
    translation: [f64; 3],
    #[serde(default = "no_rotation")]
    rotation: [f64; 4],
    #[serde(default = "no_scale")]
    scale: f64,
}

fn no_rotation() -> [f64; 4] {
    [0.0, 0.0, 0.0, 1.0]
}

fn no_scale() -> f64 {
    1.0
}

impl RawPose {
    fn pose(&self) -> Result<Pose, String> {
        let Self { time, translation, rotation, scale } = *self;
        if !time.is_finite() || !translation.iter().all(|x| x.is_finite()) {
            return Err("time and translation must be finite numbers".into());
        }
        // Dividing by the largest component first keeps the squares in range.
        let largest = rotation.iter().fold(0.0f64, |most, x| most.max(x.abs()));
        if !(largest > 0.0 && largest.is_finite() && rotation.iter().all(|x| x.is_finite())) {
            return Err(format!("its rotation {rotation:?} is not a quaternion [x, y, z, w] of non-zero length"));
        }
        if !SCALES.contains(&scale) {
            return Err(format!("its scale {scale} is not from {:e} to {:e}", SCALES.start(), SCALES.end()));
        }
        let unit = DQuat::from_array(rotation);
        // A unit quaternion stays as it is.
        let rotation = match unit.length_squared() == 1.0 {
            true => unit,
            false => DQuat::from_array(rotation.map(|x| x / largest)).normalize(),
        };
        Ok(Pose { time, translation: translation.into(), rotation, scale })
    }
}

impl Motion {
    /// Reads a motion file.
    ///
    /// # Errors
    /// The file cannot be read, is not JSON of the documented form, or a mover is wrong.
    pub fn read(file: &Path) -> Result<Self, KeyframesError> {
        Self::parse(&keyframes::read(file, KIND)?, file)
    }

    /// Parses the text of a motion file; `file` names it in errors.
    ///
    /// # Errors
    /// As of [`Self::read`].
    pub fn parse(text: &str, file: &Path) -> Result<Self, KeyframesError> {
        let raw: Raw = keyframes::parse(text, file, KIND)?;
        let movers = raw.instances.into_iter().enumerate().map(|(number, value)| {
            let refuse = |mover: String, what: String| KeyframesError::new(file, format!("{mover}: {what}"));
            let place = format!("entry {number} of its instances");
            let raw: RawMover = serde_json::from_value(value).map_err(|error| {
                let what = format!("{error}; it needs node (a name) or instance (a number), and keyframes");
                refuse(place.clone(), what)
            })?;
            let target = match (raw.node, raw.instance) {
                (Some(name), None) => Target::Node(name),
                (None, Some(instance)) => Target::Instance(instance),
                _ => return Err(refuse(place, "give node (a name) or instance (a number), one of them".into())),
            };
            let refuse = |what: String| refuse(target.to_string(), what);
            let pivot = raw.pivot.map(DVec3::from_array);
            if pivot.is_some_and(|pivot| !pivot.is_finite()) {
                return Err(refuse("its pivot must be three finite numbers".into()));
            }
            let mut poses: Vec<Pose> = Vec::with_capacity(raw.keyframes.len());
            for (k, value) in raw.keyframes.into_iter().enumerate() {
                let raw: RawPose = serde_json::from_value(value).map_err(|error| {
                    refuse(format!(
                        "keyframe {k}: {error}; it needs time, and may have translation, rotation and scale"
                    ))
                })?;
                let pose = raw.pose().map_err(|what| refuse(format!("keyframe {k}: {what}")))?;
                let before = poses.last().map(|pose| pose.time);
                keyframes::check_after(before, pose.time).map_err(|what| refuse(format!("keyframe {k}: {what}")))?;
                poses.push(pose);
            }
            if poses.is_empty() {
                return Err(refuse("it has no keyframes; add at least one".into()));
            }
            if !(poses[poses.len() - 1].time - poses[0].time).is_finite() {
                return Err(refuse("its times are too far apart for a number".into()));
            }
            Ok(Mover { target, pivot, keyframes: poses })
        });
        Ok(Self { file: file.into(), movers: movers.collect::<Result<_, _>>()? })
    }

    /// What moves, as the file has it.
    pub fn movers(&self) -> &[Mover] {
        &self.movers
    }

    /// The instances of a scene that it moves.
    ///
    /// # Errors
    /// A node or an instance that the scene does not have, or has in its baked world; one that two movers name.
    pub fn bind(&self, resident: &Resident) -> Result<Movers, KeyframesError> {
        let mut of_whom: BTreeMap<u32, &Target> = BTreeMap::new();
        let mut bound = Vec::with_capacity(self.movers.len());
        for mover in &self.movers {
            let refuse = |what: String| KeyframesError::new(&self.file, format!("{}: {what}", mover.target));
            let instances = instances_of(resident, &mover.target).map_err(refuse)?;
            for &instance in &instances {
                if let Some(other) = of_whom.insert(instance, &mover.target) {
                    return Err(refuse(format!("{other} moves the same instance {instance}; leave one of them out")));
                }
            }
            let pivot = mover.pivot.unwrap_or_else(|| middle(resident, &instances));
            let place = |&instance: &u32| (instance, resident.instances[instance as usize].world_from_object);
            bound.push(Bound { mover: mover.clone(), pivot, instances: instances.iter().map(place).collect() });
        }
        Ok(Movers(bound))
    }
}

/// The instances that a target names.
fn instances_of(resident: &Resident, target: &Target) -> Result<Vec<u32>, String> {
    let last = resident.instances.len() as u32 - 1;
    let name = match target {
        Target::Instance(number) if (1..=last).contains(number) => return Ok(vec![*number]),
        Target::Instance(0) => return Err("instance 0 is the world object, which cannot move; choose another".into()),
        Target::Instance(_) if last == 0 => return Err(NOTHING.into()),
        Target::Instance(_) => {
            return Err(format!("the scene has instances 1 to {last}; brickwalk info --instances lists them"));
        }
        Target::Node(name) => name,
    };
    let provenance = &resident.manifest.provenance;
    // Instances but the world by the ids of their triangles, which do not overlap.
    let mut by_base: Vec<(u32, u32)> = (1..=last).map(|i| (resident.instances[i as usize].base, i)).collect();
    by_base.sort_unstable();
    let instance_of = |id: u32| {
        let &(base, instance) = by_base[..by_base.partition_point(|(base, _)| *base <= id)].last()?;
        let object = resident.instances[instance as usize].object as usize;
        (id - base < resident.objects[object].triangle_ids).then_some(instance)
    };
    let (mut found, mut is_baked) = (Vec::new(), false);
    for one in provenance.iter().filter(|one| one.node == *name || one.under.contains(name)) {
        match instance_of(one.first_id) {
            Some(instance) => found.push(instance),
            None => is_baked = true,
        }
    }
    found.sort_unstable();
    found.dedup();
    if is_baked {
        let part = if found.is_empty() { "it is" } else { "a part of it is" };
        return Err(format!("{part} baked into the world; convert the scene again with --movable {name:?}"));
    }
    if found.is_empty() {
        if last == 0 {
            return Err(NOTHING.into());
        }
        let mut names: Vec<&str> = Vec::new();
        for one in provenance.iter().filter(|one| instance_of(one.first_id).is_some()) {
            for name in one.under.iter().chain([&one.node]) {
                if names.len() <= MOST_NAMES && !names.contains(&name.as_str()) {
                    names.push(name);
                }
            }
        }
        if names.len() > MOST_NAMES {
            names[MOST_NAMES] = "…";
        }
        return Err(format!(
            "the scene has no such node; those that can be moved are {}, brickwalk info --instances lists them; other \
             nodes need convert --movable",
            names.join(", ")
        ));
    }
    Ok(found)
}

/// What a scene without instances says.
const NOTHING: &str = "everything in the scene is baked into the world; convert it again with --movable NAME";

/// The middle of the bounds of instances; the origin of instances without triangles.
fn middle(resident: &Resident, instances: &[u32]) -> DVec3 {
    let leaves = resident.leaves.iter().filter(|leaf| instances.binary_search(&leaf.instance).is_ok());
    let all = leaves.map(|leaf| leaf_box(resident, leaf)).reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])]);
    all.map_or(DVec3::ZERO, |[min, max]| 0.5 * (min + max))
}

impl Mover {
    /// Where it is at a time.
    pub fn at(&self, time: f64) -> Pose {
        let keys = &self.keyframes;
        // The segment [i, i + 1] that holds the time: the number of inner keyframes not after it.
        let i = keys.partition_point(|k| k.time <= time).saturating_sub(1);
        if i + 1 >= keys.len() || time <= keys[0].time {
            return Pose { time, ..keys[i] };
        }
        let (a, b) = (&keys[i], &keys[i + 1]);
        let share = (time - a.time) / (b.time - a.time);
        // What rests does so exactly.
        let around = &keys[i.saturating_sub(1)..(i + 3).min(keys.len())];
        let translation = match around.iter().all(|k| k.translation == a.translation) {
            true => a.translation,
            false => spline(keys, i, time, |k| k.time, |k| k.translation),
        };
        let rotation = if a.rotation == b.rotation { a.rotation } else { a.rotation.slerp(b.rotation, share) };
        let scale = if a.scale == b.scale { a.scale } else { a.scale * (b.scale / a.scale).powf(share) };
        Pose { time, translation, rotation, scale }
    }
}

impl Pose {
    /// What takes an instance, by world_from_object where the scene has it, to where it is; about `pivot`. No motion
    /// leaves it as it is, bit for bit.
    pub fn place(&self, world_from_object: &[f64; 12], pivot: DVec3) -> [f64; 12] {
        let before = affine(world_from_object);
        let turn = DMat3::from_quat(self.rotation) * self.scale;
        let linear = turn * before.matrix3;
        let at = turn * before.translation + (pivot - turn * pivot) + self.translation;
        let mut placed = Instance::IDENTITY;
        for row in 0..3 {
            for column in 0..3 {
                placed[4 * row + column] = linear.col(column)[row];
            }
            placed[4 * row + 3] = at[row];
        }
        placed
    }
}

impl Movers {
    /// World_from_object of the instances that move, at a time.
    pub fn at(&self, time: f64) -> Vec<(u32, [f64; 12])> {
        let of_mover = |bound: &Bound| {
            let pose = bound.mover.at(time);
            let place = |(instance, matrix): &(u32, [f64; 12])| (*instance, pose.place(matrix, bound.pivot));
            bound.instances.iter().map(place).collect::<Vec<_>>()
        };
        self.0.iter().flat_map(of_mover).collect()
    }
}

#[cfg(test)]
#[path = "motion_tests.rs"]
mod tests;

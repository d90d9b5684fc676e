//! All kinds: a line each.

use crate::device;
use crate::differences;
use crate::faults;
use crate::inputs;
use crate::kills::all as kills;
use crate::kind::Kind;
use crate::own;
use crate::threads;

/// All kinds, those that are fast first.
pub static ALL: &[&dyn Kind] = &[
    &inputs::gltf::Glb,
    &inputs::gltf::Gltf,
    &inputs::compressed::Compressed,
    &inputs::draco::Draco,
    &inputs::samples::Samples,
    &inputs::tiles::Tiles,
    &inputs::obj::Obj,
    &inputs::ply::Ply,
    &inputs::stl::Stl,
    &inputs::pictures::Pictures,
    &inputs::environment::Environment,
    &inputs::npy::Npy,
    &inputs::keyframes::Paths,
    &inputs::keyframes::Motions,
    &inputs::settings::SettingsFiles,
    &inputs::words::Words,
    &inputs::messages::Messages,
    &inputs::requests::Requests,
    &inputs::bricks_file::BricksFile,
    &inputs::field::Field,
    &inputs::arrays::Arrays,
    &inputs::rates::RateFiles,
    &inputs::rows::RowFiles,
    &inputs::disk_cache::DiskCaches,
    &differences::Builds,
    &differences::Schedules,
    &differences::Exact,
    &differences::Asked,
    &faults::Frames,
    &faults::Queried,
    &faults::Changed,
    &device::Lowered,
    &device::Lost,
    &threads::Inboxes,
    &threads::HostCaches,
    &kills::SCENE,
    &kills::SCENE_MEMORY,
    &kills::CONVERT,
    &kills::CONVERT_MEMORY,
    &kills::LEVELS,
    &kills::DISPLACEMENT,
    &kills::REPAIR,
    &kills::WALK,
    &kills::DVF,
    &kills::STUDY,
    &kills::QUERY,
    &kills::TRACE,
    &kills::PARTS,
    &kills::CLUSTER,
];

/// The kind of this name, those that misbehave on purpose among them.
pub fn find(name: &str) -> Option<&'static dyn Kind> {
    let own = own::ALL.iter().map(|kind| kind as &dyn Kind);
    ALL.iter().copied().chain(own).find(|kind| kind.name() == name)
}

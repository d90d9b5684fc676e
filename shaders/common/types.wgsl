// Structures and constants that kernels share. The build writes their Rust mirrors, `kernels::layout`, from every file
// whose name ends in `types.wgsl`: a declaration's comment documents both. Padding needs fields of its own.

#include "common/params_types.wgsl"
#include "common/rays_types.wgsl"
#include "common/scene_types.wgsl"
#include "common/surfaces_types.wgsl"
#include "common/lamp_types.wgsl"

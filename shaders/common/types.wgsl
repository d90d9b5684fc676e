// Structures shared by all kernels. Each mirrors a #[repr(C)] struct of src/kernel/layout.rs; the build compares the
// two.

#include "common/params_types.wgsl"
#include "common/rays_types.wgsl"
#include "common/scene_types.wgsl"
#include "common/surfaces_types.wgsl"
#include "common/lamp_types.wgsl"

// Structures shared by all kernels. Each mirrors a #[repr(C)] struct of src/kernel/layout.rs; the build compares the two.

#include "shared/params_types.wgsl"
#include "shared/rays_types.wgsl"
#include "shared/scene_types.wgsl"
#include "shared/surfaces_types.wgsl"
#include "shared/visibility_types.wgsl"

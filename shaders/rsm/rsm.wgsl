// Reflective shadow maps (Dachsbacher and Stamminger 2005): bindings of group 2 behind those of the lamps. A lamp has
// one map or several, one after the other, of which the first that holds a point knows what the lamp lights there.

#include "rsm/types.wgsl"

@group(1) @binding(6) var<uniform> own: RsmOwn;
@group(2) @binding(4) var<storage, read> rsm_maps: array<RsmMap>;
@group(2) @binding(5) var<storage, read_write> rsm_texels: array<RsmTexel>; // of all maps, row by row

// Bindings of group 3 of texture lookups: materials and textures, where tiles lie, the G-buffer of the shaded set, what
// is asked of tiles. The levels that are resident throughout follow from binding 5 on.

@group(3) @binding(0) var<storage, read> materials: array<Material>;
@group(3) @binding(1) var<storage, read> textures: array<Texture>;
@group(3) @binding(2) var<storage, read> tile_slots: array<TileSlot>;
@group(3) @binding(3) var<storage, read_write> gbuffer: array<GBuffer>;
@group(3) @binding(4) var<storage, read_write> tile_demand: array<TileDemand>;

// Distance fields.

struct DfOwn {            // what a kernel is told
    cells: u32,           // cells of a field's base map on each axis
    levels: u32,          // fields, one a base map
    level: u32,           // which field is made
    mip: u32,             // which of its levels is made: cells are 2^mip of the base map's
    step: u32,            // cells on each axis that jump flooding looks away
    half: u32,            // which half of the nearest cells is read
    steps: u32,           // look-ups of a ray at most
    hit: f32,             // a ray meets what it is no farther from, cells
}

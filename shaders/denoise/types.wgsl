// Denoising.

struct DenoiseOwn {       // what a kernel is told
    width: u32,           // columns of the picture
    height: u32,          // its rows
    layer: u32,           // the layer that is filtered: 0, the light of lamps; 1, all other light
    level: u32,           // denoise_filter: the level, whose pixels are 2^level apart
    radius: i32,          // denoise_vary: the neighbourhood that tells variances, pixels to each side
    tolerance: f32,       // denoise_filter: standard deviations of colour that count as alike
    sparse: u32,          // 1: most samples of the layer may find nothing, and a few much
    remembers: u32,       // denoise_begin: 1, there is a history
}

struct DenoiseSeen {      // What a pixel shows.
    point: vec3<f32>,     // the hit point relative to the camera, world units
    footprint: f32,       // width of the pixel at the hit, world units
    plane: vec3<f32>,     // geometric unit normal toward the camera
    id: u32,              // triangle; NONE: nothing is hit
    normal: vec3<f32>,    // unit normal that is shaded
    second: u32,          // the number of its second surface among all; NONE: it shows one alone
}

struct DenoiseGiven {     // What a pixel is given beside that.
    albedo: vec3<f32>,    // share of light from everywhere that the surface reflects
    // the pixel of the frame before that shows the surface to the upper left: its column and, from bit 16 on, its row,
    // both plus 1; NONE: the surface is new
    before: u32,
    direct: vec3<f32>,    // the light of lamps on it, reflected
    polish: f32,          // 1 / the angle within which what it mirrors is alike, radians; 0 where it mirrors little
    around: vec3<f32>,    // what goes around the filter
    samples: f32,         // samples of the frame that show the surface
    shares: vec4<f32>,    // what that pixel, the next, and the two below weigh
    // by layer the mean of the squared distances of the light of these samples, divided by the albedo, from their mean
    spreads: vec2<f32>,
    padding0: u32,
    padding1: u32,
}

struct DenoiseSecond {    // The second surface of a pixel.
    point: vec3<f32>,     // as in DenoiseSeen
    footprint: f32,       // likewise
    normal: vec3<f32>,    // likewise
    id: u32,              // likewise
    albedo: vec3<f32>,    // share of light that it reflects, of all samples of the pixel
    padding0: u32,
    light: vec3<f32>,     // the light that it reflects
    padding1: u32,
}

struct DenoisePast {      // What is kept of a pixel's layer from frame to frame.
    long: vec3<f32>,      // average over many frames, after the first level of the filter
    length: f32,          // frames that it has, 0: none
    short: vec3<f32>,     // average over the last few
    brightest: f32,       // the greatest size of single frames, uncut; it fades
    mean: vec3<f32>,      // weighted mean of single frames
    spread: f32,          // weighted mean of squared distances from it
    squares: f32,         // sum of the squares of the weights
    count: f32,           // 1 / squares: as many frames of one weight tell as much; 0: none
    young: u32,           // 1: samples are too few to tell the variance
    padding0: u32,
}

struct DenoiseLit {       // Light while it is filtered.
    color: vec3<f32>,     // light divided by the albedo
    variance: f32,        // its variance; before that is known 1 where the light is sound, 0 where it is no number
}

const DENOISE_FIREFLIES: u32 = 0u; // place in the tally: pixels whose light was cut
const DENOISE_UNSOUND: u32 = 1u;   // pixels of the frame with a value that is not finite
const DENOISE_LOST: u32 = 2u;      // pixels of histories with such a value

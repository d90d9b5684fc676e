// Bindings of group 0, the resident part of the scene in the frame, and of group 1, the rays of a pass.

@group(0) @binding(0) var<storage, read> top8: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read> top2: array<TopNode2>;
@group(0) @binding(2) var<storage, read> leaves: array<Leaf>;
@group(0) @binding(3) var<storage, read> instances: array<Instance>;
@group(0) @binding(4) var<storage, read> bricks: array<Brick>;
@group(0) @binding(5) var<storage, read> roots: array<vec4<u32>>;
@group(0) @binding(6) var<storage, read> slots: array<Slot>;

@group(1) @binding(0) var<uniform> params: Params;
@group(1) @binding(1) var<storage, read_write> rays: array<Ray>;
@group(1) @binding(2) var<storage, read_write> hits: array<Hit>;
@group(1) @binding(3) var<storage, read_write> surfaces: array<Surface>;
@group(1) @binding(4) var<storage, read_write> demand: array<Demand>;           // per brick
@group(1) @binding(5) var<storage, read_write> counters: array<atomic<u32>, 32>;

fn zero_bits() -> u32 {
    return params.zero;
}

// Starts a ray's hit: nothing found within its range; triangle `source`, from which it starts, is not met (NONE: of
// none).
fn start_hit(ray: u32, t_max: f32, source: u32) {
    hits[ray] = Hit(t_max, NONE, 0.0, 0.0);
    surfaces[ray] = Surface(vec3<f32>(0.0), NONE, vec3<f32>(0.0), 0u, 0.0, source, 1u, 0u);
}

// Whether a ray is traced: it has a range, and nothing has answered it before.
fn is_traced(index: u32, ray: Ray) -> bool {
    return ray.t_min <= ray.t_max && ray.t_min <= hits[index].t;
}

// For how many rays one that met nothing counts: those beside it were not traced (roma_trace.wgsl).
fn weight_of(index: u32) -> f32 {
    return 1.0 + hits[index].u;
}

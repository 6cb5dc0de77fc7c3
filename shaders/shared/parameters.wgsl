// The parameters of one dispatch. `render::parameters::Parameters` has the same layout; a test compares the
// two.

// One endpoint of the rig: the camera, or the projector. The camera's frame is the frame of all geometry.
struct Endpoint {
    // Its axes in that frame: right, up, and backwards along the optical axis.
    right: vec3f,
    // Radius of the aperture; 0 is a pinhole. Lengths are in the unit of all geometry (`render::unit`).
    radius: f32,
    up: vec3f,
    // Distance of the plane of focus along the optical axis.
    focus: f32,
    back: vec3f,
    padding: f32,
    position: vec3f,
    padding2: f32,
    // Half the extent of the image plane at distance 1, in x and y.
    tangent: vec2f,
    resolution: vec2u,
}

struct Parameters {
    // The endpoint at which the paths start, and the one to which they are connected.
    start: Endpoint,
    end: Endpoint,
    // The first path of this dispatch, as pixel and sample.
    first_pixel: u32,
    first_sample: u32,
    // Paths in this dispatch.
    paths: u32,
    // Samples per pixel.
    samples: u32,
    // The most surfaces that a path meets.
    max_bounces: u32,
    seed: u32,
    // Marks the records of this dispatch, so that the host does not mistake records of an earlier dispatch
    // for them.
    mark: u32,
    // Path samples per image-plane area from `end`, divided by those from `start`.
    end_to_start: f32,
    // Turns the estimate of a path, in units of length, into one per camera sample, in metres.
    scale: f32,
    // Radius within which photons of specular chains are gathered, and 1 / (2 radius).
    gather_radius: f32,
    inverse_cell: f32,
    // Buckets of the photons' hash grid (a power of two) minus 1; 0 without photons.
    bucket_mask: u32,
    // Slots of a path's record; for `trace_photons`, the most surfaces of a chain.
    stride: u32,
    // SOBOL or INDEPENDENT.
    sampling: u32,
    // The most paths that one invocation traces, one after the other.
    paths_per_invocation: u32,
    // Number of photons.
    photons: u32,
}

// The sampler: scrambled Sobol points, or independent numbers.
const SOBOL = 0u;
const INDEPENDENT = 1u;

// The index that stands for no triangle, no pixel, no region, and so on.
const NONE = 0xffffffffu;

@group(0) @binding(0) var<uniform> parameters: Parameters;

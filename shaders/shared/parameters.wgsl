// What one dispatch works on. Laid out as `render::parameters::Parameters`; a test compares the two.

// One end of the rig: the camera, or the projector. The camera's own frame is the frame of all geometry.
struct Endpoint {
    // Its axes: right, up, and backwards along the optical axis.
    right: vec3f,
    // Radius of the aperture; 0 is a pinhole.
    radius: f32,
    up: vec3f,
    // Distance of the plane in focus along the optical axis.
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
    // Where the paths of this dispatch begin, and where their connections end.
    start: Endpoint,
    end: Endpoint,
    // The first path of this dispatch, as pixel and sample.
    first_pixel: u32,
    first_sample: u32,
    // Paths in this dispatch.
    paths: u32,
    // Samples per pixel.
    samples: u32,
    max_bounces: u32,
    seed: u32,
    // Marks the records of this dispatch, so that those of an earlier one cannot be taken for them.
    mark: u32,
    // Samples per image-plane area from `end`, over those from `start`.
    end_to_start: f32,
    // Turns the estimate of a path from the projector into one per camera sample; 1 for paths from the camera.
    scale: f32,
    // Radius within which photons of the specular chains are gathered, and 1 / (2 radius).
    gather_radius: f32,
    inverse_cell: f32,
    // Buckets of the photons' hash grid (a power of two) minus 1; 0 where there are no photons.
    bucket_mask: u32,
    // Slots of a path's record.
    stride: u32,
    // SOBOL or INDEPENDENT.
    sampling: u32,
    // Paths that one invocation takes, one after the other.
    paths_per_invocation: u32,
    padding: u32,
}

const SOBOL = 0u;
const INDEPENDENT = 1u;

const NONE = 0xffffffffu;

@group(0) @binding(0) var<uniform> parameters: Parameters;

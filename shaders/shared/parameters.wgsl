// What one dispatch works on. Laid out as `render::parameters::Parameters`; a test compares the two.

struct Parameters {
    resolution: vec2u,
    // Half the extent of the image plane at distance 1, in x and y.
    tangent: vec2f,
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
    // 1 where the scene emits light of its own.
    ambient: u32,
    // SOBOL or INDEPENDENT.
    sampling: u32,
    padding: u32,
}

const SOBOL = 0u;
const INDEPENDENT = 1u;

const NONE = 0xffffffffu;

@group(0) @binding(0) var<uniform> parameters: Parameters;

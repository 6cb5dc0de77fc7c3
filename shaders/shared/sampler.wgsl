// The numbers that decide a path: four for each of its vertices.
#import parameters
#import rng

// Four numbers in [0, 1) for vertex `vertex` of path (`pixel`, `sample`); vertex 0 is the lens.
fn sample4(pixel: u32, sample: u32, vertex: u32) -> vec4f {
    return random4(pixel, sample, vertex, parameters.seed);
}

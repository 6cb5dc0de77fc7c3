// The start of a path: its pixel, its sample, and its first ray.
#import parameters
#import sampler
#import endpoint

// Identifies a path: one sample of one pixel of the endpoint at which paths start.
struct PixelSample {
    pixel: u32,
    sample: u32,
    // Column and row of the pixel.
    corner: vec2u,
}

struct Start {
    pixel: u32,
    sample: u32,
    // The start point on the image plane at distance 1, and the direction towards it in the endpoint's frame, not normalized.
    image: vec2f,
    towards: vec3f,
    // The first ray, in the frame of all geometry. The direction is normalized.
    origin: vec3f,
    direction: vec3f,
}

// Pixel and sample of the dispatch's path `index`. Paths are numbered pixel by pixel, sample by sample.
fn pixel_sample(index: u32) -> PixelSample {
    let path = parameters.first_sample + index;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let width = parameters.start.resolution.x;
    return PixelSample(pixel, path % parameters.samples, vec2u(pixel % width, pixel / width));
}

// Pixel and sample of the path that comes `paths` later. It uses no division, which is slow.
fn pixel_sample_after(earlier: PixelSample, paths: u32) -> PixelSample {
    var after = earlier;
    after.sample += paths;
    while (after.sample >= parameters.samples) {
        after.sample -= parameters.samples;
        after.pixel += 1u;
        after.corner.x += 1u;
        if (after.corner.x == parameters.start.resolution.x) {
            after.corner = vec2u(0u, after.corner.y + 1u);
        }
    }
    return after;
}

// The start of a path: uniform over the area of the pixel on the image plane, and over the area of the lens.
fn path_start(which: PixelSample) -> Start {
    let u = sample4(which.pixel, which.sample, 0u);
    let lens = endpoint_lens_point(parameters.start, u.zw);
    let image = endpoint_image_point(parameters.start, vec2f(which.corner) + u.xy);
    let towards = endpoint_direction(parameters.start, image, lens);
    let direction = normalize(endpoint_to_world(parameters.start, towards));
    return Start(which.pixel, which.sample, image, towards, endpoint_origin(parameters.start, lens), direction);
}

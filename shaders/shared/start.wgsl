// Where a path begins: which pixel and sample it has, and the ray that they stand for.
#import parameters
#import sampler
#import endpoint

// Whose turn it is.
struct PixelSample {
    pixel: u32,
    sample: u32,
    // Column and row of the pixel.
    corner: vec2u,
}

struct Start {
    pixel: u32,
    sample: u32,
    // On the image plane at distance 1, and the direction towards it in the endpoint's frame.
    image: vec2f,
    towards: vec3f,
    // The ray, in the frame of all geometry.
    origin: vec3f,
    direction: vec3f,
}

// Of the dispatch's path `index`.
fn pixel_sample(index: u32) -> PixelSample {
    let path = parameters.first_sample + index;
    let pixel = parameters.first_pixel + path / parameters.samples;
    let width = parameters.start.resolution.x;
    return PixelSample(pixel, path % parameters.samples, vec2u(pixel % width, pixel / width));
}

// Of the path so many behind the one there. Without divisions, which are slow.
fn pixel_sample_after(place: PixelSample, paths: u32) -> PixelSample {
    var after = place;
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

fn path_start(place: PixelSample) -> Start {
    let u = sample4(place.pixel, place.sample, 0u);
    let lens = endpoint_lens_point(parameters.start, u.zw);
    let image = endpoint_image_point(parameters.start, vec2f(place.corner) + u.xy);
    let towards = endpoint_direction(parameters.start, image, lens);
    let direction = normalize(endpoint_to_world(parameters.start, towards));
    return Start(place.pixel, place.sample, image, towards, endpoint_origin(parameters.start, lens), direction);
}
